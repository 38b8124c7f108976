//! Laws of springs beside the linear one, as data.

use std::fmt;
use std::sync::Arc;

/// How the tension of a spring depends on its length, if not linearly. K and l₀ are
/// those of the spring, ε = l/l₀ − 1; `springs_math::law` has the formulas.
#[derive(Clone, Debug, PartialEq)]
pub enum SpringLaw {
    /// Pulls with K(l − l₀), and does not push.
    TensionOnly {
        /// The strain above l₀ within which K sets in.
        blend: f64,
    },
    /// Pushes with K(l₀ − l), and does not pull.
    CompressionOnly {
        /// The strain below l₀ within which K sets in.
        blend: f64,
    },
    /// K where stretched, another stiffness where compressed.
    Bilinear {
        /// The stiffness where compressed, in N/m.
        compression: f64,
        /// The strain, on the stiffer side, within which one becomes the other.
        blend: f64,
    },
    /// K up to a strain of ±`strain`, and K + `stiffness` beyond.
    Limit {
        /// A strain.
        strain: f64,
        /// In N/m.
        stiffness: f64,
        /// The strain within which it sets in.
        blend: f64,
    },
    /// T = K l₀ sign(ε)|ε|ᵖ.
    Power {
        /// p, at least 1.
        exponent: f64,
    },
    /// T = a₁ε + a₂ε² + …, in N; K is a₁/l₀.
    Polynomial(Arc<[f64]>),
    /// A smooth curve through points (ε, T in N), in the order of ε, that rises and
    /// falls where they do, and beyond its ends goes on along lines with its slopes there; K
    /// is the slope of the line through the two points around ε = 0.
    Table(Arc<[[f64; 2]]>),
    /// K up to a tension of ±`yields_at`; from there on it yields, and keeps a part of its
    /// change of length for good (kinematic hardening).
    Plastic {
        /// In N.
        yields_at: f64,
        /// The stiffness while it yields, in N/m; below K.
        hardening: f64,
    },
}

/// What is wrong with a law.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LawFault {
    /// A number is infinite or not a number.
    #[error("{what} must be a finite number, but is {value}")]
    NotFinite {
        /// Which number.
        what: &'static str,
        /// The number.
        value: f64,
    },
    /// A number must not be negative.
    #[error("{what} must not be negative, but is {value}")]
    Negative {
        /// Which number.
        what: &'static str,
        /// The number.
        value: f64,
    },
    /// A blend is no small strain.
    #[error("{what} is a strain and must not be above 1, but is {value}")]
    WideBlend {
        /// Which number.
        what: &'static str,
        /// The number.
        value: f64,
    },
    /// The stiffness would be infinite at the rest length.
    #[error("the exponent of `Power` must be at least 1, but is {value}")]
    SmallExponent {
        /// The exponent.
        value: f64,
    },
    /// A polynomial has no coefficients.
    #[error("`Polynomial` needs at least one coefficient")]
    NoCoefficients,
    /// A curve needs two points.
    #[error("`Table` needs at least two points, but has {points}")]
    FewPoints {
        /// How many there are.
        points: usize,
    },
    /// Strains must rise from point to point.
    #[error("the strains of `Table` are not in order: {before:?} stands before {after:?}")]
    NotInOrder {
        /// The first of two strains.
        before: f64,
        /// The second.
        after: f64,
    },
    /// A strain that no spring has.
    #[error("`Table` has a strain of {value:?}, but no spring is shorter than at -1")]
    Shorter {
        /// The strain.
        value: f64,
    },
    /// T < 0 at all points.
    #[error("`Table` has negative tensions only, so that its spring is never at rest")]
    NeverAtRest,
    /// A slope exceeds the number range.
    #[error("`Table` rises from one point to the next by more than can be computed with")]
    TooSteep,
}

impl LawFault {
    /// What to do about it, where that is not plain from the message.
    pub(crate) fn advice(&self) -> Option<&'static str> {
        match self {
            Self::NoCoefficients => Some("the first one is EA, in N"),
            Self::FewPoints { .. } => Some("points are (strain, tension in N)"),
            Self::NotInOrder { .. } => Some("each strain must be above the one before"),
            Self::NeverAtRest => Some("give it a point where the tension is not negative"),
            Self::SmallExponent { .. } => Some("1 is the linear law"),
            _ => None,
        }
    }
}

