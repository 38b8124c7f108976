//! Version 1 of the scene file, field by field.

use crate::loads::{FieldEntry, LoadEntry};
use crate::motions::MotionEntry;
use crate::spring_file::{MaterialEntry, SpringEntry};
use serde::Deserialize;
use serde::de::{self, Deserializer, MapAccess, SeqAccess, Visitor};
use std::fmt;
use std::marker::PhantomData;

/// The version that this crate reads and writes.
pub(crate) const VERSION: u32 = 1;

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename = "Scene")]
pub(crate) struct SceneFile {
    /// Checked while it is read.
    #[serde(rename = "version")]
    _version: Version,
    #[serde(default)]
    pub(crate) name: String,
    #[serde(default)]
    pub(crate) gravity: Tuple<3, Real>,
    pub(crate) nodes: List<NodeEntry>,
    #[serde(default)]
    pub(crate) springs: List<SpringEntry>,
    #[serde(default)]
    pub(crate) materials: ByName<MaterialEntry>,
    #[serde(default)]
    pub(crate) groups: ByName<List<NodeIndex>>,
    #[serde(default)]
    pub(crate) loads: List<LoadEntry>,
    #[serde(default)]
    pub(crate) fields: List<FieldEntry>,
    #[serde(default)]
    pub(crate) motions: ByName<MotionEntry>,
    #[serde(default)]
    pub(crate) drag: Real,
    #[serde(default)]
    pub(crate) damping: DampingEntry,
    #[serde(default)]
    pub(crate) simulation: SimulationEntry,
    #[serde(default)]
    pub(crate) output: OutputEntry,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, rename = "Output")]
pub(crate) struct OutputEntry {
    #[serde(default)]
    pub(crate) write: List<OutputName>,
    pub(crate) frames: Option<Intervals>,
    #[serde(default)]
    pub(crate) probes: List<ProbeEntry>,
}

/// It looks at one of `node`, `nodes`, `spring` and `springs`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename = "Probe")]
pub(crate) struct ProbeEntry {
    pub(crate) node: Option<NodeIndex>,
    pub(crate) nodes: Option<NodesEntry>,
    pub(crate) spring: Option<SpringIndex>,
    pub(crate) springs: Option<List<SpringIndex>>,
    #[serde(default)]
    pub(crate) of: List<Named<springs_scene::ProbeQuantity>>,
    pub(crate) every: Option<Real>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename = "Node")]
pub(crate) struct NodeEntry {
    pub(crate) position: Tuple<3, Real>,
    #[serde(default)]
    pub(crate) velocity: Tuple<3, Real>,
    #[serde(default)]
    pub(crate) mass: Real,
    #[serde(default)]
    pub(crate) fixed: Held,
    pub(crate) slides: Option<Tuple<3, Real>>,
    pub(crate) motion: Option<String>,
    pub(crate) drag: Option<Real>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, rename = "Damping")]
pub(crate) struct DampingEntry {
    #[serde(default)]
    pub(crate) mass: Real,
    #[serde(default)]
    pub(crate) stiffness: Real,
}

/// The axes along which a node is held: `true` for all, or some as in `"yz"`.
#[derive(Clone, Copy, Default)]
pub(crate) struct Held(pub(crate) [bool; 3]);

impl<'de> Deserialize<'de> for Held {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Axes;

        impl Visitor<'_> for Axes {
            type Value = Held;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("true, false or axes such as \"yz\"")
            }

            fn visit_bool<E: de::Error>(self, value: bool) -> Result<Held, E> {
                Ok(Held([value; 3]))
            }

            fn visit_str<E: de::Error>(self, text: &str) -> Result<Held, E> {
                let mut held = [false; 3];
                for letter in text.chars() {
                    match "xyz".find(letter) {
                        Some(axis) if !held[axis] => held[axis] = true,
                        _ => return Err(E::invalid_value(de::Unexpected::Str(text), &self)),
                    }
                }
                if text.is_empty() {
                    Err(E::invalid_value(de::Unexpected::Str(text), &self))
                } else {
                    Ok(Held(held))
                }
            }
        }

        deserializer.deserialize_any(Axes)
    }
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, rename = "Simulation")]
pub(crate) struct SimulationEntry {
    pub(crate) method: Option<Named<springs_scene::Method>>,
    pub(crate) tangent: Option<Named<springs_scene::Tangent>>,
    pub(crate) step: Option<Real>,
    pub(crate) tolerance: Option<Real>,
    pub(crate) duration: Option<Real>,
    pub(crate) start: Option<Named<springs_scene::Start>>,
    #[serde(alias = "solution")]
    pub(crate) linear_tolerance: Option<Named<springs_scene::LinearTolerance>>,
    pub(crate) sleep: Option<Real>,
    #[serde(default, alias = "rescue")]
    pub(crate) substeps: bool,
}

