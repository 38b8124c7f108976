//! What can be wrong with a scene, all of it at once.

use crate::problem::SHORTEST_STEP;
use crate::{
    BreakLimit, Guide, Load, NamedMotion, Node, OverTime, Path, Problem, RunOptions, Scene, Spring,
    SpringLaw, StepControl,
};
use nalgebra::Vector3;

/// Of velocities across a guide, which many steps have added up.
const ROUNDING: f64 = 1e-9;

/// Of a stiffness that is said twice.
const SAME_STIFFNESS: f64 = 1e-6;

impl RunOptions {
    /// What keeps a scene from being run with them; empty if nothing does.
    pub fn problems(&self) -> Vec<Problem> {
        let mut problems = Problems(Vec::new());
        if let Some(sleep) = self.sleep {
            problems.positive(Path::Simulation("sleep"), sleep);
        }
        problems.0
    }
}

impl Scene {
    /// Everything that keeps the scene from being simulated, in the order of
    /// the scene; empty if nothing does.
    pub fn problems(&self) -> Vec<Problem> {
        let mut problems = Problems(Vec::new());
        problems.count("nodes", self.nodes.len());
        problems.count("springs", self.springs.len());
        for &component in &self.gravity {
            problems.finite(Path::Scene("gravity"), component);
        }
        for (index, node) in self.nodes.iter().enumerate() {
            let path = |field| Path::Node(index, Some(field));
            problems.all_finite(path("position"), node.position.as_slice());
            problems.all_finite(path("velocity"), node.velocity.as_slice());
            problems.not_negative(path("mass"), node.mass);
            if let Some(drag) = node.drag {
                problems.not_negative(path("drag"), drag);
            }
            if let Some(motion) = node.motion {
                problems.follows(index, node, motion, self.motions.len());
            }
            if let Some(guide) = node.guide {
                problems.guide(index, node, guide);
            }
        }
        if problems.0.is_empty() && !self.size().is_finite() {
            // What else is wrong may only come of it.
            problems
                .0
                .extend(self.furthest().map(|node| Problem::TooFar { node }));
            return problems.0;
        }
        let mut held = vec![false; self.nodes.len()];
        for (index, spring) in self.springs.iter().enumerate() {
            if problems.joins_two_nodes(index, spring.nodes, self.nodes.len()) {
                let holds = spring.is_elastic() || spring.mass > 0.0;
                for node in spring.nodes {
                    held[node] |= holds;
                }
            }
            problems.spring(index, spring, &self.laws);
        }
        for (law, fault) in self.laws.iter().map(SpringLaw::fault).enumerate() {
            let problem = fault.map(|fault| Problem::Law { law, fault });
            problems.0.extend(problem);
        }
        for (index, node) in self.nodes.iter().enumerate() {
            if !node.fixed && node.mass == 0.0 && !held[index] {
                problems.0.push(Problem::Unheld { node: index });
            }
        }
        for (index, motion) in self.motions.iter().enumerate() {
            problems.motion(index, motion);
        }
        problems.not_negative(Path::Scene("drag"), self.drag);
        problems.not_negative(Path::Damping("mass"), self.damping.mass);
        problems.not_negative(Path::Damping("stiffness"), self.damping.stiffness);
        for (index, load) in self.loads.iter().enumerate() {
            problems.load(index, load, self.nodes.len());
        }
        match self.settings.step {
            StepControl::Auto => {}
            StepControl::Fixed(step) => {
                problems.positive(Path::Simulation("step"), step);
                if step > 0.0 && step < SHORTEST_STEP {
                    problems.0.push(Problem::TooShort { step });
                }
            }
            StepControl::Tolerance(tolerance) => {
                problems.positive(Path::Simulation("tolerance"), tolerance);
            }
        }
        problems.not_negative(Path::Simulation("duration"), self.settings.duration);
        if self.output.frames == Some(0) {
            let path = Path::Output("frames");
            problems.0.push(Problem::NotPositive { path, value: 0.0 });
        }
        let probes = self.output.probes.iter().enumerate();
        let faulty = probes.filter_map(|(index, probe)| probe.problem(index, self));
        problems.0.extend(faulty);
        if problems.0.is_empty() {
            problems.0.extend(self.overflow());
        }
        problems.0
    }