impl SpringLaw {
    /// The strain that stiffnesses are blended within where nothing else is said.
    pub const BLEND: f64 = 1e-3;

    /// Its name in scene files.
    pub fn name(&self) -> &'static str {
        match self {
            Self::TensionOnly { .. } => "TensionOnly",
            Self::CompressionOnly { .. } => "CompressionOnly",
            Self::Bilinear { .. } => "Bilinear",
            Self::Limit { .. } => "Limit",
            Self::Power { .. } => "Power",
            Self::Polynomial(_) => "Polynomial",
            Self::Table(_) => "Table",
            Self::Plastic { .. } => "Plastic",
        }
    }

    /// dT/dε at rest, in N, of a law that gives tensions by itself; `None` where K says
    /// it.
    pub fn own_axial_stiffness(&self) -> Option<f64> {
        match self {
            Self::Polynomial(coefficients) => coefficients.first().copied(),
            Self::Table(points) => {
                let beyond = points.partition_point(|[strain, _]| *strain <= 0.0);
                let last = beyond.clamp(1, points.len().saturating_sub(1).max(1));
                let [&[e0, t0], &[e1, t1]] = [points.get(last - 1)?, points.get(last)?];
                Some(((t1 - t0) / (e1 - e0)).max(0.0))
            }
            _ => None,
        }
    }

    /// Whether it is a law in strain, so that l₀ must not be zero.
    pub fn needs_rest_length(&self) -> bool {
        match self {
            Self::TensionOnly { .. }
            | Self::CompressionOnly { .. }
            | Self::Bilinear { .. }
            | Self::Plastic { .. } => false,
            Self::Limit { .. } | Self::Power { .. } | Self::Polynomial(_) | Self::Table(_) => true,
        }
    }

    /// The law with tensions `factor` times as large, where its springs have a K as many
    /// times as large.
    pub fn times(&self, factor: f64) -> Self {
        match self {
            Self::TensionOnly { .. } | Self::CompressionOnly { .. } | Self::Power { .. } => {
                self.clone()
            }
            &Self::Bilinear { compression, blend } => Self::Bilinear {
                compression: compression * factor,
                blend,
            },
            &Self::Limit {
                strain,
                stiffness,
                blend,
            } => Self::Limit {
                strain,
                stiffness: stiffness * factor,
                blend,
            },
            &Self::Plastic {
                yields_at,
                hardening,
            } => Self::Plastic {
                yields_at: yields_at * factor,
                hardening: hardening * factor,
            },
            Self::Polynomial(coefficients) => {
                Self::Polynomial(coefficients.iter().map(|a| a * factor).collect())
            }
            Self::Table(points) => {
                let points = points.iter();
                Self::Table(points.map(|&[e, t]| [e, t * factor]).collect())
            }
        }
    }

    /// The first thing that is wrong with it.
    pub fn fault(&self) -> Option<LawFault> {
        let not_negative = |what, value: f64| {
            let finite = finite(what, value);
            finite.or_else(|| (value < 0.0).then_some(LawFault::Negative { what, value }))
        };
        let blend = |what, value: f64| {
            let fault = not_negative(what, value);
            fault.or_else(|| (value > 1.0).then_some(LawFault::WideBlend { what, value }))
        };
        match self {
            Self::TensionOnly { blend: width } => blend("the blend of `TensionOnly`", *width),
            Self::CompressionOnly { blend: width } => {
                blend("the blend of `CompressionOnly`", *width)
            }
            Self::Bilinear {
                compression,
                blend: width,
            } => not_negative("the compression of `Bilinear`", *compression)
                .or_else(|| blend("the blend of `Bilinear`", *width)),
            Self::Limit {
                strain,
                stiffness,
                blend: width,
            } => not_negative("the strain of `Limit`", *strain)
                .or_else(|| not_negative("the stiffness of `Limit`", *stiffness))
                .or_else(|| blend("the blend of `Limit`", *width)),
            &Self::Power { exponent: value } => finite("the exponent of `Power`", value)
                .or_else(|| (value < 1.0).then_some(LawFault::SmallExponent { value })),
            Self::Polynomial(coefficients) => match coefficients.first() {
                None => Some(LawFault::NoCoefficients),
                Some(&first) => not_negative("the first coefficient of `Polynomial`", first)
                    .or_else(|| {
                        let mut others = coefficients.iter();
                        others.find_map(|&a| finite("a coefficient of `Polynomial`", a))
                    }),
            },
            Self::Table(points) => fault_of_table(points),
            Self::Plastic {
                yields_at,
                hardening,
            } => not_negative("the tension at which `Plastic` yields", *yields_at)
                .or_else(|| not_negative("the hardening of `Plastic`", *hardening)),
        }
    }
}

