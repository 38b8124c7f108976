//! Nodes, springs and the scene that holds them.

use crate::{Displacement, Load, Output, PrescribedMotion, Settings, SpringLaw};
use nalgebra::Vector3;

/// A point mass: three coordinates, the note's degrees of freedom.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// x at time 0, in m.
    pub position: Vector3<f64>,
    /// v at time 0, in m/s.
    pub velocity: Vector3<f64>,
    /// A point mass on top of what springs give, in kg.
    pub mass: f64,
    /// Whether the node follows x₀ + v t whatever pulls at it.
    pub fixed: bool,
    /// Drag b of a free node, in N·s/m: the force −b v; `None`: that of the scene.
    pub drag: Option<f64>,
    /// Where a node that is not fixed may move, if not everywhere.
    pub guide: Option<Guide>,
    /// The index of a motion of the scene that a fixed node follows beside x₀ + v t.
    pub motion: Option<usize>,
}

/// A motion with a name for people.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedMotion {
    /// Its name.
    pub name: String,
    /// What it is.
    pub motion: PrescribedMotion,
}

/// A support that lets a node move in part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Guide {
    /// Held along those of the axes x, y, z that are true; one or two of them.
    Held([bool; 3]),
    /// Free along this direction only, of any length but zero.
    Along(Vector3<f64>),
}

impl Guide {
    /// The part of a vector along which it lets a node move.
    pub fn free_part(&self, vector: &Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Held(axes) => {
                let free = |axis: usize| if axes[axis] { 0.0 } else { vector[axis] };
                Vector3::new(free(0), free(1), free(2))
            }
            Self::Along(direction) => {
                // Scaled first: squares may overflow.
                let unit = (direction / direction.amax()).normalize();
                unit * unit.dot(vector)
            }
        }
    }
}

impl Node {
    /// A free node at rest, without mass of its own; `position` in m.
    pub fn at(position: Vector3<f64>) -> Self {
        Self {
            position,
            velocity: Vector3::zeros(),
            mass: 0.0,
            fixed: false,
            drag: None,
            guide: None,
            motion: None,
        }
    }

    /// How far it is from another one, in m: to the last bit what the kernels
    /// find, so that a spring of this rest length pulls nowhere.
    pub fn distance(&self, other: &Self) -> f64 {
        let d = other.position - self.position;
        (d.x * d.x + d.y * d.y + d.z * d.z).sqrt()
    }

    /// A node that stands still at `position`, in m.
    pub fn fixed(position: Vector3<f64>) -> Self {
        Self {
            fixed: true,
            ..Self::at(position)
        }
    }

    /// Whether the node is fixed and moves.
    pub fn is_moving_anchor(&self) -> bool {
        self.fixed && (self.velocity != Vector3::zeros() || self.motion.is_some())
    }
}

/// A spring between two nodes, with a dashpot along it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spring {
    /// Indices of its two nodes, from 0.
    pub nodes: [usize; 2],
    /// K, in N/m; with a law that gives tensions by itself, that at rest.
    pub stiffness: f64,
    /// l₀, in m.
    pub rest_length: f64,
    /// Mass in kg; half goes to each node.
    pub mass: f64,
    /// Damping c of the dashpot along it, in N·s/m.
    pub damping: f64,
    /// The index of its law among those of the scene; `None`: the linear one.
    pub law: Option<usize>,
    /// Where it breaks, if it can.
    pub breaks_at: Option<BreakLimit>,
    /// Whether it has broken: then only its mass is left of it.
    pub broken: bool,
    /// How much longer it is for good than when it was new, in m, where its law yields.
    pub yielded: f64,
}

/// Where a spring breaks. That is decided at the ends of steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BreakLimit {
    /// Above this strain l/l₀ − 1.
    Strain(f64),
    /// Above this tension, in N.
    Force(f64),
}

impl BreakLimit {
    /// The number.
    pub fn value(&self) -> f64 {
        match *self {
            Self::Strain(value) | Self::Force(value) => value,
        }
    }

    /// Whether it is finite and not negative, as it must be.
    pub fn is_possible(&self) -> bool {
        self.value().is_finite() && self.value() >= 0.0
    }

    /// What it is: a strain or a force.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Strain(_) => "strain",
            Self::Force(_) => "force",
        }
    }
}

/// Why a damping ratio says nothing of a spring.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NoDampingRatio {
    /// Nothing that it joins can move.
    #[error("both nodes of spring {spring} are fixed: it has no damping ratio")]
    Held {
        /// The spring.
        spring: usize,
    },
    /// A node would have no time to swing in.
    #[error("node {node} of spring {spring} has no mass to take a damping ratio of")]
    Massless {
        /// The spring.
        spring: usize,
        /// The node.
        node: usize,
    },
}

impl NoDampingRatio {
    /// What to do about it.
    pub fn advice(&self) -> &'static str {
        "give the spring a damping, in N·s/m"
    }
}

