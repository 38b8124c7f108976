//! How to simulate a scene.

use std::fmt;
use std::str::FromStr;

/// Settings of a simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The method that advances the scene.
    pub method: Method,
    /// How the across-spring stiffness enters the matrix; `None`: the method's
    /// own default.
    pub tangent: Option<Tangent>,
    /// How step sizes are chosen.
    pub step: StepControl,
    /// Simulated time, in s.
    pub duration: f64,
    /// Where nodes are at the start.
    pub start: Start,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            method: Method::Auto,
            tangent: None,
            step: StepControl::Auto,
            duration: 1.0,
            start: Start::default(),
        }
    }
}

/// How a scene is run: nothing of it belongs to what is simulated.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RunOptions {
    /// Threads that may be used; 0: as many as the machine has. No result
    /// depends on it.
    pub threads: usize,
    /// How precisely linear systems are solved where they are solved by
    /// iteration.
    pub linear_tolerance: LinearTolerance,
    /// Whether what a scene does not need is left out. Results are the same up
    /// to rounding.
    pub skip: bool,
    /// Parts of the scene that can move no further than this, in m, before they
    /// come to rest are put to sleep; `None`: only what is exactly at rest.
    pub sleep: Option<f64>,
    /// Whether a step of fixed size that cannot be made is made in shorter ones.
    pub substeps: bool,
}

impl RunOptions {
    /// The same with so many threads; 0: as many as the machine has.
    pub fn with_threads(self, threads: usize) -> Self {
        Self { threads, ..self }
    }

    /// The same with linear systems solved so precisely.
    pub fn with_linear_tolerance(self, linear_tolerance: LinearTolerance) -> Self {
        Self {
            linear_tolerance,
            ..self
        }
    }

    /// The same with or without what a scene does not need.
    pub fn with_skip(self, skip: bool) -> Self {
        Self { skip, ..self }
    }

    /// The same with parts asleep that can move no further than this, in m.
    pub fn with_sleep(self, reach: f64) -> Self {
        Self {
            sleep: Some(reach),
            ..self
        }
    }

    /// The same with or without shorter steps in place of those that fail.
    pub fn with_substeps(self, substeps: bool) -> Self {
        Self { substeps, ..self }
    }
}

impl Default for RunOptions {
    fn default() -> Self {
        Self {
            threads: 0,
            linear_tolerance: LinearTolerance::Sufficient,
            skip: true,
            sleep: None,
            substeps: false,
        }
    }
}

/// How step sizes are chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum StepControl {
    /// Nothing was asked for.
    #[default]
    Auto,
    /// Steps of exactly this size, in s.
    Fixed(f64),
    /// Steps such that the error of positions stays below this, in m.
    Tolerance(f64),
}

/// An enum whose variants have one name in scene files (`CamelCase`) and the
/// same name in kebab-case on the command line.
macro_rules! named {
    (
        $(#[$attribute:meta])*
        $name:ident, $what:literal {
            $($(#[$variant_doc:meta])* $variant:ident = $kebab:literal,)+
        }
    ) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum $name {
            $($(#[$variant_doc])* $variant,)+
        }

        impl $name {
            /// All of them.
            pub const ALL: &[Self] = &[$(Self::$variant),+];

            /// The name in scene files, in CamelCase.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => stringify!($variant),)+
                }
            }

            /// The name on the command line, in kebab-case.
            pub fn kebab_name(self) -> &'static str {
                match self {
                    $(Self::$variant => $kebab,)+
                }
            }
        }

        /// The name in kebab-case.
        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.pad(self.kebab_name())
            }
        }

        /// From either name.
        impl FromStr for $name {
            type Err = UnknownName;

            fn from_str(name: &str) -> Result<Self, UnknownName> {
                Self::ALL
                    .iter()
                    .copied()
                    .find(|one| one.name() == name || one.kebab_name() == name)
                    .ok_or_else(|| {
                        let known = Self::ALL.iter().map(|one| [one.name(), one.kebab_name()]);
                        UnknownName::new($what, name, known.collect())
                    })
            }
        }
    };
}

pub(crate) use named;

named! {
    /// A time integration method.
    #[non_exhaustive]
    Method, "method" {
        /// Chosen from the scene.
        Auto = "auto",
        /// The step of the note: one linearization, one solve; order 1.
        LinearlyImplicitEuler = "linearly-implicit-euler",
        /// Implicit Euler, solved; order 1.
        ImplicitEuler = "implicit-euler",
        /// A trapezoidal and a backward difference stage; order 2, L-stable.
        TrBdf2 = "tr-bdf2",
        /// Implicit midpoint, solved; order 2, symplectic.
        ImplicitMidpoint = "implicit-midpoint",
        /// Explicit kick–drift–kick; order 2.
        VelocityVerlet = "velocity-verlet",
        /// Explicit composition of kicks and drifts; order 4.
        BlanesMoan4 = "blanes-moan4",
        /// Explicit composition of kicks and drifts; order 6.
        BlanesMoan6 = "blanes-moan6",
        /// Explicit Runge–Kutta; order 8.
        Dop853 = "dop853",
        /// Kick–drift–kick with kicks through a stiffness matrix; order 2.
        FilteredLeapfrog = "filtered-leapfrog",
        /// Linearly implicit Rosenbrock method; order 4, L-stable.
        Rodas4 = "rodas4",
    }
}

