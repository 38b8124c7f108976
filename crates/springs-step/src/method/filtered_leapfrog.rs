//! Filtered leapfrog: Verlet with kicks that pass through a stiffness matrix.

use crate::flows::Impulses;
use crate::implicit::linear::{LinearSystem, Linearized, OnDemand, Purpose};
use crate::implicit::solver_options::Hessian;
use crate::implicit::stage::Stage;
use crate::method::across::Across;
use crate::method::stiff_springs::{StiffSprings, stiff_springs};
use crate::vectors::largest_magnitude;
use crate::{Anchors, Archive, ErrorEstimate, Flows, Interval, Method, MethodError, State, Work};
use nalgebra::Vector3;
use springs_assembly::{Evaluation, System, Weights};
use springs_scene::RunOptions;
use springs_solver::{Interrupt, Price, SolveError};

/// v½ = v + ½h a, x' = x + h v½, v' = v½ + ½h a' with
/// (M + ½hD + αh²S) a' = f(x', v½), where S is K u uᵀ of every spring, and as much of the
/// across stiffness of filtered tensions as steps need beside that (`across.rs`). Positions are
/// x + αh² a: where springs are stiff, x lags behind by the stretch αh² a that holds masses
/// in the filter.
///
/// Order 2, linearly implicit, one factorization and one solution a step:
/// stiff vibrations are slowed down instead of resolved, so that steps may be
/// far above their period. Linear momentum is kept to rounding, since the
/// filter leaves uniform motion alone; angular momentum only nearly, because
/// across parts of S turn neighbours against each other. α = 0.3: ¼ would
/// do for one linear spring, but blows up when very stiff springs turn, and from ⅓ on
/// vibrations at the limit of long steps, 2 asin(1/(2√α)) a step, meet resonances of order 3
/// and 4.
///
/// It starts on the slow motion, without vibrations of springs that are not yet stretched by
/// what they hold: (M + αh²S) a = f − αh² (dS/dt) v, so that turning springs keep their
/// lengths, and x = x₀ − αh² a.
///
/// Where few springs are stiff for the step, S may have these alone (with a tolerance it
/// has): the others, with h²·(2/m)·ΣK ≤ 2 at every node, act as in velocity Verlet
/// (implicit-explicit as in Stern and Grinspun, Multiscale Model. Simul. 7, 2009). Since
/// h²λ ≤ (σ + 2)/(1 + ασ) < 4 for the largest λ of all and any σ ≥ 0 of the stiff ones, that
/// is stable for linear springs.
pub struct FilteredLeapfrog {
    across: Across,
    linear: LinearSystem,
    /// In place of it, where few springs are stiff.
    stiff: Option<StiffSprings>,
    /// The step size that these were chosen for, in s.
    chosen_for: f64,
    /// And that they were counted for.
    counted_for: f64,
    /// Nobody changed anything that the choice depends on.
    may_choose: bool,
    /// What is left out is told.
    is_for_tolerance: bool,
    /// At the start, in m.
    left_out_at_start: f64,
    rest: Vec<Vector3<f64>>,
    options: RunOptions,
    interrupt: Interrupt,
    /// Where there are massless nodes, which start in balance.
    start: Option<Stage>,
    /// What keeps turning springs from getting longer at the start, in N, on all blocks.
    turning: Vec<Vector3<f64>>,
    accelerations: Vec<Vector3<f64>>,
    /// Those at the end of the step; zero for fixed blocks.
    next_accelerations: Vec<Vector3<f64>>,
    tensions: Vec<f64>,
    next_tensions: Vec<f64>,
    /// Step size of the filter of the accelerations; zero before the start.
    filtered_for: f64,
    /// Forces jumped since the accelerations were computed.
    is_stale: bool,
    /// Power, in W, of each anchor against the filtered forces of springs.
    anchor_powers: Vec<f64>,
    next_anchor_powers: Vec<f64>,
    impulses: Impulses,
}

const ALPHA: f64 = 0.3;

/// Where accelerations are asked for.
#[derive(Clone, Copy)]
struct At {
    time: f64,
    /// How long before the velocities are, in s.
    lag: f64,
    is_start: bool,
}