impl Spring {
    /// A linear spring between two nodes of a scene that has no mass and no damping and
    /// does not break, with K in N/m and l₀ in m.
    pub fn between(first: usize, second: usize, stiffness: f64, rest_length: f64) -> Self {
        Self {
            nodes: [first, second],
            stiffness,
            rest_length,
            mass: 0.0,
            damping: 0.0,
            law: None,
            breaks_at: None,
            broken: false,
            yielded: 0.0,
        }
    }

    /// Whether it has a force of its length.
    pub fn is_elastic(&self) -> bool {
        !self.broken && (self.stiffness > 0.0 || self.law.is_some())
    }

    /// Whether it can break or has broken.
    pub fn is_breakable(&self) -> bool {
        self.broken || self.breaks_at.is_some()
    }
}

/// Rayleigh damping: the force −α m v on every free node, and a dashpot β K along every
/// spring.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rayleigh {
    /// α, in 1/s.
    pub mass: f64,
    /// β, in s.
    pub stiffness: f64,
}

/// Everything that a simulation starts from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// A name for people; may be empty.
    pub name: String,
    /// g, in m/s².
    pub gravity: Vector3<f64>,
    /// Nodes; springs refer to them by index.
    pub nodes: Vec<Node>,
    /// Springs.
    pub springs: Vec<Spring>,
    /// Laws that springs may have.
    pub laws: Vec<SpringLaw>,
    /// Forces from outside.
    pub loads: Vec<Load>,
    /// Motions that fixed nodes may follow.
    pub motions: Vec<NamedMotion>,
    /// Drag b of every free node that has none of its own, in N·s/m: the force −b v.
    pub drag: f64,
    /// Damping in proportion to masses and stiffnesses.
    pub damping: Rayleigh,
    /// How to simulate it.
    pub settings: Settings,
    /// What a run shows of it.
    pub output: Output,
}

impl Scene {
    /// Appends a node and returns its index.
    pub fn add_node(&mut self, node: Node) -> usize {
        self.nodes.push(node);
        self.nodes.len() - 1
    }

    /// What the motion of a node adds at a time in s; `None` if it follows none, or
    /// one that does not exist.
    pub fn displacement(&self, node: usize, time: f64) -> Option<Displacement> {
        let motion = self.motions.get(self.nodes[node].motion?)?;
        Some(motion.motion.at(time))
    }

    /// Where a node is at time 0, in m.
    pub fn start_position(&self, node: usize) -> Vector3<f64> {
        let moved = self.displacement(node, 0.0);
        let position = self.nodes[node].position;
        moved.map_or(position, |moved| position + moved.displacement)
    }

    /// Its velocity at time 0, in m/s.
    pub fn start_velocity(&self, node: usize) -> Vector3<f64> {
        let moved = self.displacement(node, 0.0);
        let velocity = self.nodes[node].velocity;
        moved.map_or(velocity, |moved| velocity + moved.velocity)
    }

    /// Makes it the scene that goes on `time` s later, with what varies over time where
    /// it is then.
    pub fn shift_time(&mut self, time: f64) {
        for load in &mut self.loads {
            load.over_time = load.over_time.after(time);
        }
        for motion in &mut self.motions {
            motion.motion = motion.motion.after(time);
        }
    }

    /// Appends a massless, undamped spring of the given stiffness in N/m, at
    /// rest at the present distance of its nodes, and returns its index.
    ///
    /// # Panics
    ///
    /// If a node does not exist.
    pub fn add_spring(&mut self, first: usize, second: usize, stiffness: f64) -> usize {
        let rest_length = self.distance(first, second);
        let spring = Spring::between(first, second, stiffness, rest_length);
        self.springs.push(spring);
        self.springs.len() - 1
    }

    /// Makes all springs `factor` times as stiff, whatever their laws.
    pub fn scale_stiffness(&mut self, factor: f64) {
        for spring in &mut self.springs {
            spring.stiffness *= factor;
        }
        for law in &mut self.laws {
            *law = law.times(factor);
        }
    }

    /// Shares a total mass in kg over the springs in proportion to their rest
    /// lengths; equally if all rest lengths are zero.
    pub fn share_mass(&mut self, total: f64) {
        let sum: f64 = self.springs.iter().map(|spring| spring.rest_length).sum();
        let count = self.springs.len() as f64;
        for spring in &mut self.springs {
            let share = if sum > 0.0 {
                spring.rest_length / sum
            } else {
                1.0 / count
            };
            spring.mass = total * share;
        }
    }

    /// Mass of every node in kg: its own and half of each of its springs'.
    ///
    /// # Panics
    ///
    /// If a spring refers to a node that does not exist.
    pub fn node_masses(&self) -> Vec<f64> {
        let mut masses: Vec<f64> = self.nodes.iter().map(|node| node.mass).collect();
        for spring in &self.springs {
            for node in spring.nodes {
                masses[node] += 0.5 * spring.mass;
            }
        }
        masses
    }

