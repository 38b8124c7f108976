//! What is out of proportion in a scene: most often a wrong unit.
//!
//! All but the direction and the number of gravity is compared within the
//! scene, so that scenes in any consistent units are judged alike.

use super::warning::Warnings;
use super::words::rounded;
use springs_scene::{Scene, Spring, Vector3};
use std::ops::RangeInclusive;

/// What the weight of a scene does to the springs that hold it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OwnWeight {
    /// By how much the springs at fixed nodes would be stretched or compressed
    /// if they carried all of it along themselves, over their length.
    pub(super) strain: f64,
    /// The mass stands on the fixed nodes: its centre is above them.
    pub(super) stands: bool,
}

impl OwnWeight {
    /// Of a scene with gravity, and with springs of a length between fixed and
    /// free nodes.
    pub(super) fn of(scene: &Scene) -> Option<Self> {
        let g = scene.gravity.norm();
        let (mut mass, mut moment) = (0.0, Vector3::zeros());
        for (node, with_springs) in scene.nodes.iter().zip(scene.node_masses()) {
            // Springs hang from fixed nodes with all of their mass.
            let m = if node.fixed {
                with_springs - node.mass
            } else {
                with_springs
            };
            mass += m;
            moment += m * node.position;
        }
        let (mut stiffness, mut length, mut n, mut anchors) = (0.0, 0.0, 0.0, Vector3::zeros());
        for spring in &scene.springs {
            let [a, b] = spring.nodes.map(|node| &scene.nodes[node]);
            if a.fixed != b.fixed && spring.stiffness > 0.0 {
                stiffness += spring.stiffness;
                length += natural_length(scene, spring);
                anchors += if a.fixed { a.position } else { b.position };
                n += 1.0;
            }
        }
        let strain = mass * g / stiffness / (length / n);
        let above = (moment / mass - anchors / n).dot(&-scene.gravity) / g;
        let is_known = strain.is_finite() && strain > 0.0;
        is_known.then_some(Self {
            strain,
            stands: above > 0.1 * scene.size(),
        })
    }
}

/// Springs that hang from their anchors may stretch this far, and springs that
/// stand on them be compressed so far, before it is told.
const MOST_STRETCHED: f64 = 0.9;
const MOST_COMPRESSED: f64 = 0.15;
/// Strain by weight that nothing shows any more; in steel it is 4e-7 for each
/// metre of height.
const LEAST_STRAIN: f64 = 1e-9;

/// Adds what is out of proportion.
pub(super) fn list(scene: &Scene, warnings: &mut Warnings) {
    list_far_away(scene, warnings);
    list_long(scene, warnings);
    list_gravity(scene, warnings);
    list_weight(scene, warnings);
    list_odd_one_out(scene, warnings);
    list_dampers(scene, warnings);
    if scene.settings.duration == 0.0 {
        let message = "the duration is 0 s, so no step is made".to_owned();
        warnings.general(message, "give a duration in s");
    }
}

/// Where coordinates are told apart only to this part of the size of the scene,
/// their rounding shows in its motion.
const COARSEST: f64 = 1e-6;

fn list_far_away(scene: &Scene, warnings: &mut Warnings) {
    let largest = scene.nodes.iter().map(|node| node.position.amax());
    let largest = largest.fold(0.0, f64::max);
    let size = scene.size();
    let spacing = largest * f64::EPSILON;
    if size > 0.0 && spacing > COARSEST * size {
        warnings.general(
            format!(
                "coordinates of {} m are told apart to {} m only, and the scene is {} m from \
                 corner to corner",
                rounded(largest),
                rounded(spacing),
                rounded(size)
            ),
            "put the origin near it",
        );
    }
}

/// Gravity of the Earth in m/s², in mm/s² a thousand times that.
const GRAVITY: RangeInclusive<f64> = 9.7..=9.9;
/// With that gravity, springs are seldom so long on the average, in m.
const LONG: f64 = 100.0;

fn list_long(scene: &Scene, warnings: &mut Warnings) {
    let lengths = scene.springs.iter();
    let lengths = lengths.map(|spring| natural_length(scene, spring));
    let mean = lengths.sum::<f64>() / scene.springs.len() as f64;
    if GRAVITY.contains(&scene.gravity.norm()) && mean > LONG {
        warnings.general(
            format!(
                "springs are {} m long on the average, and gravity is in m/s²",
                rounded(mean)
            ),
            "are lengths in mm? they are meant in m",
        );
    }
}

fn list_gravity(scene: &Scene, warnings: &mut Warnings) {
    let g = scene.gravity.norm();
    // In mm/s², where lengths look like metres.
    if GRAVITY.contains(&(1e-3 * g)) && scene.size() < 100.0 {
        warnings.general(
            format!("gravity is {g} m/s², a thousand times that of the Earth"),
            "is it in mm/s²?",
        );
    }
    if scene.gravity.z > 0.9 * g {
        warnings.general(
            "gravity points along +z, which is mostly up".to_owned(),
            &format!("is it meant to be (0, 0, -{g})?"),
        );
    }
}