    /// The first thing that is wrong with numbers of springs, if anything is: what may
    /// become wrong of a sound scene when only these change.
    pub fn problem_of_springs(&self) -> Option<Problem> {
        let mut problems = Problems(Vec::new());
        let mut springs = self.springs.iter().enumerate();
        springs.find_map(|(index, spring)| {
            problems.spring(index, spring, &self.laws);
            problems.0.drain(..).next()
        })
    }

    /// The node with the largest coordinate.
    fn furthest(&self) -> Option<usize> {
        let size = |&node: &usize| self.nodes[node].position.amax();
        (0..self.nodes.len()).max_by(|a, b| size(a).total_cmp(&size(b)))
    }

    /// The first quantity that overflows in a scene whose numbers are finite.
    fn overflow(&self) -> Option<Problem> {
        let mut energy = 0.0;
        for (node, mass) in self.node_masses().into_iter().enumerate() {
            let Node {
                fixed, velocity, ..
            } = self.nodes[node];
            if !fixed && mass > 0.0 && !mass.recip().is_finite() {
                return Some(Problem::TooLight { node, mass });
            }
            energy += 0.5 * mass * velocity.norm_squared();
            if !energy.is_finite() {
                return Some(Problem::TooFast { node });
            }
        }
        for (node, anchor) in self.nodes.iter().enumerate().filter(|(_, node)| node.fixed) {
            let duration = self.settings.duration;
            let moved = self.displacement(node, duration);
            let moved = moved.map_or(Vector3::zeros(), |moved| moved.displacement);
            let end = anchor.position + anchor.velocity * duration + moved;
            let is_far = |value: &&f64| !(**value * **value).is_finite();
            if let Some(&value) = end.iter().find(is_far) {
                return Some(Problem::MovesTooFar { node, value });
            }
        }
        for (index, spring) in self.springs.iter().enumerate() {
            let [a, b] = spring.nodes;
            let change = self.nodes[a].distance(&self.nodes[b]) - spring.rest_length;
            energy += 0.5 * spring.stiffness * change * change;
            if !energy.is_finite() {
                return Some(Problem::TooStrained { spring: index });
            }
        }
        None
    }
}

struct Problems(Vec<Problem>);

impl Problems {
    fn count(&mut self, what: &'static str, count: usize) {
        if u32::try_from(count).is_err() {
            self.0.push(Problem::TooMany { what, count });
        }
    }

    fn guide(&mut self, index: usize, node: &Node, guide: Guide) {
        if node.fixed {
            return self.0.push(Problem::FixedAndGuided { node: index });
        }
        let is_guide = match guide {
            Guide::Held(axes) => axes.contains(&true) && axes.contains(&false),
            Guide::Along(direction) => {
                let path = Path::Node(index, Some("slides"));
                self.all_finite(path, direction.as_slice());
                direction.amax() > 0.0
            }
        };
        if !is_guide {
            return self.0.push(Problem::NoGuide { node: index, guide });
        }
        let across = (node.velocity - guide.free_part(&node.velocity)).norm();
        if across > ROUNDING * node.velocity.norm() {
            self.0.push(Problem::MovesAcross {
                node: index,
                across,
            });
        }
    }

    fn follows(&mut self, index: usize, node: &Node, motion: usize, motions: usize) {
        if motion >= motions {
            self.0.push(Problem::NoSuchMotion {
                node: index,
                motion,
                motions,
            });
        } else if !node.fixed {
            self.0.push(Problem::MovesFreely { node: index });
        }
    }

    fn spring(&mut self, index: usize, spring: &Spring, laws: &[SpringLaw]) {
        let path = |field| Path::Spring(index, Some(field));
        self.not_negative(path("stiffness"), spring.stiffness);
        self.not_negative(path("rest_length"), spring.rest_length);
        self.not_negative(path("mass"), spring.mass);
        self.not_negative(path("damping"), spring.damping);
        if let Some(law) = spring.law {
            self.has_law(index, spring, law, laws);
        }
        self.all_finite(path("yielded"), &[spring.yielded]);
        if spring.yielded != 0.0 && !can_yield(spring, laws) {
            self.0.push(Problem::CannotYield {
                spring: index,
                elongation: spring.yielded,
            });
        }
        if let Some(limit) = spring.breaks_at {
            self.breaks_at(index, spring, limit);
        }
    }

