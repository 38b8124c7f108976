//! From a scene to a scene file.

use crate::atomic::{Draft, WriteError};
use crate::loads::load_text;
use crate::motions::motion_text;
use crate::scene_file::VERSION;
use nalgebra::Vector3;
use springs_scene::{
    BreakLimit, Guide, LinearTolerance, Method, Output, Probe, Rayleigh, RunOptions, Scene,
    SpringLaw, Start, StepControl,
};
use std::fmt::Write as _;
use std::io::{self, Write};
use std::path::Path;

/// The text of a scene file, one node and one spring a line. Reading it gives
/// the same scene and options, bit for bit; threads and skipping are not in files.
///
/// # Panics
///
/// If the scene holds a number that is not finite, which no file can.
pub fn scene_to_string(scene: &Scene, options: &RunOptions) -> String {
    let mut text = Vec::new();
    write_text(scene, options, &mut text).expect("writing to memory");
    String::from_utf8(text).expect("all that is written is text")
}

/// Writes the text piece by piece, so that it never is in memory as a whole.
fn write_text(scene: &Scene, options: &RunOptions, text: &mut dyn Write) -> io::Result<()> {
    writeln!(text, "Scene(\n    version: {VERSION},")?;
    if !scene.name.is_empty() {
        writeln!(text, "    name: {},", quoted(&scene.name))?;
    }
    if !is_left_out(&scene.gravity) {
        writeln!(text, "    gravity: {},", tuple(&scene.gravity))?;
    }
    let nodes = scene.nodes.iter().map(|node| {
        let mut fields = format!("position: {}", tuple(&node.position));
        if !is_left_out(&node.velocity) {
            fields += &format!(", velocity: {}", tuple(&node.velocity));
        }
        push_number(&mut fields, "mass", node.mass);
        if node.fixed {
            fields += ", fixed: true";
        }
        if let Some(drag) = node.drag {
            fields += &format!(", drag: {}", number(drag));
        }
        if let Some(motion) = node.motion.and_then(|motion| scene.motions.get(motion)) {
            fields += &format!(", motion: {}", quoted(&motion.name));
        }
        match node.guide {
            None => {}
            Some(Guide::Held(axes)) => {
                let held = ['x', 'y', 'z'].into_iter().zip(axes);
                let held: String = held.filter_map(|(axis, is)| is.then_some(axis)).collect();
                fields += &format!(", fixed: {held:?}");
            }
            Some(Guide::Along(direction)) => {
                fields += &format!(", slides: {}", tuple(&direction));
            }
        }
        fields
    });
    write_list(text, "nodes", nodes)?;
    if !scene.laws.is_empty() {
        writeln!(text, "    materials: {{")?;
        for (index, law) in scene.laws.iter().enumerate() {
            writeln!(
                text,
                "        {}: (law: {}),",
                material(index),
                law_text(law)
            )?;
        }
        writeln!(text, "    }},")?;
    }
    let springs = scene.springs.iter().map(|spring| {
        let [a, b] = spring.nodes;
        let mut fields = format!("nodes: ({a}, {b}), stiffness: {}", number(spring.stiffness));
        fields += &format!(", rest_length: {}", number(spring.rest_length));
        push_number(&mut fields, "mass", spring.mass);
        push_number(&mut fields, "damping", spring.damping);
        if let Some(law) = spring.law {
            fields += &format!(", material: {}", material(law));
        }
        match spring.breaks_at {
            None => {}
            Some(BreakLimit::Strain(strain)) => {
                fields += &format!(", breaks_at: Strain({})", number(strain));
            }
            Some(BreakLimit::Force(force)) => {
                fields += &format!(", breaks_at: Force({})", number(force));
            }
        }
        push_number(&mut fields, "yielded", spring.yielded);
        if spring.broken {
            fields += ", broken: true";
        }
        fields
    });
    write_list(text, "springs", springs)?;
    if !scene.loads.is_empty() {
        write_list(text, "loads", scene.loads.iter().map(load_text))?;
    }
    if !scene.motions.is_empty() {
        writeln!(text, "    motions: {{")?;
        for motion in &scene.motions {
            let (name, motion) = (quoted(&motion.name), motion_text(&motion.motion));
            writeln!(text, "        {name}: {motion},")?;
        }
        writeln!(text, "    }},")?;
    }
    if scene.drag.to_bits() != 0 {
        writeln!(text, "    drag: {},", number(scene.drag))?;
    }
    let Rayleigh { mass, stiffness } = scene.damping;
    if [mass, stiffness].map(f64::to_bits) != [0, 0] {
        let (mass, stiffness) = (number(mass), number(stiffness));
        writeln!(text, "    damping: (mass: {mass}, stiffness: {stiffness}),")?;
    }
    let settings = &scene.settings;
    let mut fields = String::new();
    if settings.method != Method::Auto {
        fields += &format!("method: {}, ", settings.method.name());
    }
    if let Some(tangent) = settings.tangent {
        fields += &format!("tangent: {}, ", tangent.name());
    }
    if settings.start != Start::AsGiven {
        fields += &format!("start: {}, ", settings.start.name());
    }
    match settings.step {
        StepControl::Auto => {}
        StepControl::Fixed(step) => fields += &format!("step: {}, ", number(step)),
        StepControl::Tolerance(tolerance) => {
            fields += &format!("tolerance: {}, ", number(tolerance));
        }
    }
    fields += &format!("duration: {}", number(settings.duration));
    if options.linear_tolerance != LinearTolerance::Sufficient {
        fields += &format!(", linear_tolerance: {}", options.linear_tolerance.name());
    }
    if let Some(sleep) = options.sleep {
        fields += &format!(", sleep: {}", number(sleep));
    }
    if options.substeps {
        fields += ", substeps: true";
    }
    writeln!(text, "    simulation: ({fields}),")?;
    write_output(&scene.output, text)?;
    writeln!(text, ")")
}

