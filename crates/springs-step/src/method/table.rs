//! The methods and what is known of each: one row a method.

use crate::implicit::solver_options::Hessian;
use crate::{
    Choice, Dop853, Doubling, FilteredLeapfrog, ImplicitEuler, ImplicitMidpoint,
    LinearlyImplicitEuler, Method, Pace, Rodas4, SetupError, Splitting, TrBdf2, VerletPairs,
};
use springs_assembly::System;
use springs_scene::{self as scene, Scene, Tangent};
use springs_solver::SolveError;

/// What is known of a method.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Properties {
    /// The method; never `Auto`.
    pub method: scene::Method,
    /// Order of consistency.
    pub order: u32,
    /// Whether it moves nodes without mass.
    pub moves_massless: bool,
    /// Whether it keeps its order where forces depend on velocities; others refuse
    /// them.
    pub treats_damping: bool,
    /// The product of step size and angular frequency, or damping rate, up to which
    /// steps are stable; `None` if all are.
    pub stable_angle: Option<f64>,
    /// How it meets a tolerance.
    pub tolerance: ToleranceKind,
    /// Whether even the last step must have the size of the others: what stiff springs
    /// hold would be let go by a shorter one.
    pub keeps_step: bool,
    /// Whether comparisons run it in steps of fixed size, as most users do, and not
    /// with tolerances.
    pub is_compared_by_steps: bool,
    /// What an attempt takes where `Auto` tries it.
    pub(crate) attempt: Option<Attempt>,
    /// What a step does, mostly.
    pub(crate) usual_step: UsualStep,
    /// What an explicit method itself does per node and evaluation, in ns.
    pub(crate) node_cost: f64,
    /// What its matrix has, if there is one.
    hessian: fn(Option<Tangent>) -> Option<Hessian>,
    build: Build,
}

/// What an attempt with an estimate of its error takes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Attempt {
    /// Evaluations of forces; 0 with a matrix.
    pub(crate) evaluations: f64,
    /// As [`Properties::stable_angle`], for the attempt as a whole.
    pub(crate) stable_angle: Option<f64>,
}

impl Attempt {
    const WITH_MATRIX: Self = Self {
        evaluations: 0.0,
        stable_angle: None,
    };

    const fn explicit(evaluations: f64, stable_angle: f64) -> Self {
        Self {
            evaluations,
            stable_angle: Some(stable_angle),
        }
    }
}

/// What a step of a method does, mostly, without an estimate of its error by doubling.
#[derive(Clone, Copy, Debug)]
pub(crate) struct UsualStep {
    /// Evaluations of forces alone.
    pub(crate) evaluations: f64,
    /// Evaluations of forces and matrix, each with a new factor or preconditioner.
    pub(crate) linearizations: f64,
    /// Solutions of linear systems.
    pub(crate) solves: f64,
}

impl UsualStep {
    const fn explicit(evaluations: f64) -> Self {
        Self {
            evaluations,
            linearizations: 0.0,
            solves: 0.0,
        }
    }

    /// So many Newton iterations.
    const fn newton(iterations: f64) -> Self {
        Self {
            evaluations: 0.0,
            linearizations: iterations,
            solves: iterations,
        }
    }
}

type Build = fn(&System, &Choice) -> Result<Box<dyn Method>, SolveError>;

/// How a method meets a tolerance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ToleranceKind {
    /// By an estimate of its own.
    Estimate,
    /// By making each step twice.
    Doubling,
    /// By equal steps, as many as trial runs say: for methods that do not damp the
    /// vibrations which they do not resolve, and which a change of step would
    /// excite.
    EqualSteps,
}