    fn has_law(&mut self, index: usize, spring: &Spring, law: usize, laws: &[SpringLaw]) {
        let Some(found) = laws.get(law) else {
            return self.0.push(Problem::NoSuchLaw {
                spring: index,
                law,
                laws: laws.len(),
            });
        };
        let Spring {
            stiffness,
            rest_length,
            ..
        } = *spring;
        if let SpringLaw::Plastic { hardening, .. } = *found
            && found.fault().is_none()
            && hardening >= stiffness
        {
            return self.0.push(Problem::HardensTooMuch {
                spring: index,
                hardening,
                stiffness,
            });
        }
        if !found.needs_rest_length() || found.fault().is_some() {
            return;
        }
        if rest_length == 0.0 {
            return self.0.push(Problem::NoStrain { spring: index });
        }
        let own = found.own_axial_stiffness();
        if let Some(own) = own.map(|own| own / rest_length)
            && (stiffness - own).abs() > SAME_STIFFNESS * own
        {
            self.0.push(Problem::OtherStiffness {
                spring: index,
                stiffness,
                own,
            });
        }
    }

    fn breaks_at(&mut self, index: usize, spring: &Spring, limit: BreakLimit) {
        if !limit.is_possible() {
            self.0.push(Problem::BreakLimit {
                spring: index,
                limit,
            });
        } else if matches!(limit, BreakLimit::Strain(_)) && spring.rest_length == 0.0 {
            self.0.push(Problem::NoBreakingStrain { spring: index });
        }
    }

    fn motion(&mut self, index: usize, NamedMotion { name, motion }: &NamedMotion) {
        let numbers = motion.numbers();
        if numbers.is_empty() {
            self.0.push(Problem::EmptyMotion {
                motion: index,
                name: name.clone(),
            });
        }
        self.all_finite(Path::Motion(index, None), &numbers);
        let found = out_of_order(&motion.kinks());
        self.0
            .extend(found.map(|[before, after]| Problem::MotionNotInOrder {
                motion: index,
                name: name.clone(),
                before,
                after,
            }));
    }

    fn load(&mut self, index: usize, load: &Load, n_nodes: usize) {
        let missing = load.nodes.iter().find(|&&node| node >= n_nodes);
        self.0.extend(missing.map(|&node| Problem::NoSuchLoaded {
            load: index,
            node,
            nodes: n_nodes,
        }));
        self.all_finite(Path::Load(index, Some("force")), load.force.as_slice());
        if matches!(&load.over_time, OverTime::Table(points) if points.is_empty()) {
            self.0.push(Problem::EmptyTable { load: index });
        }
        let path = Path::Load(index, Some("over_time"));
        self.all_finite(path, &load.over_time.numbers());
        let found = out_of_order(&load.over_time.kinks());
        self.0
            .extend(found.map(|[before, after]| Problem::NotInOrder {
                load: index,
                before,
                after,
            }));
    }

    /// Whether it is.
    fn finite(&mut self, path: Path, value: f64) -> bool {
        if !value.is_finite() {
            self.0.push(Problem::NotFinite { path, value });
        }
        value.is_finite()
    }

    fn all_finite(&mut self, path: Path, values: &[f64]) {
        for &value in values {
            if !self.finite(path, value) {
                return;
            }
        }
    }

    fn not_negative(&mut self, path: Path, value: f64) {
        if self.finite(path, value) && value < 0.0 {
            self.0.push(Problem::Negative { path, value });
        }
    }

    fn positive(&mut self, path: Path, value: f64) {
        if self.finite(path, value) && value <= 0.0 {
            self.0.push(Problem::NotPositive { path, value });
        }
    }

    /// Whether the two nodes exist and differ.
    fn joins_two_nodes(&mut self, spring: usize, ends: [usize; 2], nodes: usize) -> bool {
        if let Some(&node) = ends.iter().find(|&&node| node >= nodes) {
            self.0.push(Problem::NoSuchNode {
                spring,
                node,
                nodes,
            });
            return false;
        }
        if ends[0] == ends[1] {
            let node = ends[0];
            self.0.push(Problem::Loop { spring, node });
            return false;
        }
        true
    }
}

/// The first of some times that is not after the one before, and that one.
pub fn out_of_order(times: &[f64]) -> Option<[f64; 2]> {
    let mut pairs = times.windows(2).map(|pair| [pair[0], pair[1]]);
    pairs.find(|[before, after]| before >= after)
}