/// A version that this crate can read.
pub(crate) struct Version;

impl<'de> Deserialize<'de> for Version {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match u32::deserialize(deserializer)? {
            VERSION => Ok(Self),
            other => Err(de::Error::custom(format_args!(
                "this program reads scene files of version {VERSION}, not {other}"
            ))),
        }
    }
}

/// A finite number; integers are welcome.
#[derive(Clone, Copy, Default)]
pub(crate) struct Real(pub(crate) f64);

impl<'de> Deserialize<'de> for Real {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match f64::deserialize(deserializer)? {
            value if value.is_finite() => Ok(Self(value)),
            value => Err(de::Error::custom(format_args!(
                "a number must be finite, but this is {value}"
            ))),
        }
    }
}

/// The index of a node.
#[derive(Clone, Copy, Default)]
pub(crate) struct NodeIndex(pub(crate) usize);

impl<'de> Deserialize<'de> for NodeIndex {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let what = "the index of a node: 0, 1, 2, …";
        deserializer.deserialize_any(WholeNumber(what)).map(Self)
    }
}

/// The index of a spring.
#[derive(Clone, Copy, Default)]
pub(crate) struct SpringIndex(pub(crate) usize);

impl<'de> Deserialize<'de> for SpringIndex {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let what = "the index of a spring: 0, 1, 2, …";
        deserializer.deserialize_any(WholeNumber(what)).map(Self)
    }
}

/// Reads a whole number, of which is said what it is and what it looks like.
struct WholeNumber(&'static str);

impl Visitor<'_> for WholeNumber {
    type Value = usize;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0)
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<usize, E> {
        if value >= 0.0 && value.fract() == 0.0 && value < 2f64.powi(53) {
            let (what, _) = self.0.split_once(':').unwrap_or((self.0, ""));
            return Err(E::custom(format_args!(
                "{what} has no decimal point: write {value}"
            )));
        }
        Err(E::invalid_value(de::Unexpected::Float(value), &self))
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<usize, E> {
        usize::try_from(value).map_err(E::custom)
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<usize, E> {
        let index = u64::try_from(value)
            .map_err(|_| E::invalid_value(de::Unexpected::Signed(value), &self))?;
        self.visit_u64(index)
    }
}

/// How many intervals there are between frames.
#[derive(Clone, Copy)]
pub(crate) struct Intervals(pub(crate) u32);

impl<'de> Deserialize<'de> for Intervals {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let what = "the number of intervals between frames: 1, 2, 3, …";
        let number = deserializer.deserialize_any(WholeNumber(what))?;
        u32::try_from(number).map(Self).map_err(de::Error::custom)
    }
}

/// The name of an output, unquoted, in lower case.
pub(crate) struct OutputName(pub(crate) String);

impl<'de> Deserialize<'de> for OutputName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Name;

        impl Visitor<'_> for Name {
            type Value = OutputName;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the name of an output such as Csv")
            }

            fn visit_str<E: de::Error>(self, name: &str) -> Result<OutputName, E> {
                Ok(OutputName(name.to_lowercase()))
            }
        }

        deserializer.deserialize_identifier(Name)
    }
}

/// A method, tangent or the like by its name, unquoted.
pub(crate) struct Named<T>(pub(crate) T);

