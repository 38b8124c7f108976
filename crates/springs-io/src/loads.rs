//! Loads in scene files, read and written, and the groups of nodes that they act on.

use crate::csv_rows::read_rows;
use crate::motions::vector;
use crate::read::{Findings, find_named};
use crate::scene_file::{List, NodeIndex, NodesEntry, Real, Tuple};
use crate::springs::masses_of;
use crate::write::{number, pairs, quoted, tuple};
use serde::Deserialize;
use springs_scene::{Load, OverTime, Path as ScenePath, Scene, out_of_order, printable};
use std::collections::BTreeMap;

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename = "Load")]
pub(crate) struct LoadEntry {
    /// For people; that of the group, if it is left out.
    pub(crate) name: Option<String>,
    pub(crate) nodes: NodesEntry,
    pub(crate) force: Tuple<3, Real>,
    #[serde(default)]
    pub(crate) over_time: OverTimeEntry,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename = "Field")]
pub(crate) struct FieldEntry {
    pub(crate) acceleration: Tuple<3, Real>,
    #[serde(default)]
    pub(crate) over_time: OverTimeEntry,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, rename = "OverTime")]
pub(crate) enum OverTimeEntry {
    #[default]
    Constant,
    Ramp {
        from: Real,
        to: Real,
    },
    Sine {
        frequency: Real,
        #[serde(default)]
        phase: Real,
    },
    Table(List<Tuple<2, Real>>),
    /// Rows of time, factor in a file beside the scene.
    Csv(String),
}

/// Groups of nodes by their names.
pub(crate) struct Groups(Vec<(String, Vec<usize>)>);

impl Groups {
    /// Adds nodes that are not there to `findings`.
    pub(crate) fn new(
        entries: Vec<(String, List<NodeIndex>)>,
        n_nodes: usize,
        findings: &mut Findings<'_>,
    ) -> Self {
        let mut groups = Vec::with_capacity(entries.len());
        for (index, (name, nodes)) in entries.into_iter().enumerate() {
            let nodes: Vec<usize> = nodes.0.iter().map(|index| index.0).collect();
            if let Some(missing) = nodes.iter().find(|&&node| node >= n_nodes) {
                let name = printable(&name);
                let message = format!(
                    "group `{name}` has node {missing}, but the scene has {n_nodes} of them"
                );
                let advice = Some("nodes are counted from 0");
                findings.push(ScenePath::Group(index), message, advice);
            }
            groups.push((name, nodes));
        }
        Self(groups)
    }

    /// Names and nodes, as they stand in the file.
    pub(crate) fn into_named(self) -> Vec<(String, Vec<usize>)> {
        self.0
    }

    /// The nodes of an entry at that path; none of a group that is not there, which is added
    /// to `findings`.
    pub(crate) fn nodes(
        &self,
        entry: NodesEntry,
        path: ScenePath,
        findings: &mut Findings<'_>,
    ) -> Vec<usize> {
        match entry {
            NodesEntry::Indices(nodes) => nodes,
            NodesEntry::Group(name) => {
                let known = self.0.iter().map(|(name, _)| name.as_str());
                let found = find_named("group", &name, known, path, findings);
                found.map_or(Vec::new(), |group| self.0[group].1.clone())
            }
        }
    }
}

/// The load of this index of a scene file of this name. Adds what is wrong to `findings`.
pub(crate) fn load(
    index: usize,
    entry: LoadEntry,
    groups: &Groups,
    file: &str,
    findings: &mut Findings<'_>,
) -> Load {
    let path = ScenePath::Load(index, Some("nodes"));
    let name = entry.name.unwrap_or_else(|| match &entry.nodes {
        NodesEntry::Indices(_) => String::new(),
        NodesEntry::Group(name) => name.clone(),
    });
    Load {
        name,
        nodes: groups.nodes(entry.nodes, path, findings),
        force: vector(entry.force),
        over_time: over_time(
            entry.over_time,
            ScenePath::Load(index, Some("over_time")),
            file,
            findings,
        ),
    }
}

