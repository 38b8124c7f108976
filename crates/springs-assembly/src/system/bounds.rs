//! How fast a system can move at most.

use super::System;

impl System {
    /// A bound on the angular frequency of every motion in every
    /// configuration, in rad/s: ω² ≤ max (2/m) Σ K over the springs of a node,
    /// from the [bounds](crate::Emitter::add_stiffness_bounds) of all emitters. Infinite if a
    /// massless node has a spring or a term has no bound, zero without any.
    pub fn frequency_bound(&self) -> f64 {
        self.frequency_bounds[0]
    }

    /// As [`Self::frequency_bound`], over the nodes that have a mass; in rad/s.
    pub fn frequency_bound_of_massive_nodes(&self) -> f64 {
        self.frequency_bounds[1]
    }

    /// Finds the bounds on frequencies, at the start and where springs changed.
    pub(super) fn find_bounds(&mut self) {
        let all = self.largest_per_mass(|sums| self.add_stiffness_bounds(sums));
        let of_massive_nodes = self.largest_per_mass(|sums| {
            self.add_stiffness_bounds(sums);
            let of_masses = sums.iter_mut().zip(&self.masses);
            of_masses
                .filter(|(_, mass)| **mass == 0.0)
                .for_each(|(sum, _)| *sum = 0.0);
        });
        self.frequency_bounds = [all, of_massive_nodes].map(|bound| (2.0 * bound).sqrt());
    }

    /// A bound on the stiffness at every free block in any configuration, in N/m: half of
    /// that on the eigenvalues of what its terms add there. Infinite if a term has no bound.
    pub fn stiffness_bounds(&self) -> Vec<f64> {
        let mut bounds = vec![0.0; self.n_free()];
        self.add_stiffness_bounds(&mut bounds);
        bounds
    }

    fn add_stiffness_bounds(&self, bounds: &mut [f64]) {
        for emitter in self.emitters() {
            emitter.add_stiffness_bounds(bounds);
        }
    }

    /// A free and a fixed block of every coupling that has one of each.
    pub fn anchored(&self) -> impl Iterator<Item = [usize; 2]> {
        let anchored = self.couplings.anchored.iter();
        anchored.map(|ends| ends.map(|block| block as usize))
    }

    /// The step size, in s, up to which velocity Verlet is stable at a free
    /// block, whatever the configuration: 2/ω with ω² = (2/m) Σ K.
    ///
    /// # Panics
    ///
    /// If there is no such block.
    pub fn stable_step_at(&self, block: usize) -> f64 {
        let mut sums = vec![0.0; self.n_free()];
        self.add_stiffness_bounds(&mut sums);
        2.0 / (2.0 * sums[block] / self.masses[block]).sqrt()
    }

    /// A bound on the decay rate that dashpots give to any motion in any
    /// configuration, in 1/s: max (2/m) Σ c over the dashpots of a node.
    pub fn damping_rate_bound(&self) -> f64 {
        2.0 * self.largest_per_mass(|sums| {
            for (_, emitter) in self.damped() {
                emitter.add_damping_bounds(sums);
            }
        })
    }

    /// The largest sum per mass over the free blocks; 0/0 counts as 0.
    fn largest_per_mass(&self, add_sums: impl FnOnce(&mut [f64])) -> f64 {
        let mut sums = vec![0.0; self.n_free()];
        add_sums(&mut sums);
        let ratios = sums.iter().zip(&self.masses).map(
            |(&sum, &mass)| {
                if sum == 0.0 { 0.0 } else { sum / mass }
            },
        );
        ratios.fold(0.0, f64::max)
    }
}
