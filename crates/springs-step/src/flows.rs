//! What dashpots and moving anchors take and give in a step.

use crate::{HiddenState, State};
use nalgebra::Vector3;
use springs_assembly::System;
use std::ops::{Add, AddAssign};

/// Energy that left or entered in a step, in J, through dashpots and springs
/// with a free end.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Flows {
    /// Heat produced by dashpots.
    pub dashpot_heat: f64,
    /// Work done by moving anchors.
    pub anchor_work: f64,
}

impl Add for Flows {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            dashpot_heat: self.dashpot_heat + other.dashpot_heat,
            anchor_work: self.anchor_work + other.anchor_work,
        }
    }
}

impl AddAssign for Flows {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Flows {
    /// Heat and anchor power at one instant, in W; next to nothing to compute in
    /// scenes without dashpots and moving anchors.
    pub(crate) fn powers(system: &System, x: &[Vector3<f64>], v: &[Vector3<f64>]) -> Self {
        Self {
            dashpot_heat: system.dashpots().dissipation(x, v),
            anchor_work: system.anchor_power(x, v),
        }
    }

    pub(crate) fn visit(&mut self, state: &mut HiddenState) {
        state.real(&mut self.dashpot_heat);
        state.real(&mut self.anchor_work);
    }

    /// The same flows at another rate, or over another time.
    pub(crate) fn times(self, factor: f64) -> Self {
        Self {
            dashpot_heat: self.dashpot_heat * factor,
            anchor_work: self.anchor_work * factor,
        }
    }

    /// By the trapezoidal rule for forces: for methods that do not say.
    pub(crate) fn trapezoidal(system: &System, [before, after]: [&State; 2], h: f64) -> Self {
        let mut impulses = Impulses::new(system);
        let half = 0.5 * h;
        impulses.begin(system, &before.v);
        impulses.add(system, half, &before.x, &before.v);
        impulses.add(system, half, &after.x, &after.v);
        impulses.flows(system, &after.v)
    }

    /// The part of the flows of a step up to a fraction of it, by the cubic that
    /// has the powers at both ends as its slopes. Where the step does not resolve
    /// what flows, the powers are limited so that the cubic is monotone (Fritsch
    /// and Carlson, SIAM J. Numer. Anal. 17, 1980).
    pub(crate) fn part(
        self,
        system: &System,
        [before, after]: [&State; 2],
        h: f64,
        fraction: f64,
    ) -> Self {
        let [start, end] = [before, after].map(|at| Self::powers(system, &at.x, &at.v).times(h));
        let cubic = |total: f64, start: f64, end: f64| {
            let limited = |slope: f64| slope.clamp(total.min(0.0) * 3.0, total.max(0.0) * 3.0);
            let (s, rest) = (fraction, 1.0 - fraction);
            let slopes = rest * limited(start) - s * limited(end);
            s * s * (3.0 - 2.0 * s) * total + s * rest * slopes
        };
        Self {
            dashpot_heat: cubic(self.dashpot_heat, start.dashpot_heat, end.dashpot_heat),
            anchor_work: cubic(self.anchor_work, start.anchor_work, end.anchor_work),
        }
    }

    /// Those of what joins two fixed nodes, which no method moves: exact.
    pub(crate) fn between_fixed(
        system: &System,
        before: &[Vector3<f64>],
        after: &State,
        h: f64,
    ) -> Self {
        if !system.any_anchor_moves(&after.v) {
            return Self::default();
        }
        let heat = system.dashpots().heat_between_fixed(before, &after.x, h);
        Self {
            dashpot_heat: heat,
            anchor_work: heat + system.springs().work_between_fixed(before, &after.x),
        }
    }
}

/// The impulses that a method gives in a step, and what follows from them.
///
/// A method of order 1 or 2 changes the momentum of a node by Σ bᵢ h fᵢ, with its
/// own weights bᵢ and the forces fᵢ of its stages. The kinetic energy then
/// changes by exactly that impulse times the mean of the velocities before and
/// after. So the impulses of the dashpots times these mean velocities are the
/// energy that the dashpots took, and the impulses on an anchor times its
/// velocity the work that it did, whether the step resolves them or not.
pub(crate) struct Impulses {
    /// v₁ − v₀ of the ends of each dashpot at the start of the step, in m/s.
    rates: Vec<Vector3<f64>>,
    /// Of each dashpot, on its first end, in N·s.
    dashpots: Vec<Vector3<f64>>,
    /// Work of anchors against springs, in J.
    spring_work: f64,
    anchors_move: bool,
}

impl Impulses {
    pub(crate) fn new(system: &System) -> Self {
        let zeros = vec![Vector3::zeros(); system.dashpots().len()];
        Self {
            rates: zeros.clone(),
            dashpots: zeros,
            spring_work: 0.0,
            anchors_move: false,
        }
    }

    /// Begins a step with the velocities `v`.
    pub(crate) fn begin(&mut self, system: &System, v: &[Vector3<f64>]) {
        system.dashpots().rates(v, &mut self.rates);
        self.dashpots.fill(Vector3::zeros());
        self.spring_work = 0.0;
        self.anchors_move = system.any_anchor_moves(v);
    }

    /// Whether springs do work on anchors.
    pub(crate) fn anchors_move(&self) -> bool {
        self.anchors_move
    }

    /// Forces at a state act for a time `weight` = bᵢ h, in s.
    pub(crate) fn add(
        &mut self,
        system: &System,
        weight: f64,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
    ) {
        self.add_dashpots(system, weight, x, v);
        if self.anchors_move {
            self.add_spring_work(weight * system.springs().anchor_power(x, v));
        }
    }

    /// Those of the dashpots alone.
    pub(crate) fn add_dashpots(
        &mut self,
        system: &System,
        weight: f64,
        x: &[Vector3<f64>],
        v: &[Vector3<f64>],
    ) {
        let dashpots = system.dashpots();
        dashpots.add_impulses(weight, x, v, &mut self.dashpots);
    }

    /// Work of anchors against springs, in J.
    pub(crate) fn add_spring_work(&mut self, work: f64) {
        self.spring_work += work;
    }

    /// The flows of the step, which ended with the velocities `v`.
    pub(crate) fn flows(&self, system: &System, v: &[Vector3<f64>]) -> Flows {
        let dashpots = system.dashpots();
        Flows {
            dashpot_heat: dashpots.energy_taken(&self.dashpots, &self.rates, v),
            anchor_work: self.spring_work + dashpots.anchor_work(&self.dashpots, v),
        }
    }
}
