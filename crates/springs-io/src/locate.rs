//! Where in a RON text a field stands.
//!
//! Problems that are found after reading, in the scene itself, know their path
//! (`springs[3].stiffness`) but not their line. RON keeps no positions, so the
//! text, which has been read without error, is walked once more.

use springs_scene::{Path, printable};

/// A line and a column, both from 1; the column counts characters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Place {
    pub(crate) line: usize,
    pub(crate) column: usize,
}

/// Place of the value at `path`, or of what encloses it if it is left out.
pub(crate) fn locate(text: &str, path: Path) -> Place {
    let mut walker = Walker::at_value(text, 0);
    let field = |name| Some(Step::Field(name));
    let steps = match path {
        Path::Scene(name) => [field(name), None, None],
        Path::Simulation(name) => [field("simulation"), field(name), None],
        Path::Damping(name) => [field("damping"), field(name), None],
        Path::Output(name) => [field("output"), field(name), None],
        Path::Probe(index, name) => {
            let probes = walker.enter(Step::Field("output"));
            let list = probes.then_some(Step::Field("probes"));
            [list, Some(Step::Index(index)), name.map(Step::Field)]
        }
        Path::Node(index, name) => [
            field("nodes"),
            Some(Step::Index(index)),
            name.map(Step::Field),
        ],
        Path::Spring(index, name) => [
            field("springs"),
            Some(Step::Index(index)),
            name.map(Step::Field),
        ],
        Path::Motion(index, name) => [
            field("motions"),
            Some(Step::Index(index)),
            name.map(Step::Field),
        ],
        // Scene files say where it is in their own words.
        Path::Law(index) => [field("laws"), Some(Step::Index(index)), None],
        Path::Material(index, name) => [
            field("materials"),
            Some(Step::Index(index)),
            name.map(Step::Field),
        ],
        Path::Group(index) => [field("groups"), Some(Step::Index(index)), None],
        Path::Load(index, name) => [
            field("loads"),
            Some(Step::Index(index)),
            name.map(Step::Field),
        ],
    };
    for step in steps.into_iter().flatten() {
        let enclosing = walker.at;
        if !walker.enter(step) {
            walker.at = enclosing;
            break;
        }
    }
    place_of(text, walker.at)
}

/// How `path` is written: with names where the text has them in place of indices.
pub(crate) fn path_in_words(text: &str, path: Path) -> String {
    let (list, index, field) = match path {
        Path::Motion(index, field) => ("motions", index, field),
        Path::Material(index, field) => ("materials", index, field),
        Path::Group(index) => ("groups", index, None),
        path => return path.to_string(),
    };
    let mut walker = Walker::at_value(text, 0);
    let is_named = walker.enter(Step::Field(list))
        && walker.enter(Step::Index(index))
        && walker.rest().starts_with('"');
    if !is_named {
        return path.to_string();
    }
    let start = walker.at;
    walker.skip_string();
    let name = printable(text[start..walker.at].trim_matches('"'));
    match field {
        Some(field) => format!("{list}.{name}.{field}"),
        None => format!("{list}.{name}"),
    }
}

/// Place of an offset in bytes.
pub(crate) fn place_of(text: &str, offset: usize) -> Place {
    let before = &text[..offset];
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    Place {
        line: before.matches('\n').count() + 1,
        column: before[line_start..].chars().count() + 1,
    }
}

#[derive(Clone, Copy)]
enum Step<'a> {
    Field(&'a str),
    Index(usize),
}

/// Goes through the text of a scene file.
pub(crate) struct Walker<'a> {
    text: &'a str,
    /// Offset in bytes.
    pub(crate) at: usize,
}

impl<'a> Walker<'a> {
    /// At the first value from an offset on.
    pub(crate) fn at_value(text: &'a str, offset: usize) -> Self {
        let mut walker = Self { text, at: offset };
        walker.skip_to_value();
        walker
    }

    pub(crate) fn rest(&self) -> &str {
        &self.text[self.at..]
    }

    pub(crate) fn skip_while(&mut self, wanted: impl Fn(char) -> bool) {
        let rest = self.rest();
        self.at += rest.find(|c| !wanted(c)).unwrap_or(rest.len());
    }

    /// Past white space, comments and `#![…]` attributes.
    pub(crate) fn skip_to_value(&mut self) {
        loop {
            let start = self.at;
            self.skip_while(char::is_whitespace);
            self.skip_comment();
            if self.rest().starts_with("#!") {
                self.skip_while(|c| c != ']');
                self.skip_while(|c| c == ']');
            }
            if self.at == start {
                return;
            }
        }
    }

    fn skip_comment(&mut self) {
        if self.rest().starts_with("//") {
            self.skip_while(|c| c != '\n');
        } else if self.rest().starts_with("/*") {
            let mut depth = 0;
            while !self.rest().is_empty() {
                if self.rest().starts_with("/*") {
                    depth += 1;
                    self.at += 2;
                } else if self.rest().starts_with("*/") {
                    depth -= 1;
                    self.at += 2;
                    if depth == 0 {
                        return;
                    }
                } else {
                    self.skip_character();
                }
            }
        }
    }

