//! Places in a scene.

use std::fmt;

/// A place in a scene: `nodes[2].mass`, `gravity`, `simulation.step`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Path {
    /// A field of the scene itself.
    Scene(&'static str),
    /// A field of the simulation settings.
    Simulation(&'static str),
    /// A field of the damping of all springs and nodes.
    Damping(&'static str),
    /// A field of a node, or the whole node.
    Node(usize, Option<&'static str>),
    /// A field of a spring, or the whole spring.
    Spring(usize, Option<&'static str>),
    /// A field of a load, or the whole load.
    Load(usize, Option<&'static str>),
    /// A field of a motion, or the whole motion.
    Motion(usize, Option<&'static str>),
    /// A law of springs.
    Law(usize),
    /// A field of a material of a scene file, or the whole material.
    Material(usize, Option<&'static str>),
    /// A group of nodes of a scene file.
    Group(usize),
    /// A field of what a run shows.
    Output(&'static str),
    /// A field of a probe, or the whole probe.
    Probe(usize, Option<&'static str>),
}

impl Path {
    /// The node, spring, load and so on that a field is of; of a field of none, itself.
    pub fn element(self) -> Self {
        match self {
            Self::Node(index, _) => Self::Node(index, None),
            Self::Spring(index, _) => Self::Spring(index, None),
            Self::Load(index, _) => Self::Load(index, None),
            Self::Motion(index, _) => Self::Motion(index, None),
            Self::Material(index, _) => Self::Material(index, None),
            Self::Probe(index, _) => Self::Probe(index, None),
            Self::Scene(_)
            | Self::Simulation(_)
            | Self::Damping(_)
            | Self::Law(_)
            | Self::Output(_)
            | Self::Group(_) => self,
        }
    }
}

impl fmt::Display for Path {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (list, index, field) = match *self {
            Self::Scene(field) => return f.write_str(field),
            Self::Simulation(field) => return write!(f, "simulation.{field}"),
            Self::Damping(field) => return write!(f, "damping.{field}"),
            Self::Node(index, field) => ("nodes", index, field),
            Self::Spring(index, field) => ("springs", index, field),
            Self::Load(index, field) => ("loads", index, field),
            Self::Motion(index, field) => ("motions", index, field),
            Self::Law(index) => ("laws", index, None),
            Self::Material(index, field) => ("materials", index, field),
            Self::Group(index) => ("groups", index, None),
            Self::Output(field) => return write!(f, "output.{field}"),
            Self::Probe(index, field) => ("output.probes", index, field),
        };
        write!(f, "{list}[{index}]")?;
        field.map_or(Ok(()), |field| write!(f, ".{field}"))
    }
}

/// "the stiffness of spring 3 ".
pub(crate) fn subject(path: &Path) -> String {
    match *path {
        Path::Scene(field) => format!("{field} "),
        Path::Simulation(field) => format!("the simulation's {field} "),
        Path::Damping(field) => format!("the {field} part of the damping "),
        Path::Node(index, field) => of("node", index, field),
        Path::Spring(index, field) => of("spring", index, field),
        Path::Load(index, field) => of("load", index, field),
        Path::Motion(index, field) => of("motion", index, field),
        Path::Law(index) => of("law", index, None),
        Path::Material(index, field) => of("material", index, field),
        Path::Group(index) => of("group", index, None),
        Path::Output(field) => format!("the output's {field} "),
        Path::Probe(index, Some("every")) => format!("the time between looks of probe {index} "),
        Path::Probe(index, field) => of("probe", index, field),
    }
}

fn of(what: &str, index: usize, field: Option<&str>) -> String {
    match field {
        Some(field) => format!("the {} of {what} {index} ", field.replace('_', " ")),
        None => format!("{what} {index} "),
    }
}
