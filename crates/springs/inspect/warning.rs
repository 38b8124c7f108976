//! What is legal in a scene but probably not meant.

use super::words::name_them;
use serde::Serialize;
use std::fmt;

/// Something that is legal in a scene but probably not meant.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Warning {
    /// What it is, as a sentence with the first nodes or springs that have it.
    pub message: String,
    /// What to do about it, if that is not plain.
    pub suggestion: Option<String>,
    /// The nodes it is about, ascending; the first hundred.
    pub nodes: Vec<usize>,
    /// The springs it is about, ascending; the first hundred.
    pub springs: Vec<usize>,
}

/// Nodes or springs of a warning that are listed.
const MOST_LISTED: usize = 100;

/// The message, and after a semicolon the suggestion.
impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)?;
        match &self.suggestion {
            Some(suggestion) => write!(f, "; {suggestion}"),
            None => Ok(()),
        }
    }
}

/// The list of warnings as it grows.
#[derive(Debug, Default)]
pub(super) struct Warnings(pub(super) Vec<Warning>);

/// One a line.
impl fmt::Display for Warnings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lines: Vec<String> = self.0.iter().map(Warning::to_string).collect();
        f.write_str(&lines.join("\n"))
    }
}

impl Warnings {
    /// Of the scene as a whole.
    pub(super) fn general(&mut self, message: String, suggestion: &str) {
        self.add(message, suggestion, &[], &[]);
    }

    /// Of some nodes, unless there are none; `says` is told what to call them.
    pub(super) fn of_nodes(
        &mut self,
        nodes: &[usize],
        says: impl FnOnce(&str) -> String,
        suggestion: &str,
    ) {
        if !nodes.is_empty() {
            self.add(says(&name_them("node", nodes)), suggestion, nodes, &[]);
        }
    }

    /// Of some springs, unless there are none; `says` is told what to call them.
    pub(super) fn of_springs(
        &mut self,
        springs: &[usize],
        says: impl FnOnce(&str) -> String,
        suggestion: &str,
    ) {
        if !springs.is_empty() {
            self.add(
                says(&name_them("spring", springs)),
                suggestion,
                &[],
                springs,
            );
        }
    }

    /// Of these nodes and springs, which may be none.
    pub(super) fn add(
        &mut self,
        message: String,
        suggestion: &str,
        nodes: &[usize],
        springs: &[usize],
    ) {
        let first = |indices: &[usize]| indices.iter().copied().take(MOST_LISTED).collect();
        self.0.push(Warning {
            message,
            suggestion: Some(suggestion.to_owned()).filter(|text| !text.is_empty()),
            nodes: first(nodes),
            springs: first(springs),
        });
    }
}