impl FilteredLeapfrog {
    /// Allocates the workspace and factorizes symbolically.
    ///
    /// # Errors
    ///
    /// If the factor cannot be stored.
    pub fn new(system: &System, options: &RunOptions) -> Result<Self, SolveError> {
        let zeros = vec![Vector3::zeros(); system.numbering().n_nodes()];
        let powers = vec![0.0; zeros.len() - system.n_free()];
        Ok(Self {
            across: Across::new(system),
            linear: LinearSystem::new(system, Hessian::Altered, options)?,
            stiff: None,
            chosen_for: 0.0,
            counted_for: 0.0,
            may_choose: false,
            is_for_tolerance: false,
            left_out_at_start: 0.0,
            rest: Vec::new(),
            options: *options,
            interrupt: Interrupt::default(),
            start: if system.masses().contains(&0.0) {
                Some(Stage::new(system, options)?)
            } else {
                None
            },
            turning: zeros.clone(),
            accelerations: zeros.clone(),
            next_accelerations: zeros,
            tensions: vec![0.0; system.n_carried()],
            next_tensions: vec![0.0; system.n_carried()],
            filtered_for: 0.0,
            is_stale: false,
            anchor_powers: powers.clone(),
            next_anchor_powers: powers,
            impulses: Impulses::new(system),
        })
    }

    /// The same for steps whose number trial runs find: with the stiff springs alone in S, where
    /// these are few; then results differ by as much as other steps of order 2 would. It tells
    /// [what it leaves out](Method::left_out).
    pub fn for_tolerance(self) -> Self {
        Self {
            may_choose: true,
            is_for_tolerance: true,
            ..self
        }
    }

    /// Chooses the springs that the matrix has, for steps of size `h`, in s.
    fn choose(&mut self, system: &System, h: f64) -> Result<(), SolveError> {
        if self.chosen_for == h {
            return Ok(());
        }
        let kept = if self.may_choose {
            stiff_springs(system, h)
        } else {
            None
        };
        if kept.as_ref() != self.stiff.as_ref().map(|stiff| &stiff.kept) {
            self.stiff = match kept {
                Some(kept) => StiffSprings::new(system, kept, &self.options, &self.interrupt)?,
                None => None,
            };
        }
        self.chosen_for = h;
        Ok(())
    }

    /// Accelerations at a time and at positions of `state`, whose velocities are those `lag`,
    /// in s, before, from and into `next_*`.
    fn accelerate(
        &mut self,
        system: &System,
        state: &State,
        h: f64,
        At {
            time,
            lag,
            is_start,
        }: At,
        work: &mut Work,
    ) -> Result<(), MethodError> {
        let filter = ALPHA * h * h;
        let weights = Weights {
            mass: 1.0,
            damping: lag,
            stiffness: filter,
        };
        work.counts.force_evaluations += 1;
        let has_all = self.stiff.is_none();
        let (matrix_of, linear, carried) = match &mut self.stiff {
            None => (system, &mut self.linear, &mut self.next_tensions),
            Some(stiff) => {
                stiff.take_tensions(&self.next_tensions);
                (&stiff.system, &mut stiff.linear, &mut stiff.tensions)
            }
        };
        self.across
            .leave_needed(matrix_of, &state.x, (h, filter), carried);
        let carried = &*carried;
        let at = Evaluation {
            carried: Some(carried),
            ..Evaluation::new(&state.x, &state.v, weights)
        };
        let taken = linear.linearize_and_solve(
            matrix_of,
            Linearized {
                at,
                on_demand: OnDemand::Clamp,
                purpose: Purpose::Step,
            },
            |out, accelerations| {
                if !has_all {
                    system.static_forces(&state.x, &mut out.forces);
                }
                system.add_damping_and_loads(time, &state.x, &state.v, &mut out.forces);
                accelerations.copy_from_slice(&out.forces);
                if is_start {
                    let turning = &mut self.turning;
                    matrix_of.turning_forces(&state.x, &state.v, carried, filter, turning);
                    let forces = accelerations.iter_mut().zip(&*turning);
                    forces.for_each(|(force, turning)| *force += turning);
                }
            },
            &mut self.next_accelerations[..system.n_free()],
            work,
        )?;
        if system.any_anchor_moves(&state.v) {
            // The force that acts is the filtered one, f − αh²S a.
            let powers = &mut self.next_anchor_powers;
            powers.fill(0.0);
            system.add_anchor_works(1.0, &state.x, &state.v, powers);
            matrix_of.add_anchor_work_changes(&taken, &self.next_accelerations, powers);
            if is_start {
                let anchors = self.turning.iter().zip(&state.v).skip(system.n_free());
                for (power, (turning, v)) in powers.iter_mut().zip(anchors) {
                    *power -= turning.dot(v);
                }
            }
        }
        if is_start && self.is_for_tolerance {
            // What springs are off the slow motion by vibrates: S y = f − M a.
            let forces = &linear.linearization().forces;
            let held = self.next_accelerations.iter().zip(system.masses());
            self.rest.clear();
            self.rest
                .extend(forces.iter().zip(held).map(|(f, (a, m))| f - a * *m));
            linear.solve(&mut self.rest, Purpose::Estimate, work)?;
            self.left_out_at_start = filter * largest_magnitude(&self.rest);
        }
        // What the filter leaves of the tension.
        let (x, a) = (&state.x, &self.next_accelerations);
        let tensions = &mut self.next_tensions;
        match &mut self.stiff {
            None => system.predict_carried(x, a, filter, tensions),
            Some(stiff) => stiff.predict_tensions(system, x, a, filter, tensions),
        }
        Ok(())
    }

