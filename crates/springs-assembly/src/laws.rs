//! From the laws of a scene to those that are computed with.

use crate::{CompileError, SpringBetween, Springs};
use springs_math::dashpot::Fading;
use springs_math::law::{
    Bilinear, Breaking, CompressionOnly, Law, Limit, Plastic, Point, Polynomial, Power,
    StrainLimit, Table, TableError, TensionOnly,
};
use springs_math::spring::{self, LengthLaw};
use springs_scene::{BreakLimit, Scene, Spring, SpringLaw};

/// The springs of a scene that have a law beside the linear one, and cannot break. None
/// of them are merged.
pub(crate) fn springs_with_laws(scene: &Scene) -> Result<Springs<Law>, CompileError> {
    let has_law = |spring: &Spring| spring.law.is_some() && !spring.is_breakable();
    springs_where(scene, "springs with laws", has_law, |_, law| law)
}

/// The springs of a scene that can break or have broken. None of them are merged.
pub(crate) fn springs_that_break(scene: &Scene) -> Result<Springs<Breaking<Law>>, CompileError> {
    let with_limit = |spring: &Spring, law| Breaking {
        law,
        limit: spring.breaks_at.map(|limit| match limit {
            BreakLimit::Strain(strain) => Limit::Strain(strain),
            BreakLimit::Force(force) => Limit::Tension(force),
        }),
        is_broken: spring.broken,
    };
    let name = "springs that can break";
    springs_where(scene, name, Spring::is_breakable, with_limit)
}

/// Some springs of a scene with what their laws are made into.
fn springs_where<L: LengthLaw + Clone>(
    scene: &Scene,
    name: &str,
    is_one: impl Fn(&Spring) -> bool,
    make: impl Fn(&Spring, Law) -> L,
) -> Result<Springs<L>, CompileError> {
    let mut tables: Vec<Option<Table>> = vec![None; scene.laws.len()];
    let (mut index, mut springs) = (Vec::new(), Vec::new());
    let all = scene.springs.iter().enumerate();
    for (place, spring) in all.filter(|(_, spring)| is_one(spring)) {
        let law = match spring.law {
            None => Ok(Law::Linear(spring::Spring {
                stiffness: spring.stiffness,
                rest_length: spring.rest_length,
            })),
            Some(law) => law_of(spring, &scene.laws[law], &mut tables[law]),
        };
        let law = law.map_err(|source| CompileError::Law {
            spring: place,
            source,
        })?;
        index.push(place);
        springs.push(SpringBetween {
            nodes: spring.nodes,
            law: make(spring, law),
        });
    }
    Ok(Springs::with_index(name, &springs, index))
}

/// The law of a spring; tables of one law share their curve, which is kept in `table`.
fn law_of(spring: &Spring, law: &SpringLaw, table: &mut Option<Table>) -> Result<Law, TableError> {
    let Spring {
        stiffness,
        rest_length,
        ..
    } = *spring;
    Ok(match *law {
        SpringLaw::TensionOnly { blend } => Law::TensionOnly(TensionOnly {
            stiffness,
            rest_length,
            blend,
        }),
        SpringLaw::CompressionOnly { blend } => Law::CompressionOnly(CompressionOnly {
            stiffness,
            rest_length,
            blend,
        }),
        SpringLaw::Bilinear { compression, blend } => Law::Bilinear(Bilinear {
            stiffness,
            compression,
            rest_length,
            blend,
        }),
        SpringLaw::Limit {
            strain,
            stiffness: more,
            blend,
        } => Law::StrainLimit(StrainLimit {
            spring: spring::Spring {
                stiffness,
                rest_length,
            },
            strain,
            stiffness: more,
            blend,
        }),
        SpringLaw::Plastic {
            yields_at,
            hardening,
        } => Law::Plastic(Plastic {
            stiffness,
            rest_length,
            yields_at,
            hardening,
            elongation: spring.yielded,
        }),
        SpringLaw::Power { exponent } => Law::Power(Power {
            stiffness,
            exponent,
            rest_length,
        }),
        SpringLaw::Polynomial(ref coefficients) => Law::Polynomial(Polynomial {
            coefficients: coefficients.to_vec(),
            rest_length,
        }),
        SpringLaw::Table(ref points) => {
            let shared = match table {
                Some(shared) => shared,
                None => table.insert(curve(points)?),
            };
            Law::Table(shared.with_rest_length(rest_length)?)
        }
    })
}

fn curve(points: &[[f64; 2]]) -> Result<Table, TableError> {
    let points = points.iter();
    let points = points.map(|&[strain, tension]| Point { strain, tension });
    Table::new(&points.collect::<Vec<_>>(), 1.0)
}

/// Where the dashpot of a spring acts: only where the spring does, if that pulls or
/// pushes only.
pub(crate) fn fading(scene: &Scene, spring: usize) -> Fading {
    let spring = &scene.springs[spring];
    match spring.law.map(|law| &scene.laws[law]) {
        Some(&SpringLaw::TensionOnly { blend }) => Fading::Below {
            length: spring.rest_length,
            width: blend * spring.rest_length,
        },
        Some(&SpringLaw::CompressionOnly { blend }) => Fading::Above {
            length: spring.rest_length,
            width: blend * spring.rest_length,
        },
        _ => Fading::Nowhere,
    }
}
