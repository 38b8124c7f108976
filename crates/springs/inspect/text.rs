//! A check as text.

use super::words::{count, memory, rounded, short, time};
use super::{
    Check, Contents, Forecast, MaterialRanges, Mechanism, Plan, Range, UsualSteps, Vibrations,
};
use springs_scene::printable;
use std::fmt::{self, Display, Formatter};

impl Display for Check {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let name = match self.name.as_str() {
            "" => "scene".to_owned(),
            name => printable(name),
        };
        write!(f, "{name}\n{}", self.contents)?;
        write!(f, "{}", self.vibrations)?;
        write_mechanisms(f, &self.mechanisms)?;
        write!(f, "{}{}", self.plan, self.forecast)?;
        if !self.skipped.is_empty() {
            writeln!(f, "skipped, without changing the result:")?;
        }
        for saving in &self.skipped {
            writeln!(f, "  - {}: saves {}", saving.what, saving.saves)?;
            writeln!(f, "    exact {}", saving.exact)?;
        }
        if self.warnings.is_empty() {
            return writeln!(f, "nothing looks wrong");
        }
        writeln!(f, "worth a look:")?;
        for warning in &self.warnings {
            writeln!(f, "  - {}", warning.message)?;
            if let Some(suggestion) = &warning.suggestion {
                writeln!(f, "    {suggestion}")?;
            }
        }
        Ok(())
    }
}

impl Display for Contents {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.write_nodes(f)?;
        self.write_springs(f)?;
        writeln!(
            f,
            "  {} kg free to move, {} m from corner to corner",
            short(self.free_mass),
            short(self.size)
        )?;
        write_spread(
            f,
            "masses of free nodes",
            "kg",
            "node",
            self.node_masses.as_ref(),
        )?;
        write_spread(f, "stiffnesses", "N/m", "spring", self.stiffnesses.as_ref())?;
        if let Some(ratios) = &self.damping_ratios {
            writeln!(
                f,
                "  damping ratios {ratios}, of each spring with its two nodes alone"
            )?;
        }
        let [x, y, z] = self.gravity;
        writeln!(f, "  gravity ({x}, {y}, {z}) m/s²")?;
        if self.loads > 0 {
            let loads = count(self.loads, "load");
            writeln!(f, "  {loads} on {}", count(self.loaded_nodes, "node"))?;
        }
        if let Some(drags) = &self.drags {
            let nodes = count(drags.count, "free node");
            writeln!(f, "  drag {drags} N·s/m on {nodes}")?;
        }
        if let Some(strain) = self.own_weight_strain {
            writeln!(
                f,
                "  its weight, carried by the springs at fixed nodes, changes their length by {} %",
                short(100.0 * strain)
            )?;
        }
        let blocks = count(self.matrix_blocks, "stored matrix block");
        let parts = match self.parts {
            1 => String::new(),
            n => format!(", in {n} parts that are not coupled"),
        };
        writeln!(f, "  {}, {blocks}{parts}", count(self.unknowns, "unknown"))
    }
}

impl Contents {
    fn write_nodes(&self, f: &mut Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "  {}: {} free, {} fixed, {} of them moving",
            count(self.nodes, "node"),
            self.free_nodes,
            self.fixed_nodes,
            self.moving_nodes
        )?;
        let some = [
            (self.guided_nodes, "may move in part only"),
            (self.massless_nodes, "without mass"),
            (self.loose_nodes, "at no spring"),
        ];
        for (nodes, what) in some.into_iter().filter(|(nodes, _)| *nodes > 0) {
            writeln!(f, "    {} {what}", count(nodes, "free node"))?;
        }
        Ok(())
    }

    fn write_springs(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let springs = count(self.springs, "spring");
        writeln!(f, "  {springs}, {} with damping", self.damped_springs)?;
        for material in &self.materials {
            writeln!(f, "    {material}")?;
        }
        let laws = self.laws.iter();
        let laws = laws.map(|one| format!("{} of {}", one.law, count(one.springs, "spring")));
        let laws: Vec<String> = laws.collect();
        if !laws.is_empty() {
            writeln!(f, "    laws: {}", laws.join(", "))?;
        }
        let some = [
            (self.slack_springs, "slack at the start"),
            (
                self.duplicate_springs,
                "between nodes that another one joins",
            ),
        ];
        for (springs, what) in some.into_iter().filter(|(springs, _)| *springs > 0) {
            writeln!(f, "    {} {what}", count(springs, "spring"))?;
        }
        if self.breakable_springs + self.broken_springs > 0 {
            let can_break = count(self.breakable_springs, "spring");
            let broken = self.broken_springs;
            writeln!(
                f,
                "    {can_break} can break, {broken} broken before the first step"
            )?;
        }
        Ok(())
    }
}

/// "2 springs, material b: K 2 to 3 N/m, …".
impl Display for MaterialRanges {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let name = match &self.material {
            Some(name) => format!("material {}", printable(name)),
            None => "without a material".to_owned(),
        };
        let springs = count(self.springs, "spring");
        write!(
            f,
            "{springs}, {name}: K {} N/m, l₀ {} m, m {} kg, c {} N·s/m",
            self.stiffness, self.rest_length, self.mass, self.damping
        )
    }
}

