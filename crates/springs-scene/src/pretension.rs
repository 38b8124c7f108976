//! Rest lengths from the tension that a spring has as it is given.

use crate::SpringLaw;

/// What a spring resists stretching with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AxialStiffness {
    /// K of the spring, in N/m.
    OfSpring(f64),
    /// EA of its material, in N: K = EA/l₀.
    OfMaterial(f64),
}

impl AxialStiffness {
    /// K, in N/m, at a rest length in m.
    pub fn stiffness(&self, rest_length: f64) -> f64 {
        match self {
            Self::OfSpring(stiffness) => *stiffness,
            Self::OfMaterial(axial) => axial / rest_length,
        }
    }
}

/// Why no rest length gives a spring its tension.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PretensionError {
    /// The rest length would be negative, or infinite.
    #[error("{tension:?} N would take a rest length of {rest_length:?} m")]
    NoLength {
        /// The tension, in N.
        tension: f64,
        /// The length, in m.
        rest_length: f64,
    },
    /// The law pulls or pushes only.
    #[error("its law, `{law}`, never has a tension of {tension:?} N")]
    WrongSign {
        /// The law.
        law: &'static str,
        /// The tension, in N.
        tension: f64,
    },
    /// The strain is one at which the law is not linear.
    #[error("{tension:?} N is a strain of {strain:.3e}, where its law, `{law}`, is not linear")]
    NotLinear {
        /// The law.
        law: &'static str,
        /// The tension, in N.
        tension: f64,
        /// The strain, if the law was linear.
        strain: f64,
    },
    /// The law is not one of linear pieces.
    #[error("its law, `{law}`, is not solved for the length at which it has a tension")]
    NotSolved {
        /// The law.
        law: &'static str,
    },
}

/// l₀, in m, of a spring that has a tension in N at a length in m.
///
/// With EA it is l EA/(EA + T), with K it is l − T/K; likewise on every linear piece of
/// a law. Within the blend of a spring that only pulls or pushes it is solved for.
///
/// # Errors
///
/// If there is none, or the law is neither linear nor solved there.
pub fn rest_length_under(
    tension: f64,
    length: f64,
    axial: AxialStiffness,
    law: Option<&SpringLaw>,
) -> Result<f64, PretensionError> {
    let Some(law) = law else {
        return linear(tension, length, axial);
    };
    let name = law.name();
    if law.own_axial_stiffness().is_some() {
        return Err(PretensionError::NotSolved { law: name });
    }
    if tension == 0.0 {
        return Ok(length);
    }
    let is_pulled = tension > 0.0;
    let wrong_sign = PretensionError::WrongSign { law: name, tension };
    let (axial, within) = match *law {
        SpringLaw::TensionOnly { .. } if !is_pulled => return Err(wrong_sign),
        SpringLaw::CompressionOnly { .. } if is_pulled => return Err(wrong_sign),
        SpringLaw::TensionOnly { blend } | SpringLaw::CompressionOnly { blend } => {
            let rest_length = linear(tension, length, axial)?;
            let is_blended = (length / rest_length - 1.0).abs() < blend;
            return if is_blended {
                sound(tension, within_blend(tension, length, axial, blend))
            } else {
                Ok(rest_length)
            };
        }
        SpringLaw::Bilinear { compression, blend } => {
            let of_side = |is_pulled| {
                if is_pulled {
                    axial
                } else {
                    AxialStiffness::OfSpring(compression)
                }
            };
            let [here, there] = [is_pulled, !is_pulled].map(of_side);
            let rest_length = linear(tension, length, here)?;
            let is_stiffer = here.stiffness(rest_length) > there.stiffness(rest_length);
            (here, if is_stiffer { blend } else { 0.0 }..=f64::INFINITY)
        }
        SpringLaw::Limit { strain, .. } => (axial, 0.0..=strain),
        SpringLaw::Power { exponent } => {
            let AxialStiffness::OfMaterial(axial) = axial else {
                return Err(PretensionError::NotSolved { law: name });
            };
            let strain = (tension.abs() / axial).powf(exponent.recip());
            return sound(tension, length / (1.0 + strain.copysign(tension)));
        }
        SpringLaw::Plastic { yields_at, .. } if tension.abs() <= yields_at => {
            (axial, 0.0..=f64::INFINITY)
        }
        SpringLaw::Polynomial(_) | SpringLaw::Table(_) | SpringLaw::Plastic { .. } => {
            return Err(PretensionError::NotSolved { law: name });
        }
    };
    let rest_length = linear(tension, length, axial)?;
    let strain = length / rest_length - 1.0;
    if within.contains(&strain.abs()) {
        Ok(rest_length)
    } else {
        Err(PretensionError::NotLinear {
            law: name,
            tension,
            strain,
        })
    }
}

