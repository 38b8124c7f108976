//! Laws of springs beside the linear one, as data.
//!
//! A law is a row of the table below; names, numbers and what they may be serve scene
//! files, faults and scaling alike. `springs_math::law` has the formulas.

use std::fmt;
use std::sync::Arc;

/// What a number of a law is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Quantity {
    /// A stiffness in N/m; not negative.
    Stiffness,
    /// A tension in N; not negative.
    Tension,
    /// A strain; not negative.
    Strain,
    /// A strain, up to 1, within which one stiffness becomes another.
    Blend,
    /// At least 1.
    Exponent,
}

/// A number of a law.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct LawField {
    /// Its name in scene files.
    pub name: &'static str,
    /// What it is.
    pub quantity: Quantity,
    /// What it is if left out; if it must not be, `None`.
    pub default: Option<f64>,
}

/// A law that is made of numbers with names.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct LawForm {
    /// Its name in scene files.
    pub name: &'static str,
    /// Its numbers.
    pub fields: &'static [LawField],
    /// The names of these.
    pub field_names: &'static [&'static str],
    make: fn(&[f64]) -> SpringLaw,
}

impl LawForm {
    /// The law with so many numbers as there are [fields](Self::fields), in their order.
    ///
    /// # Panics
    ///
    /// If there are not as many.
    pub fn law(&self, numbers: &[f64]) -> SpringLaw {
        assert_eq!(numbers.len(), self.fields.len(), "numbers of {}", self.name);
        (self.make)(numbers)
    }
}