    /// Moves from what positions are to those that are stepped, x = (x + αh² a) − αh² a.
    fn take_back_lag(&self, h: f64, x: &mut [Vector3<f64>]) {
        for (x, a) in x.iter_mut().zip(&self.accelerations) {
            *x -= a * (ALPHA * h * h);
        }
    }
}

impl Method for FilteredLeapfrog {
    fn order(&self) -> u32 {
        2
    }

    fn setup(&self) -> Work {
        self.linear.setup()
    }

    fn set_interrupt(&mut self, interrupt: &Interrupt) {
        self.interrupt = interrupt.clone();
        self.linear.set_interrupt(interrupt);
        if let Some(stiff) = &mut self.stiff {
            stiff.linear.set_interrupt(interrupt);
        }
        if let Some(start) = &mut self.start {
            start.set_interrupt(interrupt);
        }
    }

    fn restart(&mut self) {
        self.filtered_for = 0.0;
    }

    fn forces_jumped(&mut self, system: &System) {
        system.clear_broken(&mut self.tensions);
        self.is_stale = true;
        (self.may_choose, self.chosen_for) = (false, 0.0);
    }

    fn price_at(&mut self, system: &System, h: f64) -> Option<Price> {
        self.choose(system, h).ok()?;
        let stiff = self.stiff.as_ref()?;
        Some(stiff.linear.factor_price())
    }

    /// A vibration changes a by δ = (1 − (M + αh²S)⁻¹M) Δa in a step, as far as springs are
    /// stiff; at the limit of long steps its velocities are up to 0.12 hδ, and 0.25 hδ
    /// where Δa is not at its largest. Its positions are that over ω, with
    /// δ/(1 + αh²ω²) = (M + αh²S)⁻¹M δ at each node.
    fn left_out(&mut self, system: &System, work: &mut Work) -> Result<Option<f64>, MethodError> {
        if !self.is_for_tolerance {
            return Ok(None);
        }
        let linear = match &mut self.stiff {
            None => &mut self.linear,
            Some(stiff) => &mut stiff.linear,
        };
        let masses = system.masses();
        let mut pass = |change: &[Vector3<f64>], rest: &mut Vec<Vector3<f64>>| {
            rest.clear();
            rest.extend(change.iter().zip(masses).map(|(change, m)| change * *m));
            linear.solve(rest, Purpose::Estimate, work)
        };
        // Those of the step before are where those of the next one will be.
        let changes = self.accelerations.iter().zip(&self.next_accelerations);
        let mut stiff: Vec<Vector3<f64>> = changes.map(|(a, last)| a - last).collect();
        stiff.truncate(system.n_free());
        pass(&stiff, &mut self.rest)?;
        for (stiff, soft) in stiff.iter_mut().zip(&self.rest) {
            *stiff -= soft;
        }
        pass(&stiff, &mut self.rest)?;
        let squares = stiff.iter().zip(&self.rest);
        let square = squares.fold(0.0, |most: f64, (a, b)| most.max(a.norm() * b.norm()));
        let h = self.filtered_for;
        let left_out = 0.25 * h * h * (ALPHA * square).sqrt();
        Ok(Some(left_out.max(self.left_out_at_start)))
    }

