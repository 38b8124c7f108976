//! What a scene file wants to be shown.

use crate::loads::Groups;
use crate::read::Findings;
use crate::scene_file::{OutputEntry, ProbeEntry};
use springs_scene::{Output, Path as ScenePath, Probe, Probed};

/// The output of a scene file. Adds what is wrong to `findings`.
pub(crate) fn output(entry: OutputEntry, groups: &Groups, findings: &mut Findings<'_>) -> Output {
    let probes = entry.probes.0.into_iter().enumerate();
    let probes = probes.filter_map(|(index, entry)| probe(index, entry, groups, findings));
    Output {
        write: entry.write.0.into_iter().map(|name| name.0).collect(),
        frames: entry.frames.map(|intervals| intervals.0),
        probes: probes.collect(),
    }
}

fn probe(
    index: usize,
    entry: ProbeEntry,
    groups: &Groups,
    findings: &mut Findings<'_>,
) -> Option<Probe> {
    let nodes = entry.nodes.map(|nodes| {
        let path = ScenePath::Probe(index, Some("nodes"));
        Probed::Nodes(groups.nodes(nodes, path, findings))
    });
    let springs = entry.springs.map(|springs| {
        let springs = springs.0.iter().map(|index| index.0);
        Probed::Springs(springs.collect())
    });
    let node = entry.node.map(|node| Probed::Nodes(vec![node.0]));
    let spring = entry.spring.map(|spring| Probed::Springs(vec![spring.0]));
    let mut given = [node, nodes, spring, springs].into_iter().flatten();
    let (Some(on), None) = (given.next(), given.next()) else {
        let message = "a probe looks at one of node, nodes, spring and springs".to_owned();
        findings.push(ScenePath::Probe(index, None), message, None);
        return None;
    };
    Some(Probe {
        on,
        of: entry.of.0.iter().map(|quantity| quantity.0).collect(),
        every: entry.every.map(|every| every.0),
    })
}