    pub(crate) fn skip_character(&mut self) {
        self.at += self.rest().chars().next().map_or(0, char::len_utf8);
    }

    /// From the start of a struct or list to the value of one of its entries.
    fn enter(&mut self, step: Step<'_>) -> bool {
        // From a name in quotes to what it stands for.
        if self.rest().starts_with('"') {
            self.skip_string();
            self.skip_to_value();
            self.skip_while(|c| c == ':');
            self.skip_to_value();
        }
        self.skip_while(|c| c.is_alphanumeric() || c == '_');
        self.skip_to_value();
        if !self.rest().starts_with(['(', '[', '{']) {
            return false;
        }
        self.at += 1;
        for index in 0.. {
            self.skip_to_value();
            if self.rest().is_empty() || self.rest().starts_with([')', ']', '}']) {
                return false;
            }
            let found = match step {
                Step::Index(wanted) => index == wanted,
                Step::Field(wanted) => {
                    let name = self.at;
                    self.skip_while(|c| c.is_alphanumeric() || c == '_');
                    let found = &self.text[name..self.at] == wanted;
                    self.skip_to_value();
                    self.skip_while(|c| c == ':');
                    self.skip_to_value();
                    found
                }
            };
            if found {
                return true;
            }
            self.skip_value();
            self.skip_while(|c| c == ',');
        }
        false
    }

    /// To the comma or bracket that ends a value.
    fn skip_value(&mut self) {
        let mut depth = 0;
        loop {
            self.skip_to_value();
            let rest = self.rest();
            match rest.chars().next() {
                None => return,
                Some(',') if depth == 0 => return,
                Some(')' | ']' | '}') if depth == 0 => return,
                Some('(' | '[' | '{') => depth += 1,
                Some(')' | ']' | '}') => depth -= 1,
                Some('"') => {
                    self.skip_string();
                    continue;
                }
                Some('r') if self.starts_raw_string() => {
                    self.skip_raw_string();
                    continue;
                }
                Some(_) => {}
            }
            self.skip_character();
        }
    }

    pub(crate) fn skip_string(&mut self) {
        self.at += 1;
        loop {
            self.skip_while(|c| c != '"' && c != '\\');
            let escaped = self.rest().starts_with('\\');
            self.skip_character();
            if !escaped {
                return;
            }
            self.skip_character();
        }
    }

    pub(crate) fn starts_raw_string(&self) -> bool {
        let quoted = self.rest().strip_prefix('r');
        quoted.is_some_and(|quoted| quoted.trim_start_matches('#').starts_with('"'))
    }

    pub(crate) fn skip_raw_string(&mut self) {
        let hashes = self.rest()[1..].chars().take_while(|&c| c == '#').count();
        let end = format!("\"{}", "#".repeat(hashes));
        self.at += 2 + hashes;
        let rest = self.rest();
        self.at += rest
            .find(&end)
            .map_or(rest.len(), |found| found + end.len());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r##"#![enable(implicit_some)]
/* nested /* comment, with ( */ */
Scene(
    name: "tricky \" ), [", // nodes: [
    nodes: [(position: (0, 0, 0)), (position: [1, 2, 3],
        mass: 4)],
    other: r#"raw ", ( "#,
    springs: ((nodes: (0, 1), stiffness: 5, /* µ */ mass: 1)),
)"##;

    fn at(path: Path) -> (usize, usize) {
        let place = locate(TEXT, path);
        (place.line, place.column)
    }

    #[test]
    fn fields_are_found() {
        assert_eq!(at(Path::Scene("name")), (4, 11));
        assert_eq!(at(Path::Node(1, Some("position"))), (5, 47));
        assert_eq!(at(Path::Node(1, Some("mass"))), (6, 15));
        assert_eq!(at(Path::Spring(0, Some("stiffness"))), (8, 42));
        assert_eq!(at(Path::Spring(0, Some("mass"))), (8, 59));
    }

    #[test]
    fn left_out_fields_are_placed_at_what_encloses_them() {
        assert_eq!(at(Path::Node(0, Some("mass"))), (5, 13));
        assert_eq!(at(Path::Node(7, None)), (5, 12));
        assert_eq!(at(Path::Simulation("step")), (3, 1));
    }

    #[test]
    fn named_entries_are_entered() {
        let text = "Scene(materials: {\"a \\\"(\": (EA: 1), \"b\": (E: 2, area: 3)})";
        let at = |path| locate(text, path).column;
        assert_eq!(at(Path::Material(0, Some("EA"))), 33);
        assert_eq!(at(Path::Material(1, Some("area"))), 55);
        assert_eq!(at(Path::Material(1, None)), 37);
        assert_eq!(at(Path::Material(1, Some("law"))), 37);
    }
}
