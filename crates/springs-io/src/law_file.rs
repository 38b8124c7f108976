//! Laws of springs in the scene file, by the table of `springs-scene`.

use crate::scene_file::{List, Real, Tuple};
use serde::de::{self, DeserializeSeed, EnumAccess, MapAccess, VariantAccess, Visitor};
use serde::{Deserialize, Deserializer};
use springs_scene::{LawForm, SpringLaw};
use std::fmt;
use std::sync::LazyLock;

/// A law; `None` is the linear one.
pub(crate) struct LawEntry(pub(crate) Option<SpringLaw>);

const LINEAR: &str = "Linear";

/// In the order in which messages list them.
static NAMES: LazyLock<Vec<&str>> = LazyLock::new(|| {
    let forms = SpringLaw::FORMS.iter().map(|form| form.name);
    let others = [SpringLaw::POLYNOMIAL, SpringLaw::TABLE];
    [LINEAR].into_iter().chain(forms).chain(others).collect()
});

impl<'de> Deserialize<'de> for LawEntry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_enum("Law", &NAMES, Law)
    }
}

struct Law;

impl<'de> Visitor<'de> for Law {
    type Value = LawEntry;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a law")
    }

    fn visit_enum<A: EnumAccess<'de>>(self, data: A) -> Result<LawEntry, A::Error> {
        let (name, numbers) = data.variant_seed(OneOf::Laws)?;
        if let Some(form) = SpringLaw::FORMS.iter().find(|form| form.name == name) {
            let law = numbers.struct_variant(form.field_names, Numbers(form))?;
            return Ok(LawEntry(Some(law)));
        }
        Ok(LawEntry(match name {
            LINEAR => {
                numbers.unit_variant()?;
                None
            }
            SpringLaw::POLYNOMIAL => {
                let List::<Real>(coefficients) = numbers.newtype_variant()?;
                let coefficients = coefficients.iter().map(|real| real.0);
                Some(SpringLaw::Polynomial(coefficients.collect()))
            }
            _ => {
                let List::<Tuple<2, Real>>(points) = numbers.newtype_variant()?;
                let points = points.iter().map(|point| point.0.map(|real| real.0));
                Some(SpringLaw::Table(points.collect()))
            }
        }))
    }
}

/// The numbers of a law, by name.
struct Numbers(&'static LawForm);

impl<'de> Visitor<'de> for Numbers {
    type Value = SpringLaw;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the numbers of `{}`", self.0.name)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<SpringLaw, A::Error> {
        let Self(form) = self;
        let mut given = vec![None; form.fields.len()];
        while let Some(name) = map.next_key_seed(OneOf::NumbersOf(form))? {
            let at = form.field_names.iter().position(|known| *known == name);
            let number = &mut given[at.expect("one of the names")];
            if number.is_some() {
                return Err(de::Error::duplicate_field(name));
            }
            let Real(value) = map.next_value()?;
            *number = Some(value);
        }
        let numbers = form.fields.iter().zip(given).map(|(field, given)| {
            let number = given.or(field.default);
            number.ok_or_else(|| de::Error::missing_field(field.name))
        });
        Ok(form.law(&numbers.collect::<Result<Vec<f64>, A::Error>>()?))
    }
}

/// One of some names.
#[derive(Clone, Copy)]
enum OneOf {
    Laws,
    NumbersOf(&'static LawForm),
}

impl OneOf {
    fn known(self) -> &'static [&'static str] {
        match self {
            Self::Laws => &NAMES,
            Self::NumbersOf(form) => form.field_names,
        }
    }
}

impl<'de> DeserializeSeed<'de> for OneOf {
    type Value = &'static str;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<&'static str, D::Error> {
        deserializer.deserialize_identifier(self)
    }
}

impl Visitor<'_> for OneOf {
    type Value = &'static str;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a name")
    }

    fn visit_str<E: de::Error>(self, name: &str) -> Result<&'static str, E> {
        let known = self.known();
        let found = known.iter().find(|known| **known == name);
        found.copied().ok_or_else(|| match self {
            Self::Laws => E::unknown_variant(name, known),
            Self::NumbersOf(_) => E::unknown_field(name, known),
        })
    }
}