    /// The dashpot along a spring, in N·s/m: its own and what is in proportion to its
    /// stiffness.
    ///
    /// # Panics
    ///
    /// If there is no such spring.
    pub fn dashpot(&self, spring: usize) -> f64 {
        let spring = &self.springs[spring];
        if spring.broken {
            return 0.0;
        }
        spring.damping + self.damping.stiffness * spring.stiffness
    }

    /// The damping, in N·s/m, from which on the nodes of a spring would not swing about
    /// each other if no other spring held them: 2√(K μ) with their reduced mass,
    /// 1/μ = 1/m₁ + 1/m₂, where fixed nodes are infinitely heavy. `masses` are the
    /// [masses of all nodes](Self::node_masses). Infinite if both are fixed.
    ///
    /// # Panics
    ///
    /// If there is no such spring, or a node of it does not exist.
    pub fn critical_damping(&self, spring: usize, masses: &[f64]) -> f64 {
        let spring = &self.springs[spring];
        let [a, b] = spring.nodes.map(|node| {
            if self.nodes[node].fixed {
                0.0
            } else {
                masses[node].recip()
            }
        });
        2.0 * (spring.stiffness / (a + b)).sqrt()
    }

    /// The damping, in N·s/m, that is a part `ratio` of the critical one; `masses` are the
    /// [masses of all nodes](Self::node_masses).
    ///
    /// # Errors
    ///
    /// If a free node of the spring has no mass, or none of them is free.
    ///
    /// # Panics
    ///
    /// If there is no such spring, or a node of it does not exist.
    pub fn damping_of_ratio(
        &self,
        spring: usize,
        ratio: f64,
        masses: &[f64],
    ) -> Result<f64, NoDampingRatio> {
        let critical = self.critical_damping(spring, masses);
        if critical == f64::INFINITY {
            return Err(NoDampingRatio::Held { spring });
        }
        let is_massless = |node: &usize| !self.nodes[*node].fixed && masses[*node] == 0.0;
        match self.springs[spring].nodes.into_iter().find(is_massless) {
            Some(node) => Err(NoDampingRatio::Massless { spring, node }),
            None => Ok(ratio * critical),
        }
    }

    /// Whether any spring has a dashpot.
    pub fn has_dashpots(&self) -> bool {
        (0..self.springs.len()).any(|spring| self.dashpot(spring) > 0.0)
    }

    /// Whether drag acts on any node.
    ///
    /// # Panics
    ///
    /// If a spring refers to a node that does not exist.
    pub fn has_drag(&self) -> bool {
        self.node_drags().iter().any(|drag| *drag > 0.0)
    }

    /// The drag of each node that is free, in N·s/m; zero for the others.
    ///
    /// # Panics
    ///
    /// If a spring refers to a node that does not exist.
    pub fn node_drags(&self) -> Vec<f64> {
        let masses = self.node_masses();
        let drags = self.nodes.iter().zip(masses).map(|(node, mass)| {
            if node.fixed {
                0.0
            } else {
                node.drag.unwrap_or(self.drag) + self.damping.mass * mass
            }
        });
        drags.collect()
    }

    /// Length of the diagonal of the box around all nodes, in m, but no less than
    /// the shortest rest length that is not zero, which a scene that starts
    /// folded up will stretch to: the size that default tolerances refer to.
    pub fn size(&self) -> f64 {
        let rest_lengths = self.springs.iter().map(|spring| spring.rest_length);
        let shortest = rest_lengths
            .filter(|&length| length > 0.0)
            .min_by(f64::total_cmp);
        self.diagonal().max(shortest.unwrap_or(0.0))
    }

    fn diagonal(&self) -> f64 {
        let Some(first) = self.nodes.first() else {
            return 0.0;
        };
        let (mut low, mut high) = (first.position, first.position);
        for node in &self.nodes {
            low = low.inf(&node.position);
            high = high.sup(&node.position);
        }
        (high - low).norm()
    }

    fn distance(&self, first: usize, second: usize) -> f64 {
        self.nodes[first].distance(&self.nodes[second])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masses_come_from_nodes_and_springs() {
        let mut scene = Scene::default();
        for x in [0.0, 1.0, 4.0] {
            scene.add_node(Node::at(Vector3::new(x, 0.0, 0.0)));
        }
        scene.nodes[2].mass = 0.5;
        scene.add_spring(0, 1, 1.0);
        scene.add_spring(1, 2, 1.0);
        scene.share_mass(8.0);
        assert_eq!(scene.node_masses(), [1.0, 4.0, 3.5]);
        assert_eq!(scene.size(), 4.0);
    }

    #[test]
    fn zero_rest_lengths_share_mass_equally() {
        let mut scene = Scene::default();
        for _ in 0..3 {
            scene.add_node(Node::at(Vector3::zeros()));
        }
        scene.add_spring(0, 1, 1.0);
        scene.add_spring(1, 2, 1.0);
        scene.share_mass(1.0);
        assert_eq!(scene.node_masses(), [0.25, 0.5, 0.25]);
    }
}