fn write_output(output: &Output, text: &mut dyn Write) -> io::Result<()> {
    if *output == Output::default() {
        return Ok(());
    }
    writeln!(text, "    output: (")?;
    if !output.write.is_empty() {
        let names: Vec<String> = output.write.iter().map(|name| capitalized(name)).collect();
        writeln!(text, "        write: [{}],", names.join(", "))?;
    }
    if let Some(frames) = output.frames {
        writeln!(text, "        frames: {frames},")?;
    }
    if !output.probes.is_empty() {
        writeln!(text, "        probes: [")?;
        for probe in &output.probes {
            writeln!(text, "            ({}),", probe_text(probe))?;
        }
        writeln!(text, "        ],")?;
    }
    writeln!(text, "    ),")
}

fn probe_text(probe: &Probe) -> String {
    let (item, indices) = (probe.on.item(), probe.on.indices());
    let on = match indices {
        [index] => format!("{item}: {index}"),
        _ => {
            let indices: Vec<String> = indices.iter().map(usize::to_string).collect();
            format!("{item}s: [{}]", indices.join(", "))
        }
    };
    let quantities: Vec<&str> = probe.of.iter().map(|quantity| quantity.name()).collect();
    let mut fields = format!("{on}, of: [{}]", quantities.join(", "));
    if let Some(every) = probe.every {
        fields += &format!(", every: {}", number(every));
    }
    fields
}

/// The name of an output as it stands in scene files.
fn capitalized(name: &str) -> String {
    let mut letters = name.chars();
    let first = letters.next().map(|first| first.to_ascii_uppercase());
    first.into_iter().chain(letters).collect()
}

/// Writes [`scene_to_string`] to a file, whole or not at all.
///
/// # Errors
///
/// If the file cannot be written.
pub fn write_scene(path: &Path, scene: &Scene, options: &RunOptions) -> Result<(), WriteError> {
    let mut draft = Draft::begin(path)?;
    draft.write_by(|text| write_text(scene, options, text))?;
    draft.finish()
}

pub(crate) fn quoted(name: &str) -> String {
    ron::to_string(name).expect("a string")
}

/// The name of the material that stands for a law.
fn material(law: usize) -> String {
    format!("\"law {law}\"")
}

fn law_text(law: &SpringLaw) -> String {
    let numbers = match law {
        SpringLaw::Polynomial(coefficients) => {
            let coefficients = coefficients.iter().map(|a| number(*a));
            format!("[{}]", coefficients.collect::<Vec<_>>().join(", "))
        }
        SpringLaw::Table(points) => format!("[{}]", pairs(points)),
        _ => {
            let (form, numbers) = law.numbers().expect("all others have numbers");
            let fields = form.field_names.iter().zip(numbers);
            let fields = fields.map(|(name, value)| format!("{name}: {}", number(value)));
            fields.collect::<Vec<_>>().join(", ")
        }
    };
    format!("{}({numbers})", law.name())
}

/// `(a, b), (c, d)`.
pub(crate) fn pairs(points: &[[f64; 2]]) -> String {
    let point = |[a, b]: &[f64; 2]| format!("({}, {})", number(*a), number(*b));
    let points: Vec<String> = points.iter().map(point).collect();
    points.join(", ")
}

fn write_list(
    text: &mut dyn Write,
    name: &str,
    entries: impl Iterator<Item = String>,
) -> io::Result<()> {
    writeln!(text, "    {name}: [")?;
    for entry in entries {
        writeln!(text, "        ({entry}),")?;
    }
    writeln!(text, "    ],")
}

fn push_number(fields: &mut String, name: &str, value: f64) {
    if value.to_bits() != 0 {
        write!(fields, ", {name}: {}", number(value)).expect("writing to a string");
    }
}

/// Whether every bit is that of the value that stands for a left-out vector.
fn is_left_out(vector: &Vector3<f64>) -> bool {
    vector.iter().all(|component| component.to_bits() == 0)
}

pub(crate) fn tuple(vector: &Vector3<f64>) -> String {
    let [x, y, z] = [vector.x, vector.y, vector.z].map(number);
    format!("({x}, {y}, {z})")
}

/// The shortest text that reads back to the same bits.
pub(crate) fn number(value: f64) -> String {
    assert!(value.is_finite(), "scene files hold finite numbers only");
    format!("{value:?}")
}