/// One row a law: what it does, its numbers, and whether it is a law in strain, so that
/// l₀ must not be zero.
macro_rules! laws {
    ($(
        $(#[$doc:meta])*
        $law:ident($is_in_strain:ident) {
            $($(#[$field_doc:meta])* $field:ident: $quantity:ident $(= $default:expr)?,)+
        }
    )+) => {
        /// How the tension of a spring depends on its length, if not linearly. K and l₀ are
        /// those of the spring, ε = l/l₀ − 1; `springs_math::law` has the formulas.
        #[derive(Clone, Debug, PartialEq)]
        pub enum SpringLaw {
            $(
                $(#[$doc])*
                $law { $($(#[$field_doc])* $field: f64,)+ },
            )+
            /// T = a₁ε + a₂ε² + …, in N; K is a₁/l₀.
            Polynomial(Arc<[f64]>),
            /// A smooth curve through points (ε, T in N), in the order of ε, that rises and
            /// falls where they do, and beyond its ends goes on along lines with its slopes
            /// there; K is the slope of the line through the two points around ε = 0.
            Table(Arc<[[f64; 2]]>),
        }

        impl SpringLaw {
            /// All laws that are made of numbers with names.
            pub const FORMS: &'static [LawForm] = &[$(
                LawForm {
                    name: stringify!($law),
                    fields: &[$(
                        LawField {
                            name: stringify!($field),
                            quantity: Quantity::$quantity,
                            default: default!($($default)?),
                        },
                    )+],
                    field_names: &[$(stringify!($field),)+],
                    make: |numbers| {
                        let mut numbers = numbers.iter().copied();
                        let mut next = || numbers.next().expect("a number for each field");
                        SpringLaw::$law { $($field: next(),)+ }
                    },
                },
            )+];

            /// Its form and its numbers, if it is made of numbers with names.
            pub fn numbers(&self) -> Option<(&'static LawForm, Vec<f64>)> {
                let (name, numbers) = match self {
                    $(Self::$law { $($field,)+ } => (stringify!($law), vec![$(*$field,)+]),)+
                    Self::Polynomial(_) | Self::Table(_) => return None,
                };
                let form = Self::FORMS.iter().find(|form| form.name == name);
                form.map(|form| (form, numbers))
            }

            /// Its name in scene files.
            pub fn name(&self) -> &'static str {
                match self {
                    $(Self::$law { .. } => stringify!($law),)+
                    Self::Polynomial(_) => Self::POLYNOMIAL,
                    Self::Table(_) => Self::TABLE,
                }
            }

            /// Whether it is a law in strain, so that l₀ must not be zero.
            pub fn needs_rest_length(&self) -> bool {
                match self {
                    $(Self::$law { .. } => laws!(@$is_in_strain),)+
                    Self::Polynomial(_) | Self::Table(_) => true,
                }
            }
        }
    };
    (@in_strain) => { true };
    (@in_length) => { false };
}

macro_rules! default {
    () => {
        None
    };
    ($default:expr) => {
        Some($default)
    };
}

laws! {
    /// Pulls with K(l − l₀), and does not push.
    TensionOnly(in_length) {
        /// The strain above l₀ within which K sets in.
        blend: Blend = SpringLaw::BLEND,
    }

    /// Pushes with K(l₀ − l), and does not pull.
    CompressionOnly(in_length) {
        /// The strain below l₀ within which K sets in.
        blend: Blend = SpringLaw::BLEND,
    }

    /// K where stretched, another stiffness where compressed.
    Bilinear(in_length) {
        /// The stiffness where compressed, in N/m.
        compression: Stiffness,
        /// The strain, on the stiffer side, within which one becomes the other.
        blend: Blend = SpringLaw::BLEND,
    }

    /// K up to a strain of ±`strain`, and K + `stiffness` beyond.
    Limit(in_strain) {
        /// A strain.
        strain: Strain,
        /// In N/m.
        stiffness: Stiffness,
        /// The strain within which it sets in.
        blend: Blend = SpringLaw::BLEND,
    }

    /// T = K l₀ sign(ε)|ε|ᵖ.
    Power(in_strain) {
        /// p, at least 1.
        exponent: Exponent,
    }

    /// K up to a tension of ±`yields_at`; from there on it yields, and keeps a part of its
    /// change of length for good (kinematic hardening).
    Plastic(in_length) {
        /// In N.
        yields_at: Tension,
        /// The stiffness while it yields, in N/m; below K.
        hardening: Stiffness = 0.0,
    }
}

/// What is wrong with a law.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LawFault {
    /// A number is infinite or not a number.
    #[error("the {number} of `{law}` must be a finite number, but is {value}")]
    NotFinite {
        /// The law.
        law: &'static str,
        /// Which number.
        number: &'static str,
        /// The number.
        value: f64,
    },
    /// A number must not be negative.
    #[error("the {number} of `{law}` must not be negative, but is {value}")]
    Negative {
        /// The law.
        law: &'static str,
        /// Which number.
        number: &'static str,
        /// The number.
        value: f64,
    },
    /// A blend is no small strain.
    #[error("the {number} of `{law}` is a strain and must not be above 1, but is {value}")]
    WideBlend {
        /// The law.
        law: &'static str,
        /// Which number.
        number: &'static str,
        /// The number.
        value: f64,
    },
    /// The stiffness would be infinite at the rest length.
    #[error("the {number} of `{law}` must be at least 1, but is {value}")]
    SmallExponent {
        /// The law.
        law: &'static str,
        /// Which number.
        number: &'static str,
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

    /// The name of [`Self::Polynomial`] in scene files.
    pub const POLYNOMIAL: &'static str = "Polynomial";

    /// The name of [`Self::Table`] in scene files.
    pub const TABLE: &'static str = "Table";

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

    /// The law with tensions `factor` times as large, where its springs have a K as many
    /// times as large.
    pub fn times(&self, factor: f64) -> Self {
        match self {
            Self::Polynomial(coefficients) => {
                Self::Polynomial(coefficients.iter().map(|a| a * factor).collect())
            }
            Self::Table(points) => {
                let points = points.iter();
                Self::Table(points.map(|&[e, t]| [e, t * factor]).collect())
            }
            _ => {
                let (form, mut numbers) = self.numbers().expect("all others have numbers");
                for (number, field) in numbers.iter_mut().zip(form.fields) {
                    if matches!(field.quantity, Quantity::Stiffness | Quantity::Tension) {
                        *number *= factor;
                    }
                }
                form.law(&numbers)
            }
        }
    }

    /// The first thing that is wrong with it.
    pub fn fault(&self) -> Option<LawFault> {
        if let Some((form, numbers)) = self.numbers() {
            let mut numbers = form.fields.iter().zip(numbers);
            return numbers.find_map(|(field, value)| field.fault(form.name, value));
        }
        match self {
            Self::Polynomial(coefficients) => fault_of_polynomial(coefficients),
            Self::Table(points) => fault_of_table(points),
            _ => None,
        }
    }
}

impl LawField {
    fn fault(&self, law: &'static str, value: f64) -> Option<LawFault> {
        let number = self.name;
        if let Some(fault) = finite(law, number, value) {
            return Some(fault);
        }
        match self.quantity {
            Quantity::Exponent => {
                (value < 1.0).then_some(LawFault::SmallExponent { law, number, value })
            }
            _ if value < 0.0 => Some(LawFault::Negative { law, number, value }),
            Quantity::Blend if value > 1.0 => Some(LawFault::WideBlend { law, number, value }),
            _ => None,
        }
    }
}

fn finite(law: &'static str, number: &'static str, value: f64) -> Option<LawFault> {
    (!value.is_finite()).then_some(LawFault::NotFinite { law, number, value })
}

fn fault_of_polynomial(coefficients: &[f64]) -> Option<LawFault> {
    let law = SpringLaw::POLYNOMIAL;
    let Some(&value) = coefficients.first() else {
        return Some(LawFault::NoCoefficients);
    };
    let number = "first coefficient";
    let first = finite(law, number, value)
        .or_else(|| (value < 0.0).then_some(LawFault::Negative { law, number, value }));
    let mut others = coefficients.iter();
    first.or_else(|| others.find_map(|&a| finite(law, "coefficients", a)))
}

fn fault_of_table(points: &[[f64; 2]]) -> Option<LawFault> {
    if points.len() < 2 {
        return Some(LawFault::FewPoints {
            points: points.len(),
        });
    }
    for &[strain, tension] in points {
        let fault = finite(SpringLaw::TABLE, "strains", strain)
            .or_else(|| finite(SpringLaw::TABLE, "tensions", tension))
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