/// Bisections, after which there are no numbers between.
const BISECTIONS: usize = 64;

/// l₀ where a spring that only pulls or pushes is within its blend: at the part u of it the
/// strain is ±δu, and the tension ±K δ l₀ u³(6 − 8u + 3u²), which grows with u.
fn within_blend(tension: f64, length: f64, axial: AxialStiffness, blend: f64) -> f64 {
    let rest_length = |u: f64| length / (1.0 + (blend * u).copysign(tension));
    let size = |u: f64| {
        let l0 = rest_length(u);
        axial.stiffness(l0) * blend * l0 * u.powi(3) * (6.0 - u * (8.0 - 3.0 * u))
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        if size(middle) < tension.abs() {
            low = middle;
        } else {
            high = middle;
        }
    }
    rest_length(high)
}

fn linear(tension: f64, length: f64, axial: AxialStiffness) -> Result<f64, PretensionError> {
    let rest_length = match axial {
        AxialStiffness::OfSpring(stiffness) => length - tension / stiffness,
        AxialStiffness::OfMaterial(axial) => length * axial / (axial + tension),
    };
    sound(tension, rest_length)
}

fn sound(tension: f64, rest_length: f64) -> Result<f64, PretensionError> {
    if rest_length.is_finite() && rest_length >= 0.0 {
        Ok(rest_length)
    } else {
        Err(PretensionError::NoLength {
            tension,
            rest_length,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use AxialStiffness::{OfMaterial, OfSpring};

    const TENSION_ONLY: SpringLaw = SpringLaw::TensionOnly { blend: 1e-3 };

    #[test]
    fn linear_springs_have_the_length_of_hookes_law() {
        assert_eq!(rest_length_under(10.0, 2.0, OfSpring(100.0), None), Ok(1.9));
        // T = EA (l − l₀)/l₀.
        let l0 = rest_length_under(25.0, 2.0, OfMaterial(100.0), None).unwrap();
        assert_eq!(l0, 1.6);
        assert_eq!(OfMaterial(100.0).stiffness(l0), 62.5);
        for (tension, axial) in [
            (300.0, OfSpring(100.0)),
            (-100.0, OfMaterial(100.0)),
            (1.0, OfSpring(0.0)),
        ] {
            let error = rest_length_under(tension, 2.0, axial, None);
            assert!(
                matches!(error, Err(PretensionError::NoLength { .. })),
                "{error:?}"
            );
        }
    }

    #[test]
    fn laws_are_solved_where_they_are_linear() {
        let of = |tension, law: &SpringLaw| {
            rest_length_under(tension, 2.0, OfMaterial(100.0), Some(law))
        };
        let bilinear = SpringLaw::Bilinear {
            compression: 10.0,
            blend: 0.0,
        };
        let limit = SpringLaw::Limit {
            strain: 0.3,
            stiffness: 1e3,
            blend: 0.0,
        };
        let square = SpringLaw::Power { exponent: 2.0 };
        assert_eq!(of(25.0, &TENSION_ONLY), Ok(1.6));
        assert_eq!(of(25.0, &bilinear), Ok(1.6));
        assert_eq!(of(-5.0, &bilinear), Ok(2.5));
        assert_eq!(of(25.0, &limit), Ok(1.6));
        assert_eq!(of(25.0, &square), Ok(2.0 / 1.5));
        assert_eq!(of(-25.0, &square), Ok(4.0));
        assert_eq!(of(0.0, &TENSION_ONLY), Ok(2.0));
        let is_not_linear = |error| matches!(error, Err(PretensionError::NotLinear { .. }));
        assert!(is_not_linear(of(50.0, &limit)));
        let wrong = of(-1.0, &TENSION_ONLY);
        assert!(
            matches!(wrong, Err(PretensionError::WrongSign { .. })),
            "{wrong:?}"
        );
        let table = SpringLaw::Polynomial([1.0].into());
        let unsolved = of(1.0, &table);
        assert!(
            matches!(unsolved, Err(PretensionError::NotSolved { .. })),
            "{unsolved:?}"
        );
    }
}
