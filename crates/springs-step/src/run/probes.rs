//! What the probes of a scene tell of it.

use crate::NodeStates;
use springs_scene::{ProbeQuantity, Probed, Scene};

/// What a probe tells at one time.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Sample {
    /// The index of the probe in the scene.
    pub probe: usize,
    /// The [numbers](ProbeQuantity::numbers) of each of its quantities, of each node or spring
    /// that it looks at.
    pub values: Vec<f64>,
}

/// What springs give at one time, by their indices in the scene; empty where that is not
/// wanted.
#[derive(Clone, Debug, Default)]
pub(crate) struct SpringValues {
    /// In N.
    pub(crate) tensions: Vec<f64>,
    /// In J.
    pub(crate) energies: Vec<f64>,
}

/// Which of these are wanted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Wanted {
    pub(crate) tensions: bool,
    pub(crate) energies: bool,
}

/// The probes of a scene.
pub(crate) struct Probes(Vec<Probe>);

struct Probe {
    every: Option<f64>,
    of: Vec<ProbeQuantity>,
    items: Vec<Item>,
}

#[derive(Clone, Copy)]
enum Item {
    Node {
        node: usize,
        /// In kg.
        mass: f64,
    },
    Spring {
        spring: usize,
        nodes: [usize; 2],
        rest_length: f64,
    },
}

impl Probes {
    /// Of a scene without problems.
    pub(crate) fn of(scene: &Scene) -> Self {
        let probes = &scene.output.probes;
        if probes.is_empty() {
            return Self(Vec::new());
        }
        let masses = scene.node_masses();
        let node = |&node: &usize| Item::Node {
            node,
            mass: masses[node],
        };
        let spring = |&spring: &usize| Item::Spring {
            spring,
            nodes: scene.springs[spring].nodes,
            rest_length: scene.springs[spring].rest_length,
        };
        let probes = probes.iter().map(|probe| Probe {
            every: probe.every,
            of: probe.of.clone(),
            items: match &probe.on {
                Probed::Nodes(nodes) => nodes.iter().map(node).collect(),
                Probed::Springs(springs) => springs.iter().map(spring).collect(),
            },
        });
        Self(probes.collect())
    }

    /// How often each looks, in s; `None`: at each frame.
    pub(crate) fn periods(&self) -> impl Iterator<Item = Option<f64>> {
        self.0.iter().map(|probe| probe.every)
    }

    /// Whether any of them tells a tension.
    pub(crate) fn want_tensions(&self) -> bool {
        self.wanted(0..self.0.len()).tensions
    }

    /// What these need of springs.
    pub(crate) fn wanted(&self, probes: impl IntoIterator<Item = usize>) -> Wanted {
        let mut wanted = Wanted::default();
        for probe in probes {
            let Probe { of, items, .. } = &self.0[probe];
            let is_of_springs = matches!(items.first(), Some(Item::Spring { .. }));
            wanted.tensions |= is_of_springs && of.contains(&ProbeQuantity::Tension);
            wanted.energies |= is_of_springs && of.contains(&ProbeQuantity::Energy);
        }
        wanted
    }

    /// What some of them tell.
    pub(crate) fn look(
        &self,
        probes: &[usize],
        nodes: &NodeStates,
        springs: &SpringValues,
    ) -> Vec<Sample> {
        let samples = probes.iter().map(|&probe| {
            let mut values = Vec::new();
            let Probe { of, items, .. } = &self.0[probe];
            for item in items {
                for quantity in of {
                    item.tell(*quantity, nodes, springs, &mut values);
                }
            }
            Sample { probe, values }
        });
        samples.collect()
    }
}

impl Item {
    fn tell(
        self,
        quantity: ProbeQuantity,
        nodes: &NodeStates,
        springs: &SpringValues,
        values: &mut Vec<f64>,
    ) {
        match self {
            Self::Node { node, mass } => {
                let (x, v) = (&nodes.positions[node], &nodes.velocities[node]);
                match quantity {
                    ProbeQuantity::Position => values.extend(x.iter()),
                    ProbeQuantity::Velocity => values.extend(v.iter()),
                    _ => values.push(0.5 * mass * v.norm_squared()),
                }
            }
            Self::Spring {
                spring,
                nodes: ends,
                rest_length,
            } => {
                let [a, b] = ends.map(|node| nodes.positions[node]);
                let length = (b - a).norm();
                values.push(match quantity {
                    ProbeQuantity::Length => length,
                    ProbeQuantity::Strain => (length - rest_length) / rest_length,
                    ProbeQuantity::Tension => springs.tensions[spring],
                    _ => springs.energies[spring],
                });
            }
        }
    }
}