    fn step(
        &mut self,
        system: &System,
        anchors: &Anchors,
        interval: Interval,
        state: &mut State,
        work: &mut Work,
    ) -> Result<Option<ErrorEstimate>, MethodError> {
        let h = interval.size;
        self.choose(system, h).map_err(MethodError::of)?;
        if let Some(stiff) = self.stiff.as_ref().filter(|_| self.counted_for != h) {
            *work += stiff.linear.setup();
            self.counted_for = h;
        }
        // Accelerations filtered for another step would excite vibrations.
        let is_start = self.filtered_for != h;
        if is_start {
            if let Some(start) = &mut self.start {
                start.settle_massless(system, (interval.start, h), state, work)?;
            }
            system.carried(&state.x, &mut self.next_tensions);
        } else {
            self.take_back_lag(h, &mut state.x);
            self.next_tensions.copy_from_slice(&self.tensions);
        }
        if is_start || self.is_stale {
            let at = At {
                time: interval.start,
                lag: 0.0,
                is_start,
            };
            self.accelerate(system, state, h, at, work)?;
            self.accept();
            self.filtered_for = h;
            self.next_tensions.copy_from_slice(&self.tensions);
        }
        self.is_stale = false;
        self.impulses.begin(system, &state.v);
        self.impulses.add_loads(system, 0.5 * h, interval.start);
        self.impulses.add_loads(system, 0.5 * h, interval.end);
        self.impulses
            .add_damping(system, 0.5 * h, &state.x, &state.v);
        if is_start {
            self.take_back_lag(h, &mut state.x);
        }
        let moving = state.x.iter_mut().zip(&mut state.v).take(system.n_free());
        for ((x, v), a) in moving.zip(&self.accelerations) {
            *v += a * (0.5 * h);
            *x += *v * h;
        }
        anchors.place(interval.end, &mut state.x, &mut state.v);
        let at_end = At {
            time: interval.end,
            lag: 0.5 * h,
            is_start: false,
        };
        self.accelerate(system, state, h, at_end, work)?;
        for (v, a) in state.v.iter_mut().zip(&self.next_accelerations) {
            *v += a * (0.5 * h);
        }
        // With D a in their matrix, dashpots act with the new velocities.
        self.impulses
            .add_damping(system, 0.5 * h, &state.x, &state.v);
        if self.impulses.anchors_move() {
            let powers = self.anchor_powers.iter().zip(&self.next_anchor_powers);
            let works = self.impulses.anchor_works(system).iter_mut();
            for (work, (start, end)) in works.zip(powers) {
                *work += 0.5 * h * (start + end);
            }
        }
        self.impulses.finish(system, &state.v);
        for (x, a) in state.x.iter_mut().zip(&self.next_accelerations) {
            *x += a * (ALPHA * h * h);
        }
        Ok(None)
    }

    fn archive(&mut self, archive: &mut Archive) {
        self.linear.archive(archive);
        if let Some(start) = &mut self.start {
            start.archive(archive);
        }
        archive.flag(&mut self.may_choose);
        archive.real(&mut self.counted_for);
        archive.real(&mut self.filtered_for);
        archive.flag(&mut self.is_stale);
        archive.reals(&mut self.anchor_powers);
        archive.vectors(&mut self.accelerations);
        archive.reals(&mut self.tensions);
    }

    fn accept(&mut self) {
        std::mem::swap(&mut self.accelerations, &mut self.next_accelerations);
        std::mem::swap(&mut self.tensions, &mut self.next_tensions);
        std::mem::swap(&mut self.anchor_powers, &mut self.next_anchor_powers);
    }

    fn tensions(&self) -> Option<&[f64]> {
        Some(&self.tensions)
    }

    fn flows(&self) -> Option<&Flows> {
        Some(self.impulses.flows())
    }
}