/// In the order in which `Auto` tries them. RODAS4 is not among those: from rest it
/// promises steps that it does not keep.
static TABLE: [Properties; 10] = [
    Properties {
        order: 8,
        stable_angle: Some(5.9),
        attempt: Some(Attempt::explicit(12.0, 5.9)),
        usual_step: UsualStep::explicit(12.0),
        node_cost: 18.0,
        build: |system, _| Ok(Box::new(Dop853::new(system))),
        ..explicit(scene::Method::Dop853)
    },
    Properties {
        stable_angle: Some(2.0),
        is_compared_by_steps: true,
        // A pair of steps.
        attempt: Some(Attempt::explicit(2.0, 4.0)),
        usual_step: UsualStep::explicit(1.0),
        node_cost: 3.0,
        build: |system, choice| {
            Ok(match choice.pace {
                Pace::Tolerance(_) => Box::new(VerletPairs::new(system)),
                Pace::Fixed(_) => Box::new(Splitting::velocity_verlet(system)),
            })
        },
        ..explicit(scene::Method::VelocityVerlet)
    },
    Properties {
        order: 4,
        treats_damping: false,
        stable_angle: Some(5.0),
        is_compared_by_steps: true,
        attempt: Some(Attempt::explicit(6.0, 4.5)),
        usual_step: UsualStep::explicit(6.0),
        node_cost: 3.0,
        build: |system, _| Ok(Box::new(Splitting::blanes_moan_4(system))),
        ..explicit(scene::Method::BlanesMoan4)
    },
    Properties {
        order: 6,
        treats_damping: false,
        stable_angle: Some(9.0),
        is_compared_by_steps: true,
        attempt: Some(Attempt::explicit(11.0, 9.0)),
        usual_step: UsualStep::explicit(11.0),
        node_cost: 3.0,
        build: |system, _| Ok(Box::new(Splitting::blanes_moan_6(system))),
        ..explicit(scene::Method::BlanesMoan6)
    },
    Properties {
        attempt: Some(Attempt::WITH_MATRIX),
        usual_step: UsualStep::newton(6.0),
        build: |system, choice| {
            let method = TrBdf2::new(system, &choice.options)?;
            Ok(Box::new(match choice.pace {
                Pace::Fixed(_) => method,
                Pace::Tolerance(tolerance) => method.with_tolerance(tolerance, choice.duration),
            }))
        },
        ..implicit(scene::Method::TrBdf2)
    },
    Properties {
        order: 1,
        tolerance: ToleranceKind::Doubling,
        is_compared_by_steps: true,
        hessian: |tangent| Some(Hessian::of_tangent(tangent.unwrap_or(Tangent::Exact))),
        build: |system, choice| {
            let tangent = choice.tangent.unwrap_or(Tangent::Exact);
            Ok(Box::new(LinearlyImplicitEuler::new(
                system,
                tangent,
                &choice.options,
            )?))
        },
        ..implicit(scene::Method::LinearlyImplicitEuler)
    },
    Properties {
        order: 1,
        tolerance: ToleranceKind::Doubling,
        usual_step: UsualStep::newton(5.0),
        build: |system, choice| Ok(Box::new(ImplicitEuler::new(system, &choice.options)?)),
        ..implicit(scene::Method::ImplicitEuler)
    },
    Properties {
        tolerance: ToleranceKind::EqualSteps,
        is_compared_by_steps: true,
        usual_step: UsualStep::newton(4.0),
        build: |system, choice| Ok(Box::new(ImplicitMidpoint::new(system, &choice.options)?)),
        ..implicit(scene::Method::ImplicitMidpoint)
    },
    Properties {
        tolerance: ToleranceKind::EqualSteps,
        keeps_step: true,
        is_compared_by_steps: true,
        hessian: |_| Some(Hessian::Altered),
        build: |system, choice| {
            let method = FilteredLeapfrog::new(system, &choice.options)?;
            Ok(Box::new(match choice.pace {
                Pace::Fixed(_) => method,
                Pace::Tolerance(_) => method.for_tolerance(),
            }))
        },
        ..implicit(scene::Method::FilteredLeapfrog)
    },
    Properties {
        order: 4,
        moves_massless: false,
        treats_damping: false,
        usual_step: UsualStep {
            solves: 6.0,
            ..UsualStep::newton(1.0)
        },
        hessian: |_| Some(Hessian::Unclamped),
        build: |system, choice| Ok(Box::new(Rodas4::new(system, &choice.options)?)),
        ..implicit(scene::Method::Rodas4)
    },
];