named! {
    /// How the across-spring stiffness enters the matrix of an implicit step.
    Tangent, "tangent" {
        /// As it is; clamped only when the matrix is not positive definite.
        Exact = "exact",
        /// Negative across stiffness becomes zero.
        Clamped = "clamped",
        /// Negative across stiffness changes its sign.
        Absolute = "absolute",
        /// No across stiffness.
        Material = "material",
        /// Across stiffness from a tension carried from step to step.
        Filtered = "filtered",
    }
}

named! {
    /// Where the nodes that can move are at the start.
    #[derive(Default)]
    Start, "start" {
        /// Where the scene has them.
        #[default]
        AsGiven = "as-given",
        /// In an equilibrium, with the velocities that the scene has: whoever runs the
        /// scene must find it first.
        Equilibrium = "equilibrium",
    }
}

named! {
    /// How precisely linear systems are solved where they are solved by
    /// iteration; direct solutions are always right to rounding.
    LinearTolerance, "solution" {
        /// So that what is left is a small part of the error of the method.
        Sufficient = "sufficient",
        /// To 1e-11, as if solved directly.
        Strict = "strict",
    }
}

/// A name that is not in the list of known ones, which are given in the same
/// style: in CamelCase if it starts with a capital, in kebab-case otherwise.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownName {
    what: &'static str,
    name: String,
    /// Names in scene files and on the command line.
    known: Vec<[&'static str; 2]>,
    is_in_scene_file: bool,
}

/// Characters of an unknown name that are shown.
const SHOWN: usize = 40;

impl UnknownName {
    pub(crate) fn new(what: &'static str, name: &str, known: Vec<[&'static str; 2]>) -> Self {
        let mut shown: String = name.chars().take(SHOWN).collect();
        if shown.len() < name.len() {
            shown.push('…');
        }
        Self {
            what,
            is_in_scene_file: shown.starts_with(char::is_uppercase),
            name: shown,
            known,
        }
    }

    /// The same with the known names as they are written in scene files.
    pub fn in_scene_file(self) -> Self {
        Self {
            is_in_scene_file: true,
            ..self
        }
    }

    fn known(&self) -> impl Iterator<Item = &'static str> {
        let known = self.known.iter();
        known.map(|[name, kebab_name]| {
            if self.is_in_scene_file {
                *name
            } else {
                *kebab_name
            }
        })
    }

    /// The known name that this one is part of but for case and hyphens, if
    /// there is only one.
    fn similar(&self) -> Option<&'static str> {
        const FEWEST: usize = 4;
        let plain = |name: &str| -> String {
            let letters = name.chars().filter(|c| c.is_alphanumeric());
            letters.flat_map(char::to_lowercase).collect()
        };
        let wanted = plain(&self.name);
        let mut similar = self.known().filter(|known| {
            let known = plain(known);
            known == wanted || (wanted.len() >= FEWEST && known.contains(&wanted))
        });
        let first = similar.next();
        first.filter(|_| similar.next().is_none())
    }
}

impl fmt::Display for UnknownName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "unknown {} `{}`; ", self.what, self.name)?;
        if let Some(similar) = self.similar() {
            write!(f, "did you mean {similar}? ")?;
        }
        let known: Vec<_> = self.known().collect();
        write!(f, "known are {}", known.join(", "))
    }
}

impl std::error::Error for UnknownName {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_read_back() {
        for &method in Method::ALL {
            assert_eq!(method.name().parse(), Ok(method));
            assert_eq!(method.kebab_name().parse(), Ok(method));
        }
        for &tangent in Tangent::ALL {
            assert_eq!(tangent.to_string().parse(), Ok(tangent));
        }
        assert_eq!(
            "verlet".parse::<Tangent>().unwrap_err().to_string(),
            "unknown tangent `verlet`; known are exact, clamped, absolute, material, filtered"
        );
        assert_eq!(
            "Verlet".parse::<Tangent>().unwrap_err().to_string(),
            "unknown tangent `Verlet`; known are Exact, Clamped, Absolute, Material, Filtered"
        );
    }

    #[test]
    fn a_similar_name_is_suggested_if_there_is_one() {
        let said = |name: &str| name.parse::<Method>().unwrap_err().to_string();
        assert!(said("tr_bdf2").contains("did you mean tr-bdf2?"));
        assert!(said("TRBDF2").contains("did you mean TrBdf2?"));
        assert!(said("verlet").contains("did you mean velocity-verlet?"));
        // Two have it in their names.
        assert!(!said("blanes-moan").contains("did you mean"));
        assert!(!said("Ode45").contains("did you mean"));
        assert!(said(&"x".repeat(1_000_000)).len() < 400);
    }
}
