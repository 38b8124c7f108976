//! Rows of the tables of runs, read back.

use std::fs::File;
use std::io::{self, BufRead as _, BufReader, ErrorKind};
use std::path::{Path, PathBuf};

/// A table cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TableError {
    /// The file cannot be read, or there is no room for its numbers among temporary files.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A column is missing.
    #[error("{}:1: the table has no column `{column}`", path.display())]
    Column {
        /// The file.
        path: PathBuf,
        /// The column.
        column: &'static str,
    },
    /// A cell is not a number.
    #[error("{}:{line}: there is no number in the column `{column}`", path.display())]
    Number {
        /// The file.
        path: PathBuf,
        /// Counted from 1.
        line: usize,
        /// The column.
        column: &'static str,
    },
    /// A line is not as a run of this scene writes it.
    #[error("{}:{line}: this is no row of {index} at this place of a table of this scene", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Counted from 1.
        line: usize,
        /// Such as `node 3`.
        index: String,
    },
}

impl TableError {
    /// Whether there is no such file.
    pub fn is_missing(&self) -> bool {
        matches!(self, Self::Read { source, .. } if source.kind() == ErrorKind::NotFound)
    }
}

/// The rows of a table one by one, with the cells of some columns; cells that a short row does
/// not have are empty.
#[derive(Debug)]
pub struct TableRows<const N: usize> {
    path: PathBuf,
    file: BufReader<File>,
    columns: [&'static str; N],
    /// Where in a row they are.
    places: [usize; N],
    text: String,
    /// Lines that were read.
    n_lines: usize,
}

/// Some cells of a row, in the order in which they were asked for.
#[derive(Debug)]
pub struct TableRow<'a, const N: usize> {
    path: &'a Path,
    line: usize,
    columns: [&'static str; N],
    /// As they stand there.
    pub cells: [&'a str; N],
}

impl<const N: usize> TableRows<N> {
    /// Opens a table with a header that names its columns.
    ///
    /// # Errors
    ///
    /// If it cannot be read or lacks a column.
    pub fn open(path: &Path, columns: [&'static str; N]) -> Result<Self, TableError> {
        let opened = File::open(path).map_err(|source| TableError::Read {
            path: path.to_owned(),
            source,
        })?;
        let mut rows = Self {
            path: path.to_owned(),
            file: BufReader::new(opened),
            columns,
            places: [0; N],
            text: String::new(),
            n_lines: 0,
        };
        rows.next_line()?;
        for (place, column) in rows.places.iter_mut().zip(columns) {
            let found = rows.text.split(',').position(|name| name == column);
            *place = found.ok_or_else(|| TableError::Column {
                path: path.to_owned(),
                column,
            })?;
        }
        Ok(rows)
    }

    /// The next row; nothing after the last one.
    ///
    /// # Errors
    ///
    /// If it cannot be read.
    #[expect(clippy::should_implement_trait, reason = "a row borrows its text")]
    pub fn next(&mut self) -> Result<Option<TableRow<'_, N>>, TableError> {
        if !self.next_line()? {
            return Ok(None);
        }
        let mut cells = [""; N];
        for (index, text) in self.text.split(',').enumerate() {
            for (cell, _) in cells
                .iter_mut()
                .zip(self.places)
                .filter(|(_, place)| *place == index)
            {
                *cell = text;
            }
        }
        Ok(Some(TableRow {
            path: &self.path,
            line: self.n_lines,
            columns: self.columns,
            cells,
        }))
    }

    /// Reads a line without its end; `false` if there is none.
    fn next_line(&mut self) -> Result<bool, TableError> {
        self.text.clear();
        self.n_lines += 1;
        let read = self.file.read_line(&mut self.text);
        let n_bytes = read.map_err(|source| self.failure(source))?;
        self.text
            .truncate(self.text.trim_end_matches(['\n', '\r']).len());
        Ok(n_bytes > 0)
    }

    pub(crate) fn failure(&self, source: io::Error) -> TableError {
        TableError::Read {
            path: self.path.clone(),
            source,
        }
    }

    /// The last line that was read is not that of the index of such a thing.
    pub(crate) fn not_of(&self, thing: &str, index: usize) -> TableError {
        TableError::Line {
            path: self.path.clone(),
            line: self.n_lines,
            index: format!("{thing} {index}"),
        }
    }
}

impl<const N: usize> TableRow<'_, N> {
    /// The number in a cell; `None` if that is empty.
    ///
    /// # Errors
    ///
    /// If it is something else.
    pub fn number(&self, cell: usize) -> Result<Option<f64>, TableError> {
        if self.cells[cell].is_empty() {
            return Ok(None);
        }
        match self.cells[cell].parse() {
            Ok(number) => Ok(Some(number)),
            Err(_) => Err(self.no_number(cell)),
        }
    }

    /// The same, or NaN if the cell is empty.
    ///
    /// # Errors
    ///
    /// If it is something else.
    pub fn number_or_nan(&self, cell: usize) -> Result<f64, TableError> {
        Ok(self.number(cell)?.unwrap_or(f64::NAN))
    }

    /// The same, if it is finite.
    ///
    /// # Errors
    ///
    /// If it is not.
    pub fn finite_number(&self, cell: usize) -> Result<f64, TableError> {
        let number = self.number(cell)?.filter(|number| number.is_finite());
        number.ok_or_else(|| self.no_number(cell))
    }

    fn no_number(&self, cell: usize) -> TableError {
        TableError::Number {
            path: self.path.to_owned(),
            line: self.line,
            column: self.columns[cell],
        }
    }
}
