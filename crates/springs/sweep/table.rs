//! The table of results: a line for each run.

use std::fs::OpenOptions;
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::Path;

/// The whole lines of a table.
pub(super) struct Table {
    header: String,
    pub(super) rows: Vec<Row>,
}

/// A line.
pub(super) struct Row {
    pub(super) run: usize,
    line: String,
}

impl Row {
    /// The last field says why.
    pub(super) fn has_failed(&self) -> bool {
        !self.line.ends_with(',')
    }
}

impl Table {
    /// Reads a table. What a program that was killed has not written to its end is no
    /// line.
    pub(super) fn read(path: &Path) -> io::Result<Self> {
        let text = std::fs::read_to_string(path)?;
        let mut lines = text.split_inclusive('\n');
        let mut lines = lines.by_ref().filter_map(|line| line.strip_suffix('\n'));
        let header = lines.next().unwrap_or_default().to_owned();
        let row = |line: &str| {
            let (run, _) = line.split_once(',')?;
            Some(Row {
                run: run.parse().ok()?,
                line: line.to_owned(),
            })
        };
        Ok(Self {
            header,
            rows: lines.filter_map(row).collect(),
        })
    }

    pub(super) fn is_sorted(&self) -> bool {
        self.rows.is_sorted_by_key(|row| row.run)
    }

    /// The table in the order of runs.
    pub(super) fn sorted(mut self) -> String {
        self.rows.sort_by_key(|row| row.run);
        let mut text = self.header;
        for row in &self.rows {
            text.push('\n');
            text.push_str(&row.line);
        }
        text.push('\n');
        text
    }
}

/// Appends a line to a table, in place of what is no whole line.
pub(super) fn append(path: &Path, line: &str) -> io::Result<()> {
    let mut file = OpenOptions::new().read(true).write(true).open(path)?;
    let end = end_of_lines(&mut file)?;
    file.set_len(end)?;
    file.seek(SeekFrom::Start(end))?;
    file.write_all(line.as_bytes())
}

/// Bytes up to the last end of a line.
fn end_of_lines(file: &mut std::fs::File) -> io::Result<u64> {
    const PIECE: u64 = 4096;
    let mut end = file.metadata()?.len();
    while end > 0 {
        let start = end.saturating_sub(PIECE);
        file.seek(SeekFrom::Start(start))?;
        let mut piece = Vec::new();
        io::Read::take(&mut *file, end - start).read_to_end(&mut piece)?;
        if let Some(place) = piece.iter().rposition(|byte| *byte == b'\n') {
            return Ok(start + place as u64 + 1);
        }
        end = start;
    }
    Ok(0)
}

/// A field, in quotes where it needs them; always in one line.
pub(super) fn quoted(field: &str) -> String {
    let field = field.replace(['\n', '\r'], " ");
    if field.contains([',', '"']) {
        format!("\"{}\"", field.replace('"', "\"\""))
    } else {
        field
    }
}
