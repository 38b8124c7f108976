//! Numbers of a scene that may be set by name.

use super::Subject;
use super::selection::Selection;
use springs_io::Inputs;
use springs_scene::{
    AxialStiffness, NoDampingRatio, PretensionError, Problem, Scene, StepControl, printable,
    rest_length_under,
};
use std::fmt;
use std::str::FromStr;

/// A number of a scene, or one that several of its nodes or springs have, such as
/// `EA`, `materials.wire.damping_ratio`, `springs[3:10].rest_length`, `nodes[2].mass`,
/// `loads` or `duration`. With `*` at its end it is a factor of what the scene has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Setting {
    name: String,
    target: Target,
    is_factor: bool,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Target {
    Springs(Selection, SpringField),
    Nodes(Selection, NodeField),
    Loads(Selection),
    Scene(SceneField),
}

/// Makes an enum of fields with their names and what they are, in the order of errors
/// and documentation.
macro_rules! fields {
    ($type:ident: $($field:ident $name:literal $what:literal,)*) => {
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        enum $type {
            $($field,)*
        }

        impl $type {
            const ALL: &[(Self, &str, &str)] = &[$((Self::$field, $name, $what),)*];

            fn named(name: &str) -> Option<Self> {
                let mut all = Self::ALL.iter();
                all.find(|(_, known, _)| *known == name).map(|(field, ..)| *field)
            }
        }
    };
}

fields! { SpringField:
    Stiffness "stiffness" "K in N/m",
    AxialStiffness "EA" "K l₀ in N",
    RestLength "rest_length" "l₀ in m",
    Prestrain "prestrain" "strain at the positions as given",
    Pretension "pretension" "tension at the positions as given, in N",
    Mass "mass" "in kg",
    MassPerLength "mass_per_length" "in kg/m of l₀",
    Damping "damping" "c in N·s/m",
    DampingRatio "damping_ratio" "c over the critical one",
}

fields! { NodeField:
    Mass "mass" "in kg",
    Drag "drag" "in N·s/m",
}

fields! { SceneField:
    Gravity "gravity" "its magnitude in m/s²",
    Drag "drag" "of every free node, in N·s/m",
    DampingOfMasses "damping.mass" "α in 1/s",
    DampingOfStiffnesses "damping.stiffness" "β in s",
    Step "step" "in s",
    Tolerance "tolerance" "in m",
    Duration "duration" "in s",
}

/// A number cannot be set.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SettingError {
    /// There is no such name.
    #[error("`{name}` cannot be set; {what_can}", what_can = what_can_be_set())]
    Unknown {
        /// The name.
        name: String,
    },
    /// There is no such material, node, spring or load in the scene.
    #[error("`{name}` is nothing in this scene, which has {there}")]
    Nothing {
        /// The name.
        name: String,
        /// What there is.
        there: String,
    },
    /// It is to be multiplied, and has no value.
    #[error("`{name}` has no value in this scene that could be multiplied")]
    NoValue {
        /// The name.
        name: String,
    },
    /// Without a direction gravity has no magnitude.
    #[error("`gravity` has no direction in this scene")]
    NoDirection,
    /// No rest length gives a spring its tension.
    #[error("the pretension of spring {spring} is not possible: {source}")]
    Pretension {
        /// The spring.
        spring: usize,
        /// Why.
        source: PretensionError,
    },
    /// A spring has no damping ratio.
    #[error(transparent)]
    Ratio(NoDampingRatio),
    /// The scene would be wrong.
    #[error(transparent)]
    Problem(Problem),
}

/// All that can be set, in words.
pub fn what_can_be_set() -> String {
    let names = |all: &mut dyn Iterator<Item = &'static str>| all.collect::<Vec<_>>().join(", ");
    format!(
        "of springs {}, as `EA`, `springs.mass`, `springs[3].EA`, `springs[3:10].EA` or \
         `materials.NAME.EA`; of nodes {}, as `nodes.mass` or `nodes[3].mass`; a factor of \
         `loads` or `loads[0]`; {}; with `*` at the end, a factor of what is there",
        names(&mut SpringField::ALL.iter().map(|(_, name, _)| *name)),
        names(&mut NodeField::ALL.iter().map(|(_, name, _)| *name)),
        names(&mut SceneField::ALL.iter().map(|(_, name, _)| *name)),
    )
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)
    }
}

