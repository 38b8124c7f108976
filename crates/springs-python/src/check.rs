//! What is in a scene, what a run leaves out, what looks wrong.

use pyo3::prelude::*;
use springs::inspect::{count, skipped, suspicious};
use springs::io::Inputs;
use springs::materials;
use springs::scene::Scene;
use springs::step::Islands;

/// What a scene holds, what a run of it leaves out without changing the result, and
/// what is legal but probably not meant; to be printed.
#[pyclass(module = "springs", name = "Check", frozen)]
pub(crate) struct PyCheck {
    about: Vec<String>,
    /// What is left out: (what, what that saves, when that is exact).
    #[pyo3(get)]
    skipped: Vec<(String, String, String)>,
    /// What looks wrong, as sentences.
    #[pyo3(get)]
    suspicious: Vec<String>,
}

impl PyCheck {
    pub(crate) fn of(scene: &Scene, inputs: &Inputs, islands: &Islands) -> Self {
        let number = |number: f64| format!("{number:.4e}");
        let fixed = scene.nodes.iter().filter(|node| node.fixed).count();
        let springs = count(scene.springs.len(), "spring");
        let nodes = count(scene.nodes.len(), "node");
        let mut about = vec![format!(
            "{nodes}: {} free, {fixed} fixed; {springs}",
            islands.n_free()
        )];
        about.extend(materials::ranges(scene, inputs, number));
        let choice = islands.largest().simulation().choice();
        let reason = match choice.reason.as_str() {
            "" => String::new(),
            reason => format!(", because {reason}"),
        };
        about.push(format!("method: {}{reason}", choice.method));
        let skipped = skipped(scene, islands).into_iter();
        let mut suspicious = suspicious(scene, islands);
        suspicious.extend(materials::suspicious(scene, inputs));
        Self {
            about,
            skipped: skipped
                .map(|saving| (saving.what, saving.saves, saving.exact))
                .collect(),
            suspicious,
        }
    }
}

#[pymethods]
impl PyCheck {
    fn __str__(&self) -> String {
        let mut lines = self.about.clone();
        if !self.skipped.is_empty() {
            lines.push("skipped, without changing the result:".to_owned());
        }
        for (what, saves, exact) in &self.skipped {
            lines.push(format!("  - {what}: saves {saves}"));
            lines.push(format!("    exact {exact}"));
        }
        if self.suspicious.is_empty() {
            lines.push("nothing looks wrong".to_owned());
        } else {
            lines.push("worth a look:".to_owned());
            lines.extend(self.suspicious.iter().map(|line| format!("  - {line}")));
        }
        lines.join("\n")
    }

    fn __repr__(&self) -> String {
        self.__str__()
    }
}