fn list_weight(scene: &Scene, warnings: &mut Warnings) {
    let Some(OwnWeight { strain, stands }) = OwnWeight::of(scene) else {
        return;
    };
    let (limit, what) = if stands {
        (MOST_COMPRESSED, "compressed")
    } else {
        (MOST_STRETCHED, "stretched")
    };
    if strain > limit {
        warnings.general(
            format!(
                "under the weight of the scene the springs at fixed nodes would be {what} by \
                 {} % of their length",
                rounded(100.0 * strain)
            ),
            "is stiffness in N/m (1 N/mm is 1000 N/m), mass in kg, gravity in m/s²?",
        );
    }
    if strain < LEAST_STRAIN {
        warnings.general(
            format!(
                "the weight of the scene changes the length of the springs at fixed nodes by \
                 {strain:.0e} of it only"
            ),
            "is stiffness in N/m, mass in kg?",
        );
    }
}

/// A spring this many times stiffer or softer than all that meet it is told.
const UNLIKE: f64 = 300.0;
/// Neighbours are alike if their stiffnesses are within this factor.
const ALIKE: f64 = 30.0;
/// More of them than this part of all springs are meant to be different.
const FEW: f64 = 0.02;

fn list_odd_one_out(scene: &Scene, warnings: &mut Warnings) {
    // Of springs of one material K·l is the same, whatever their length.
    let stiffness = |spring: &Spring| match natural_length(scene, spring) {
        length if length > 0.0 => spring.stiffness * length,
        _ => spring.stiffness,
    };
    let mut ranges = vec![Extremes::default(); scene.nodes.len()];
    for spring in scene.springs.iter().filter(|spring| spring.stiffness > 0.0) {
        let value = stiffness(spring);
        spring
            .nodes
            .into_iter()
            .for_each(|node| ranges[node].add(value));
    }
    let odd: Vec<(usize, f64)> = scene
        .springs
        .iter()
        .enumerate()
        .filter(|(_, spring)| spring.stiffness > 0.0)
        .filter_map(|(index, spring)| {
            let value = stiffness(spring);
            let [a, b] = spring.nodes.map(|node| ranges[node].without(value));
            let (low, high) = (a.low[0].min(b.low[0]), a.high[0].max(b.high[0]));
            let are_alike = a.n + b.n >= 2 && high <= ALIKE * low;
            let factor = (value / high).max(low / value);
            (are_alike && factor > UNLIKE).then_some((index, value / low))
        })
        .collect();
    let few = (FEW * scene.springs.len() as f64).max(1.0);
    if let Some(&(_, factor)) = odd.first()
        && odd.len() as f64 <= few
    {
        let (times, than) = if factor > 1.0 {
            (factor, "stiffer")
        } else {
            (1.0 / factor, "softer")
        };
        let odd: Vec<usize> = odd.into_iter().map(|(index, _)| index).collect();
        warnings.of_springs(
            &odd,
            |named| {
                format!(
                    "{named}: about {} times {than} for its length than every spring that it \
                     meets",
                    rounded(times)
                )
            },
            "is a unit wrong?",
        );
    }
}

/// The two smallest and largest of some numbers.
#[derive(Clone, Copy)]
struct Extremes {
    n: usize,
    low: [f64; 2],
    high: [f64; 2],
}

impl Default for Extremes {
    fn default() -> Self {
        Self {
            n: 0,
            low: [f64::INFINITY; 2],
            high: [0.0; 2],
        }
    }
}

impl Extremes {
    fn add(&mut self, value: f64) {
        self.n += 1;
        if value < self.low[0] {
            self.low = [value, self.low[0]];
        } else if value < self.low[1] {
            self.low[1] = value;
        }
        if value > self.high[0] {
            self.high = [value, self.high[0]];
        } else if value > self.high[1] {
            self.high[1] = value;
        }
    }

    /// The range of the others, for one of them.
    fn without(mut self, value: f64) -> Self {
        self.n -= 1;
        if value == self.low[0] {
            self.low[0] = self.low[1];
        }
        if value == self.high[0] {
            self.high[0] = self.high[1];
        }
        self
    }
}

/// Beyond this damping ratio a dashpot holds its spring for good.
const MOST_DAMPED: f64 = 1e4;
/// Beyond this one it does if its spring takes longer than the run to relax.
const MUCH_DAMPED: f64 = 100.0;

fn list_dampers(scene: &Scene, warnings: &mut Warnings) {
    let masses = scene.node_masses();
    let ratio =
        |index: usize| scene.springs[index].damping / scene.critical_damping(index, &masses);
    let is_odd = |index: &usize| {
        let spring = &scene.springs[*index];
        let relaxation = spring.damping / spring.stiffness;
        let ratio = ratio(*index);
        ratio.is_finite()
            && (ratio > MOST_DAMPED || ratio > MUCH_DAMPED && relaxation > scene.settings.duration)
    };
    let odd: Vec<usize> = (0..scene.springs.len()).filter(is_odd).collect();
    if let Some(&first) = odd.first() {
        let spring = &scene.springs[first];
        warnings.of_springs(
            &odd,
            |named| {
                format!(
                    "{named}: the dashpot is {} times as strong as what would stop all \
                     vibration, and takes {} s to let its spring relax",
                    rounded(ratio(first)),
                    rounded(spring.damping / spring.stiffness),
                )
            },
            "is damping in N·s/m?",
        );
    }
}