/// Whether the law of a spring yields; one that does not exist may.
fn can_yield(spring: &Spring, laws: &[SpringLaw]) -> bool {
    let law = spring.law.map(|law| laws.get(law));
    law.is_some_and(|law| law.is_none_or(|law| matches!(law, SpringLaw::Plastic { .. })))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vector3;

    fn lines(scene: &Scene) -> Vec<String> {
        let line = |problem: &Problem| format!("{}: {problem}", problem.path());
        scene.problems().iter().map(line).collect()
    }

    #[test]
    fn a_sound_scene_has_none() {
        assert!(Scene::default().problems().is_empty());
    }

    #[test]
    fn all_are_listed_in_order() {
        let mut scene = Scene {
            gravity: Vector3::new(0.0, f64::INFINITY, 0.0),
            ..Scene::default()
        };
        scene.add_node(Node::fixed(Vector3::zeros()));
        scene.add_node(Node {
            mass: -1.0,
            velocity: Vector3::new(f64::NAN, 0.0, 0.0),
            ..Node::at(Vector3::x())
        });
        scene.add_node(Node::at(Vector3::y()));
        let spring = Spring {
            damping: f64::NAN,
            ..Spring::between(0, 7, -2.0, -0.5)
        };
        scene.springs.push(spring);
        scene.springs.push(Spring {
            nodes: [1, 1],
            ..spring
        });
        scene.settings.step = StepControl::Fixed(0.0);
        scene.settings.duration = -1.0;
        let expected = [
            "gravity: gravity must be a finite number, but is inf",
            "nodes[1].velocity: the velocity of node 1 must be a finite number, but is NaN",
            "nodes[1].mass: the mass of node 1 must not be negative, but is -1",
            "springs[0].nodes: spring 0 joins node 7, but the scene has only nodes 0 to 2",
            "springs[0].stiffness: the stiffness of spring 0 must not be negative, but is -2",
            "springs[0].rest_length: the rest length of spring 0 must not be negative, but is -0.5",
            "springs[0].damping: the damping of spring 0 must be a finite number, but is NaN",
            "springs[1].nodes: spring 1 joins node 1 to itself",
            "springs[1].stiffness: the stiffness of spring 1 must not be negative, but is -2",
            "springs[1].rest_length: the rest length of spring 1 must not be negative, but is -0.5",
            "springs[1].damping: the damping of spring 1 must be a finite number, but is NaN",
            "nodes[2]: node 2 is free but has no mass, and no spring holds it",
            "simulation.step: the simulation's step must be greater than zero, but is 0",
            "simulation.duration: the simulation's duration must not be negative, but is -1",
        ];
        assert_eq!(lines(&scene), expected);
    }

    #[test]
    fn numbers_that_overflow_are_named() {
        let sound = || {
            let mut scene = Scene::default();
            scene.add_node(Node::fixed(Vector3::zeros()));
            scene.add_node(Node {
                mass: 1.0,
                ..Node::at(Vector3::x())
            });
            scene.add_spring(0, 1, 1.0);
            scene
        };
        let of = |change: fn(&mut Scene)| {
            let mut scene = sound();
            change(&mut scene);
            lines(&scene).join("; ")
        };
        assert_eq!(of(|_| {}), "");
        let far = of(|scene| scene.nodes[1].position.x = 1e308);
        assert!(
            far.starts_with("nodes[1].position: node 1 is too far"),
            "{far}"
        );
        let light = of(|scene| scene.nodes[1].mass = 1e-310);
        assert!(
            light.starts_with("nodes[1].mass: the mass of node 1 is too small"),
            "{light}"
        );
        let fast = of(|scene| scene.nodes[1].velocity.z = 1e160);
        assert!(
            fast.starts_with("nodes[1].velocity: the velocity of node 1"),
            "{fast}"
        );
        let moving = of(|scene| {
            scene.nodes[0].velocity.x = 1e153;
            scene.settings.duration = 100.0;
        });
        assert_eq!(
            moving,
            "nodes[0].velocity: node 0 is fixed and moves to 1e155 m, which is too large to compute with"
        );
        let strained = of(|scene| {
            scene.springs[0].stiffness = 1e300;
            scene.springs[0].rest_length = 1e10;
        });
        assert!(
            strained.starts_with("springs[0].stiffness: spring 0 is too stiff"),
            "{strained}"
        );
        let short = of(|scene| scene.settings.step = StepControl::Fixed(1e-170));
        assert!(
            short.starts_with("simulation.step: the simulation's step"),
            "{short}"
        );
    }
}