impl FromStr for Setting {
    type Err = SettingError;

    fn from_str(name: &str) -> Result<Self, SettingError> {
        let unknown = || SettingError::Unknown {
            name: printable(name).to_string(),
        };
        let (plain, is_factor) = match name.strip_suffix('*') {
            Some(plain) => (plain, true),
            None => (name, false),
        };
        let target = target(plain).ok_or_else(unknown)?;
        if is_factor && matches!(target, Target::Loads(_)) {
            return Err(unknown());
        }
        Ok(Self {
            name: name.to_owned(),
            target,
            is_factor,
        })
    }
}

fn target(name: &str) -> Option<Target> {
    if let Some(field) = SceneField::named(name) {
        return Some(Target::Scene(field));
    }
    if let Some((selection, field)) = Selection::of_material(name) {
        return Some(Target::Springs(selection, SpringField::named(field)?));
    }
    if let Some((selection, "")) = Selection::of_list(name, "loads") {
        return Some(Target::Loads(selection));
    }
    if let Some((selection, field)) = Selection::of_list(name, "nodes") {
        let field = NodeField::named(field.strip_prefix('.')?)?;
        return Some(Target::Nodes(selection, field));
    }
    if let Some((selection, field)) = Selection::of_list(name, "springs") {
        let field = SpringField::named(field.strip_prefix('.')?)?;
        return Some(Target::Springs(selection, field));
    }
    // Nodes have masses, too.
    let field = SpringField::named(name).filter(|field| *field != SpringField::Mass)?;
    Some(Target::Springs(Selection::All, field))
}

impl Setting {
    /// Gives the numbers of a subject this value.
    ///
    /// Rest lengths stay where stiffnesses change, and damping ratios where anything
    /// else does; masses given by length follow nothing.
    ///
    /// # Errors
    ///
    /// If there is nothing of that name, or the value is not possible.
    pub fn apply(&self, subject: &mut Subject, value: f64) -> Result<(), SettingError> {
        match &self.target {
            Target::Springs(selection, field) => {
                let n = subject.scene.springs.len();
                for spring in self.members(selection, &subject.inputs, n, "springs")? {
                    self.set_spring(subject, spring, *field, value)?;
                }
            }
            Target::Nodes(selection, field) => {
                let n = subject.scene.nodes.len();
                for index in self.members(selection, &subject.inputs, n, "nodes")? {
                    let everywhere = subject.scene.drag;
                    let node = &mut subject.scene.nodes[index];
                    match field {
                        NodeField::Mass => node.mass = self.applied(value, node.mass),
                        NodeField::Drag => {
                            let drag = node.drag.unwrap_or(everywhere);
                            node.drag = Some(self.applied(value, drag));
                        }
                    }
                }
            }
            Target::Loads(selection) => {
                let n = subject.scene.loads.len();
                for load in self.members(selection, &subject.inputs, n, "loads")? {
                    subject.scene.loads[load].force *= value;
                }
            }
            Target::Scene(field) => self.set_scene(&mut subject.scene, *field, value)?,
        }
        Ok(())
    }

    /// The new value, from the one that is there.
    fn applied(&self, value: f64, now: f64) -> f64 {
        if self.is_factor { value * now } else { value }
    }

    fn members(
        &self,
        selection: &Selection,
        inputs: &Inputs,
        n: usize,
        list: &str,
    ) -> Result<Vec<usize>, SettingError> {
        let members = selection.members(inputs, n, list);
        members.map_err(|there| SettingError::Nothing {
            name: self.name.clone(),
            there,
        })
    }

