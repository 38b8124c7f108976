//! Velocity Verlet with an estimate of its error.

use super::passes::set_errors_of_pair;
use crate::method::weighing::{Weighing, part_of_difference};
use crate::{
    Anchors, Archive, ErrorEstimate, Flows, Interval, Method, MethodError, Splitting, State, Work,
};
use nalgebra::Vector3;
use springs_assembly::System;

/// Velocity Verlet in pairs of steps of half the size.
///
/// With the accelerations a₀, a₁, a₂ at the ends of two steps of size k, one step of
/// 2k from the same start ends d = k²(a₁ − a₀) before them and, with a₂ for the
/// acceleration at its own end, is slower by k/2·(2a₁ − a₀ − a₂). Dashpots see velocities there
/// that differ by 3/2 d/k, so that it is faster by 3/2 M⁻¹D d. So
/// the errors that [`crate::Doubling`] finds with a third evaluation of forces are
/// there already, but for a part of velocities that is of one order higher.
pub struct VerletPairs {
    verlet: Splitting,
    /// D d, in N·s; empty without dashpots.
    damping: Vec<Vector3<f64>>,
    /// Hidden state is that at the start of the pair.
    is_fresh: bool,
    weighing: Weighing,
    flows: Flows,
}

impl VerletPairs {
    /// For a system.
    pub fn new(system: &System) -> Self {
        let verlet = Splitting::velocity_verlet(system);
        Self {
            damping: if system.is_damped() {
                vec![Vector3::zeros(); system.n_free()]
            } else {
                Vec::new()
            },
            weighing: Weighing::new(system, verlet.order()),
            verlet,
            is_fresh: true,
            flows: Flows::default(),
        }
    }
}

impl Method for VerletPairs {
    fn order(&self) -> u32 {
        self.verlet.order()
    }

    fn restart(&mut self) {
        self.verlet.restart();
        self.is_fresh = true;
        self.weighing.restart();
    }

    fn step(
        &mut self,
        system: &System,
        anchors: &Anchors,
        interval: Interval,
        state: &mut State,
        work: &mut Work,
    ) -> Result<Option<ErrorEstimate>, MethodError> {
        let [first, second] = interval.halves();
        self.weighing.begin(&state.v);
        // The first half of a rejected pair was accepted.
        if !self.is_fresh {
            self.verlet.go_back();
            self.is_fresh = true;
        }
        self.verlet.step(system, anchors, first, state, work)?;
        self.flows.copy_from(self.verlet.last_flows());
        self.verlet.accept();
        self.is_fresh = false;
        self.verlet.step(system, anchors, second, state, work)?;
        self.flows.add(self.verlet.last_flows());
        let part = part_of_difference(self.order());
        let (k, accelerations) = (first.size, self.verlet.last_accelerations());
        let factors = [part * k * k, part * 0.5 * k];
        let [e_x, e_v] = self.weighing.errors();
        set_errors_of_pair(factors, accelerations, [e_x, e_v]);
        if system.is_damped() {
            self.damping.fill(Vector3::zeros());
            system.add_damping_product(&state.x, &state.v, 1.0, e_x, &mut self.damping);
            let damped = self.damping.iter().zip(system.masses());
            for (e_v, (damped, mass)) in e_v.iter_mut().zip(damped) {
                *e_v -= damped * (1.5 / mass);
            }
        }
        Ok(Some(self.weighing.estimate(interval.size, state)))
    }

    fn second_estimate(
        &mut self,
        system: &System,
        state: &State,
        work: &mut Work,
    ) -> Option<ErrorEstimate> {
        let at = (system, state);
        Some(self.weighing.second_estimate(&mut self.verlet, at, work))
    }

    fn least_estimate(&self) -> Option<ErrorEstimate> {
        Some(self.weighing.least_estimate())
    }

    fn archive(&mut self, archive: &mut Archive) {
        self.verlet.archive(archive);
        archive.flag(&mut self.is_fresh);
        self.weighing.archive(archive);
    }

    fn accept(&mut self) {
        self.verlet.accept();
        self.is_fresh = true;
    }

    fn flows(&self) -> Option<&Flows> {
        Some(&self.flows)
    }

    fn kinetic_energy(&self) -> Option<f64> {
        self.verlet.kinetic_energy()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Doubling;
    use springs_assembly::compile;
    use springs_scene::generate::{Material, cloth};

    /// Without dashpots, with weak ones and with strong ones: the same steps, and the same
    /// estimates but for a part that vanishes with the step size.
    #[test]
    fn estimates_are_those_of_steps_made_twice() {
        for damping in [0.0, 0.02, 0.5] {
            let mut scene = cloth(5, Material::of_cloth());
            for (index, spring) in scene.springs.iter_mut().enumerate() {
                spring.damping = damping * (1.0 + (index % 3) as f64);
            }
            for (index, node) in scene.nodes.iter_mut().enumerate() {
                let phase = 1.3 * index as f64;
                node.velocity = Vector3::new(phase.sin(), phase.cos(), (2.0 * phase).sin()) * 0.3;
            }
            let system = compile(&scene).unwrap();
            let fastest = system.frequency_bound().max(system.damping_rate_bound());
            let misses = [0.1, 0.05].map(|angle| {
                let h = angle / fastest;
                let verlet = Box::new(Splitting::velocity_verlet(&system));
                let methods: [Box<dyn Method>; 2] = [
                    Box::new(VerletPairs::new(&system)),
                    Box::new(Doubling::new(&system, verlet)),
                ];
                let [pairs, twice] = methods.map(|mut method| {
                    let mut state = State::initial(&system);
                    let interval = Interval {
                        start: 0.0,
                        end: h,
                        size: h,
                    };
                    let anchors = Anchors::new(&system, &state);
                    let mut work = Work::default();
                    let estimate = method
                        .step(&system, &anchors, interval, &mut state, &mut work)
                        .unwrap();
                    (state.x, estimate.unwrap().rate)
                });
                assert_eq!(pairs.0, twice.0);
                (pairs.1 / twice.1 - 1.0).abs()
            });
            assert!(
                misses.iter().all(|miss| *miss < 0.15),
                "{damping}: {misses:?}"
            );
        }
    }
}