/// What most methods with a matrix have in common.
const fn implicit(method: scene::Method) -> Properties {
    Properties {
        method,
        order: 2,
        moves_massless: true,
        treats_damping: true,
        stable_angle: None,
        tolerance: ToleranceKind::Estimate,
        keeps_step: false,
        is_compared_by_steps: false,
        attempt: None,
        usual_step: UsualStep::newton(1.0),
        node_cost: 0.0,
        hessian: |_| Some(Hessian::Exact),
        build: |_, _| unreachable!(),
    }
}

/// What most methods without a matrix have in common.
const fn explicit(method: scene::Method) -> Properties {
    Properties {
        moves_massless: false,
        hessian: |_| None,
        ..implicit(method)
    }
}

/// What is known of all methods.
pub fn methods() -> &'static [Properties] {
    &TABLE
}

/// What is known of a method; `None` for `Auto`, which is none.
pub fn properties(method: scene::Method) -> Option<&'static Properties> {
    TABLE.iter().find(|row| row.method == method)
}

impl Properties {
    /// Whether a step solves no system.
    pub fn is_explicit(&self) -> bool {
        self.stable_angle.is_some()
    }

    /// Whether vibrations that steps do not resolve die away: energy that a step put
    /// into stiff springs is gone after the next ones.
    pub fn damps_unresolved_vibrations(&self) -> bool {
        !self.is_explicit() && self.tolerance != ToleranceKind::EqualSteps
    }

    /// What the matrix has, if there is one.
    pub(crate) fn hessian(&self, tangent: Option<Tangent>) -> Option<Hessian> {
        (self.hessian)(tangent)
    }

    /// The method, ready to step; with an error estimate if steps are chosen from the
    /// error.
    pub(crate) fn build(
        &self,
        system: &System,
        choice: &Choice,
    ) -> Result<Box<dyn Method>, SolveError> {
        let mut method = (self.build)(system, choice)?;
        if !matches!(choice.pace, Pace::Tolerance(_)) {
            return Ok(method);
        }
        match self.tolerance {
            ToleranceKind::EqualSteps => return Ok(method),
            ToleranceKind::Doubling => method = Box::new(Doubling::new(system, method)),
            ToleranceKind::Estimate => {}
        }
        method.expect_changing_steps(system)?;
        Ok(method)
    }

    /// Refuses what the method cannot treat.
    pub(crate) fn can_move(&self, scene: &Scene, system: &System) -> Result<(), SetupError> {
        let method = self.method;
        let massless = system.masses().iter().position(|&mass| mass == 0.0);
        if let (false, Some(block)) = (self.moves_massless, massless) {
            let node = system.numbering().node(block);
            return Err(SetupError::Massless { node, method });
        }
        if self.treats_damping {
            return Ok(());
        }
        if let Some(spring) = scene.springs.iter().position(|spring| spring.damping > 0.0) {
            return Err(SetupError::VelocityDependent { spring, method });
        }
        match system.damped().next() {
            None => Ok(()),
            Some((_, emitter)) => Err(SetupError::Damped {
                emitter: emitter.name().to_owned(),
                method,
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use springs_assembly::compile;
    use springs_scene::RunOptions;
    use springs_scene::generate::{Material, chain};

    /// Every method has a row, and what a row says is true of what it builds.
    #[test]
    fn rows_agree_with_methods() {
        let scene = chain(3, Material::of_chain(3));
        let system = compile(&scene).unwrap();
        let open = |pace| Choice::open(&scene.settings, &RunOptions::default(), pace);
        for &method in scene::Method::ALL {
            let Some(row) = properties(method) else {
                assert_eq!(method, scene::Method::Auto);
                continue;
            };
            let choice = open(Pace::Fixed(0.1));
            let built = row.build(&system, &choice).unwrap();
            assert_eq!(built.order(), row.order, "{method}");
            assert_eq!(row.hessian(None).is_none(), row.is_explicit(), "{method}");
            let changing = open(Pace::Tolerance(1e-3));
            assert!(row.build(&system, &changing).is_ok(), "{method}");
        }
        assert_eq!(methods().len() + 1, scene::Method::ALL.len());
    }
}
