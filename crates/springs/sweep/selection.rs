//! Some of the springs, nodes or loads of a scene, by name.

use springs_io::Inputs;
use springs_scene::printable;
use std::ops::Range;

/// Some of a list of a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Selection {
    All,
    Range(Range<usize>),
    /// Springs of a material.
    Material(String),
}

impl Selection {
    /// What a name that begins with `list`, and perhaps `[i]` or `[i:j]`, selects and goes on
    /// with.
    pub(super) fn of_list<'n>(name: &'n str, list: &str) -> Option<(Self, &'n str)> {
        let rest = name.strip_prefix(list)?;
        let Some(bracket) = rest.strip_prefix('[') else {
            return Some((Self::All, rest));
        };
        let (range, rest) = bracket.split_once(']')?;
        let range = match range.split_once(':') {
            Some((from, to)) => from.parse().ok()?..to.parse().ok()?,
            None => {
                let index: usize = range.parse().ok()?;
                index..index.checked_add(1)?
            }
        };
        Some((Self::Range(range), rest))
    }

    /// What `materials.NAME.` selects, and what follows it.
    pub(super) fn of_material(name: &str) -> Option<(Self, &str)> {
        let (material, field) = name.strip_prefix("materials.")?.rsplit_once('.')?;
        Some((Self::Material(material.to_owned()), field))
    }

    /// Indices of what is selected of n in a list, at least one.
    ///
    /// # Errors
    ///
    /// What there is instead, if there is nothing of that name.
    pub(super) fn members(
        &self,
        inputs: &Inputs,
        n: usize,
        list: &str,
    ) -> Result<Vec<usize>, String> {
        let members: Vec<usize> = match self {
            Self::All => (0..n).collect(),
            Self::Range(range) if range.end <= n => range.clone().collect(),
            Self::Range(_) => return Err(format!("{n} {list}, counted from 0")),
            Self::Material(name) => {
                let Some(material) = inputs.materials.iter().position(|known| known == name) else {
                    let names = inputs.materials.iter();
                    let names: Vec<String> = names.map(|name| printable(name)).collect();
                    return Err(if names.is_empty() {
                        "no materials".to_owned()
                    } else {
                        format!("the materials {}", names.join(", "))
                    });
                };
                let of_material = inputs.springs.iter();
                let of_material = of_material.filter(|input| input.material == Some(material));
                of_material.map(|input| input.spring).collect()
            }
        };
        if members.is_empty() {
            Err(format!("no {list} there"))
        } else {
            Ok(members)
        }
    }
}