    fn set_spring(
        &self,
        subject: &mut Subject,
        index: usize,
        field: SpringField,
        value: f64,
    ) -> Result<(), SettingError> {
        let Subject { scene, inputs, .. } = subject;
        let [a, b] = scene.springs[index].nodes;
        let length = scene.nodes[a].distance(&scene.nodes[b]);
        let law = scene.springs[index].law.map(|law| &scene.laws[law]);
        let own = law.and_then(|law| law.own_axial_stiffness());
        let ratio = inputs
            .damping_ratios
            .iter()
            .position(|(spring, _)| *spring == index);
        let spring = &mut scene.springs[index];
        match field {
            SpringField::Stiffness => spring.stiffness = self.applied(value, spring.stiffness),
            SpringField::AxialStiffness => {
                let now = spring.stiffness * spring.rest_length;
                spring.stiffness = self.applied(value, now) / spring.rest_length;
            }
            SpringField::RestLength => spring.rest_length = self.applied(value, spring.rest_length),
            SpringField::Prestrain => {
                let strain = self.applied(value, length / spring.rest_length - 1.0);
                spring.rest_length = length / (1.0 + strain);
            }
            SpringField::Pretension if self.is_factor => return Err(self.no_value()),
            SpringField::Pretension => {
                let axial = AxialStiffness::OfSpring(spring.stiffness);
                let found = rest_length_under(value, length, axial, law);
                spring.rest_length = found.map_err(|source| SettingError::Pretension {
                    spring: index,
                    source,
                })?;
            }
            SpringField::Mass => spring.mass = self.applied(value, spring.mass),
            SpringField::MassPerLength => {
                let now = spring.mass / spring.rest_length;
                spring.mass = self.applied(value, now) * spring.rest_length;
            }
            SpringField::Damping => {
                spring.damping = self.applied(value, spring.damping);
                inputs.damping_ratios.retain(|(spring, _)| *spring != index);
            }
            SpringField::DampingRatio => match ratio {
                Some(place) => {
                    let ratio = &mut inputs.damping_ratios[place].1;
                    *ratio = self.applied(value, *ratio);
                }
                None if self.is_factor => return Err(self.no_value()),
                None => inputs.damping_ratios.push((index, value)),
            },
        }
        let is_length = matches!(
            field,
            SpringField::RestLength | SpringField::Prestrain | SpringField::Pretension
        );
        if let Some(own) = own.filter(|_| is_length) {
            // The stiffness follows where the law gives tensions by strain.
            spring.stiffness = own / spring.rest_length;
        }
        Ok(())
    }

    fn no_value(&self) -> SettingError {
        SettingError::NoValue {
            name: self.name.clone(),
        }
    }

    fn set_scene(
        &self,
        scene: &mut Scene,
        field: SceneField,
        value: f64,
    ) -> Result<(), SettingError> {
        let settings = &mut scene.settings;
        let control = match (field, settings.step) {
            (SceneField::Step, StepControl::Fixed(step)) => Some(step),
            (SceneField::Tolerance, StepControl::Tolerance(tolerance)) => Some(tolerance),
            _ => None,
        };
        let controlled = match control {
            Some(now) => Ok(self.applied(value, now)),
            None if self.is_factor => Err(self.no_value()),
            None => Ok(value),
        };
        match field {
            SceneField::Gravity => {
                let now = scene.gravity.norm();
                if now == 0.0 {
                    return Err(SettingError::NoDirection);
                }
                scene.gravity *= self.applied(value, now) / now;
            }
            SceneField::Drag => scene.drag = self.applied(value, scene.drag),
            SceneField::DampingOfMasses => {
                scene.damping.mass = self.applied(value, scene.damping.mass);
            }
            SceneField::DampingOfStiffnesses => {
                scene.damping.stiffness = self.applied(value, scene.damping.stiffness);
            }
            SceneField::Step => settings.step = StepControl::Fixed(controlled?),
            SceneField::Tolerance => settings.step = StepControl::Tolerance(controlled?),
            SceneField::Duration => settings.duration = self.applied(value, settings.duration),
        }
        Ok(())
    }
}

impl Subject {
    /// Sets numbers one after the other, and then dampings from their ratios.
    ///
    /// # Errors
    ///
    /// If one cannot be set, or the scene would be wrong.
    pub fn with(&self, settings: &[Setting], values: &[f64]) -> Result<Self, SettingError> {
        let mut subject = self.clone();
        for (setting, &value) in settings.iter().zip(values) {
            setting.apply(&mut subject, value)?;
        }
        subject.damp()?;
        match subject.scene.problems().into_iter().next() {
            Some(problem) => Err(SettingError::Problem(problem)),
            None => Ok(subject),
        }
    }

    /// Turns damping ratios into dampings.
    fn damp(&mut self) -> Result<(), SettingError> {
        let masses = self.scene.node_masses();
        for &(spring, ratio) in &self.inputs.damping_ratios {
            let damping = self.scene.damping_of_ratio(spring, ratio, &masses);
            self.scene.springs[spring].damping = damping.map_err(SettingError::Ratio)?;
        }
        Ok(())
    }
}