fn finite(what: &'static str, value: f64) -> Option<LawFault> {
    (!value.is_finite()).then_some(LawFault::NotFinite { what, value })
}

fn fault_of_table(points: &[[f64; 2]]) -> Option<LawFault> {
    if points.len() < 2 {
        return Some(LawFault::FewPoints {
            points: points.len(),
        });
    }
    for &[strain, tension] in points {
        let fault = finite("a strain of `Table`", strain)
            .or_else(|| finite("a tension of `Table`", tension))
            .or_else(|| (strain < -1.0).then_some(LawFault::Shorter { value: strain }));
        if fault.is_some() {
            return fault;
        }
    }
    for pair in points.windows(2) {
        let [[before, t0], [after, t1]] = [pair[0], pair[1]];
        if before >= after {
            return Some(LawFault::NotInOrder { before, after });
        }
        let slope = (t1 - t0) / (after - before);
        // Coefficients of cubics have its square's order over a strain.
        if !(slope / (after - before) / (after - before)).is_finite() {
            return Some(LawFault::TooSteep);
        }
    }
    let is_never_at_rest = points.iter().all(|[_, tension]| *tension < 0.0);
    is_never_at_rest.then_some(LawFault::NeverAtRest)
}

impl fmt::Display for SpringLaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(points: &[[f64; 2]]) -> SpringLaw {
        SpringLaw::Table(points.into())
    }

    #[test]
    fn stiffness_at_rest_is_that_around_zero_strain() {
        let of = |points: &[[f64; 2]]| table(points).own_axial_stiffness();
        let points = [[-0.5, -1.0], [0.0, 0.0], [0.5, 4.0]];
        assert_eq!(of(&points), Some(8.0));
        assert_eq!(of(&points[..2]), Some(2.0));
        assert_eq!(of(&[[0.1, 1.0], [0.2, 2.0], [0.3, 9.0]]), Some(10.0));
        assert_eq!(of(&points[..1]), None);
        assert_eq!(of(&[]), None);
        let polynomial = SpringLaw::Polynomial([3.0, 7.0].into());
        assert_eq!(polynomial.own_axial_stiffness(), Some(3.0));
        let limit = SpringLaw::Power { exponent: 2.0 };
        assert_eq!(limit.own_axial_stiffness(), None);
    }

    #[test]
    fn every_fault_is_found() {
        let said = |law: SpringLaw| law.fault().map(|fault| fault.to_string());
        let sound = [
            SpringLaw::TensionOnly { blend: 0.0 },
            SpringLaw::Power { exponent: 1.0 },
            table(&[[0.0, 0.0], [1.0, 5.0]]),
        ];
        for law in sound {
            assert_eq!(said(law), None);
        }
        for (law, part) in [
            (
                SpringLaw::TensionOnly { blend: -1.0 },
                "must not be negative",
            ),
            (SpringLaw::CompressionOnly { blend: 2.0 }, "is a strain"),
            (
                SpringLaw::Bilinear {
                    compression: f64::NAN,
                    blend: 0.0,
                },
                "must be a finite number",
            ),
            (
                SpringLaw::Limit {
                    strain: 0.1,
                    stiffness: -1.0,
                    blend: 0.0,
                },
                "the stiffness of `Limit`",
            ),
            (SpringLaw::Power { exponent: 0.5 }, "at least 1"),
            (SpringLaw::Polynomial([].into()), "one coefficient"),
            (SpringLaw::Polynomial([-1.0].into()), "first coefficient"),
            (table(&[[0.0, 0.0]]), "two points"),
            (table(&[[0.0, 0.0], [0.0, 1.0]]), "not in order"),
            (table(&[[-2.0, 0.0], [0.0, 1.0]]), "no spring is shorter"),
            (table(&[[0.0, -2.0], [1.0, -1.0]]), "never at rest"),
            (table(&[[0.0, 0.0], [1e-150, 1e150]]), "rises"),
        ] {
            let said = said(law).unwrap_or_default();
            assert!(said.contains(part), "{part} in {said}");
        }
    }
}