impl<'de, T> Deserialize<'de> for Named<T>
where
    T: std::str::FromStr<Err = springs_scene::UnknownName>,
{
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Name<T>(PhantomData<T>);

        impl<T> Visitor<'_> for Name<T>
        where
            T: std::str::FromStr<Err = springs_scene::UnknownName>,
        {
            type Value = Named<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a name")
            }

            fn visit_str<E: de::Error>(self, name: &str) -> Result<Named<T>, E> {
                let named = name.parse().map(Named);
                named.map_err(|error: springs_scene::UnknownName| E::custom(error.in_scene_file()))
            }
        }

        deserializer.deserialize_identifier(Name(PhantomData))
    }
}

/// Nodes by their indices or by the name of a group.
pub(crate) enum NodesEntry {
    Indices(Vec<usize>),
    Group(String),
}

impl<'de> Deserialize<'de> for NodesEntry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Nodes;

        impl<'de> Visitor<'de> for Nodes {
            type Value = NodesEntry;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a list of nodes or the name of a group")
            }

            fn visit_str<E: de::Error>(self, name: &str) -> Result<NodesEntry, E> {
                Ok(NodesEntry::Group(name.to_owned()))
            }

            fn visit_unit<E>(self) -> Result<NodesEntry, E> {
                Ok(NodesEntry::Indices(Vec::new()))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<NodesEntry, A::Error> {
                let mut nodes = Vec::new();
                while let Some(NodeIndex(node)) = seq.next_element()? {
                    nodes.push(node);
                }
                Ok(NodesEntry::Indices(nodes))
            }
        }

        deserializer.deserialize_any(Nodes)
    }
}

/// `(a, b, c)` or `[a, b, c]`.
pub(crate) struct Tuple<const N: usize, T>(pub(crate) [T; N]);

impl<const N: usize, T: Copy + Default> Default for Tuple<N, T> {
    fn default() -> Self {
        Self([T::default(); N])
    }
}

impl<'de, const N: usize, T> Deserialize<'de> for Tuple<N, T>
where
    T: Deserialize<'de> + Copy + Default,
{
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Entries<const N: usize, T>(PhantomData<T>);

        impl<'de, const N: usize, T> Visitor<'de> for Entries<N, T>
        where
            T: Deserialize<'de> + Copy + Default,
        {
            type Value = Tuple<N, T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "a list of {N} numbers")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Self::Value, A::Error> {
                let mut entries = [T::default(); N];
                for (index, entry) in entries.iter_mut().enumerate() {
                    *entry = seq
                        .next_element()?
                        .ok_or_else(|| de::Error::invalid_length(index, &self))?;
                }
                if seq.next_element::<de::IgnoredAny>()?.is_some() {
                    return Err(de::Error::invalid_length(N + 1, &self));
                }
                Ok(Tuple(entries))
            }
        }

        deserializer.deserialize_any(Entries::<N, T>(PhantomData))
    }
}

/// `{"name": …, …}` in the order of the file.
pub(crate) struct ByName<T>(pub(crate) Vec<(String, T)>);

impl<T> Default for ByName<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for ByName<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Entries<T>(PhantomData<T>);

        impl<'de, T: Deserialize<'de>> Visitor<'de> for Entries<T> {
            type Value = ByName<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("names and what they stand for, as in {\"name\": …}")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                let mut entries: Vec<(String, T)> = Vec::new();
                while let Some(name) = map.next_key::<String>()? {
                    if entries.iter().any(|(other, _)| *other == name) {
                        return Err(de::Error::custom(format_args!(
                            "the name \"{}\" is there twice",
                            springs_scene::printable(&name)
                        )));
                    }
                    entries.push((name, map.next_value()?));
                }
                Ok(ByName(entries))
            }
        }

        deserializer.deserialize_map(Entries(PhantomData))
    }
}

/// `[a, b, …]` or `(a, b, …)`.
pub(crate) struct List<T>(pub(crate) Vec<T>);

impl<T> Default for List<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for List<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Entries<T>(PhantomData<T>);

        impl<'de, T: Deserialize<'de>> Visitor<'de> for Entries<T> {
            type Value = List<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a list")
            }

            fn visit_unit<E>(self) -> Result<Self::Value, E> {
                Ok(List(Vec::new()))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Self::Value, A::Error> {
                let mut entries = Vec::new();
                while let Some(entry) = seq.next_element()? {
                    entries.push(entry);
                }
                Ok(List(entries))
            }
        }

        deserializer.deserialize_any(Entries(PhantomData))
    }
}