/// The rest length, or where it is zero the distance of the nodes, in m.
fn natural_length(scene: &Scene, spring: &Spring) -> f64 {
    let [a, b] = spring.nodes.map(|node| &scene.nodes[node]);
    if spring.rest_length > 0.0 {
        spring.rest_length
    } else {
        a.distance(b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use springs_scene::generate::{Material, block, chain, cloth};

    fn said(scene: &Scene) -> String {
        let mut warnings = Warnings::default();
        list(scene, &mut warnings);
        warnings.to_string()
    }

    fn generated() -> [Scene; 6] {
        [
            chain(1, Material::of_chain(1)),
            chain(50, Material::of_chain(50)),
            cloth(4, Material::of_cloth()),
            cloth(24, Material::of_cloth()),
            block(3, Material::of_block()),
            block(7, Material::of_block()),
        ]
    }

    /// The same scene with lengths, masses and times in other units.
    fn in_units(scene: &Scene, [length, mass, time]: [f64; 3]) -> Scene {
        let mut scene = scene.clone();
        scene.gravity *= length / (time * time);
        for node in &mut scene.nodes {
            node.position *= length;
            node.velocity *= length / time;
            node.mass *= mass;
        }
        for spring in &mut scene.springs {
            spring.stiffness *= mass / (time * time);
            spring.rest_length *= length;
            spring.mass *= mass;
            spring.damping *= mass / time;
        }
        scene.settings.duration *= time;
        scene
    }

    #[test]
    fn sound_scenes_raise_no_alarm_in_any_units() {
        for scene in generated() {
            // m, kg, s; mm, mg, ms; km, t, s; km, t, min.
            for units in [
                [1.0, 1.0, 1.0],
                [1e3, 1e6, 1e3],
                [1e-3, 1e-3, 1.0],
                [1e-3, 1e-3, 1.0 / 60.0],
            ] {
                assert_eq!(said(&in_units(&scene, units)), "", "{}", scene.name);
            }
        }
    }

    #[test]
    fn a_scene_that_is_lost_in_its_coordinates_is_noticed() {
        for mut scene in generated() {
            let mut moved_by = |distance: f64| {
                scene
                    .nodes
                    .iter_mut()
                    .for_each(|n| n.position.y += distance);
                said(&scene)
            };
            assert_eq!(moved_by(1e6), "");
            assert!(moved_by(1e11).contains("are told apart to"));
        }
    }

    fn every_spring(scene: &mut Scene, change: fn(&mut Spring)) {
        scene.springs.iter_mut().for_each(change);
    }

    #[test]
    fn wrong_units_are_noticed() {
        let noticed = |change: fn(&mut Scene), part: &str| {
            for mut scene in generated() {
                change(&mut scene);
                let said = said(&scene);
                assert!(said.contains(part), "{}: {part} in\n{said}", scene.name);
            }
        };
        noticed(
            |scene| every_spring(scene, |spring| spring.stiffness /= 1e3),
            "is stiffness in N/m (1 N/mm",
        );
        noticed(
            |scene| every_spring(scene, |spring| spring.mass *= 1e3),
            "mass in kg",
        );
        noticed(
            |scene| every_spring(scene, |spring| spring.stiffness *= 1e8),
            "is stiffness in N/m, mass",
        );
        noticed(|scene| scene.gravity *= 1e3, "is it in mm/s²?");
        noticed(|scene| scene.gravity *= -1.0, "meant to be (0, 0, -9.81)?");
        noticed(|scene| scene.settings.duration = 0.0, "no step is made");
    }

    #[test]
    fn a_spring_unlike_its_neighbours_is_named() {
        for (factor, than) in [(1e-3, "softer"), (1e3, "stiffer")] {
            for index in [0, 20, 60, 100] {
                let mut scene = cloth(8, Material::of_cloth());
                scene.springs[index].stiffness *= factor;
                let said = said(&scene);
                let name = format!("spring {index}: about");
                assert!(said.contains(&name) && said.contains(than), "{said}");
            }
        }
        // Two materials side by side are meant.
        let mut scene = chain(20, Material::of_chain(20));
        scene.springs[10..]
            .iter_mut()
            .for_each(|spring| spring.stiffness *= 1e3);
        assert_eq!(said(&scene), "");
    }

    #[test]
    fn a_dashpot_that_holds_its_spring_is_named() {
        let mut scene = chain(5, Material::of_chain(5));
        every_spring(&mut scene, |spring| spring.damping = 1.0);
        assert_eq!(said(&scene), "");
        scene.springs[2].damping = 1e9;
        assert!(said(&scene).starts_with("spring 2: the dashpot is"));
    }
}