fn over_time(
    entry: OverTimeEntry,
    path: ScenePath,
    file: &str,
    findings: &mut Findings<'_>,
) -> OverTime {
    match entry {
        OverTimeEntry::Constant => OverTime::Constant,
        OverTimeEntry::Ramp { from, to } => OverTime::Ramp {
            from: from.0,
            to: to.0,
        },
        OverTimeEntry::Sine { frequency, phase } => OverTime::Sine {
            frequency: frequency.0,
            phase: phase.0,
        },
        OverTimeEntry::Table(points) => {
            let points = points.0.iter().map(|point| point.0.map(|real| real.0));
            OverTime::Table(points.collect())
        }
        OverTimeEntry::Csv(name) => {
            let points = read_rows(file, &name).unwrap_or_else(|message| {
                let advice = "it needs rows of time, factor with a comma between them";
                findings.push(path, message, Some(advice));
                vec![[0.0, 0.0]]
            });
            OverTime::Table(points)
        }
    }
}

/// Adds uniform fields as loads: m a on every node that may move, with half the masses of
/// its springs. Adds what is wrong to `findings`.
pub(crate) fn add_fields(
    entries: Vec<FieldEntry>,
    scene: &mut Scene,
    file: &str,
    findings: &mut Findings<'_>,
) {
    let path = ScenePath::Scene("fields");
    if entries.is_empty() {
        return;
    }
    let Some(masses) = masses_of(scene) else {
        return;
    };
    // One load for all nodes of one mass.
    let mut of_mass: BTreeMap<u64, Vec<usize>> = BTreeMap::new();
    for (index, (node, mass)) in scene.nodes.iter().zip(masses).enumerate() {
        if !node.fixed && mass > 0.0 {
            of_mass.entry(mass.to_bits()).or_default().push(index);
        }
    }
    for (index, entry) in entries.into_iter().enumerate() {
        let acceleration = vector(entry.acceleration);
        let over_time = over_time(entry.over_time, path, file, findings);
        if matches!(&over_time, OverTime::Table(points) if points.is_empty()) {
            let message = "the table of a field has no points".to_owned();
            let advice = "give it a point (time, factor), or leave it out";
            findings.push(path, message, Some(advice));
            continue;
        }
        if let Some([before, after]) = out_of_order(&over_time.kinks()) {
            let message = format!(
                "the times of a field are not in order: {before:?} stands before {after:?}"
            );
            findings.push(path, message, Some("each must be after the one before"));
            continue;
        }
        for (mass, nodes) in &of_mass {
            scene.loads.push(Load {
                name: format!("field {index}"),
                nodes: nodes.clone(),
                force: acceleration * f64::from_bits(*mass),
                over_time: over_time.clone(),
            });
        }
    }
}

/// The fields of a load in a scene file.
pub(crate) fn load_text(load: &Load) -> String {
    let nodes: Vec<String> = load.nodes.iter().map(usize::to_string).collect();
    let over_time = match &load.over_time {
        OverTime::Constant => String::new(),
        OverTime::Ramp { from, to } => {
            format!(
                ", over_time: Ramp(from: {}, to: {})",
                number(*from),
                number(*to)
            )
        }
        OverTime::Sine { frequency, phase } => {
            let (frequency, phase) = (number(*frequency), number(*phase));
            format!(", over_time: Sine(frequency: {frequency}, phase: {phase})")
        }
        OverTime::Table(points) => format!(", over_time: Table([{}])", pairs(points)),
    };
    let (nodes, force) = (nodes.join(", "), tuple(&load.force));
    let name = if load.name.is_empty() {
        String::new()
    } else {
        format!("name: {}, ", quoted(&load.name))
    };
    format!("{name}nodes: [{nodes}], force: {force}{over_time}")
}