/// A range, and where its ends are if they differ.
fn write_spread(
    f: &mut Formatter<'_>,
    what: &str,
    unit: &str,
    of: &str,
    range: Option<&Range>,
) -> fmt::Result {
    let Some(range) = range else {
        return Ok(());
    };
    write!(f, "  {what} {range} {unit}")?;
    if range.most > range.least {
        let (least, most) = (range.at_least, range.at_most);
        let factor = rounded(range.most / range.least);
        write!(
            f,
            ", a factor of {factor} between {of} {least} and {of} {most}"
        )?;
    }
    writeln!(f)
}

impl Display for Vibrations {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match (self.highest_bound, self.resolving_step, self.highest_node) {
            (Some(highest), Some(step), Some(node)) => writeln!(
                f,
                "  vibrations at {} Hz at most, by a bound at node {node}; steps of {} s resolve them",
                short(highest),
                short(step)
            )?,
            (_, _, Some(node)) => writeln!(
                f,
                "  vibrations of any frequency: the stiffness at node {node} has no bound"
            )?,
            _ => {}
        }
        let (Some(lowest), Some(part)) = (self.lowest_bound, self.lowest_part) else {
            return writeln!(f, "  nothing is held, so that parts may move as a whole");
        };
        let about = "about the positions as given, in the part of";
        if lowest > 0.0 {
            writeln!(
                f,
                "  the slowest one at {} Hz at most, by Rayleigh's quotient {about} node {part}",
                short(lowest)
            )
        } else if lowest == 0.0 {
            writeln!(
                f,
                "  nothing resists some motion {about} node {part}: there the lowest frequency is 0"
            )
        } else {
            writeln!(
                f,
                "  some motion grows e-fold in {} s, {about} node {part}: pushed springs buckle",
                short(1.0 / (std::f64::consts::TAU * -lowest))
            )
        }
    }
}

/// Parts that are told.
const MOST_PARTS: usize = 3;

fn write_mechanisms(f: &mut Formatter<'_>, mechanisms: &[Mechanism]) -> fmt::Result {
    for one in mechanisms.iter().take(MOST_PARTS) {
        let rigid = match one.rigid_motions {
            0 => String::new(),
            n => format!(", and {} as a rigid body", count(n, "motion")),
        };
        writeln!(
            f,
            "  the part of node {} is a mechanism unless tension holds it: {} change no length\n    \
             (Maxwell's count: {} to move in, less {} of nodes that springs join{rigid})",
            one.first_node,
            count(one.motions, "motion"),
            count(one.directions, "direction"),
            count(one.joined_pairs, "pair"),
        )?;
    }
    if mechanisms.len() > MOST_PARTS {
        writeln!(
            f,
            "  and {} more of that kind",
            count(mechanisms.len() - MOST_PARTS, "part")
        )?;
    }
    Ok(())
}

impl Display for Plan {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        if self.starts_from_equilibrium {
            writeln!(f, "  starts from its equilibrium, which a run finds first")?;
        }
        let tangent = self.tangent.as_ref();
        let tangent = tangent.map_or(String::new(), |tangent| format!(" with {tangent} tangent"));
        let (method, duration) = (&self.method, self.duration);
        if let (Some(steps), Some(step_size), None) = (self.steps, self.step_size, self.tolerance) {
            let (steps, h) = (count(steps as usize, "step"), short(step_size));
            writeln!(f, "  {method}{tangent}: {steps} of {h} s for {duration} s")?;
            if let Some(rest) = self.shortened_last_step {
                writeln!(f, "  the last step is shortened to {} s", short(rest))?;
            }
        }
        if let Some(tolerance) = self.tolerance {
            let error = if self.is_default_tolerance {
                "1e-3 of the size".to_owned()
            } else {
                format!("{} m", short(tolerance))
            };
            writeln!(
                f,
                "  {method}{tangent}: steps for an error of {error} after {duration} s"
            )?;
        }
        if let Some(settled) = self.trials_settle {
            writeln!(f, "  a run makes trial runs first; they settle {settled}")?;
        }
        match &self.reason {
            Some(reason) => writeln!(f, "  because {reason}"),
            None => Ok(()),
        }
    }
}

impl Display for Forecast {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let all = memory(self.bytes);
        match self.solver_bytes {
            0 => writeln!(f, "  takes about {all} of memory")?,
            bytes => writeln!(
                f,
                "  takes about {all} of memory, {} of it for linear solvers",
                memory(bytes)
            )?,
        }
        if let (Some(seconds), Some(step)) = (self.seconds, self.step_seconds) {
            return writeln!(
                f,
                "  takes roughly {} of processor time, {} a step",
                time(seconds),
                time(step)
            );
        }
        if let Some(step) = self.step_seconds {
            writeln!(f, "  a step takes roughly {} of processor time", time(step))?;
        }
        if let Some(usual) = self.usual {
            let UsualSteps {
                steps: [least, most],
                seconds: [short, long],
            } = usual;
            let (least, most) = (rounded(least as f64), rounded(most as f64));
            let (from, to) = (time(short), time(long));
            let other = match self.step_seconds {
                Some(_) => "",
                None => ", less where another method is cheaper",
            };
            writeln!(
                f,
                "  dop853 makes {least} to {most} steps usually, in {from} to {to} of processor time{other}"
            )?;
        } else if let Some(seconds) = self.seconds_if_resolved {
            writeln!(
                f,
                "  takes roughly {} of processor time if steps resolve the fastest vibration, often less",
                time(seconds)
            )?;
        }
        Ok(())
    }
}
