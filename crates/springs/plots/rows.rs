//! Rows of a table of numbers and names.

use std::fs::File;
use std::io::{self, BufRead as _, BufReader};
use std::path::{Path, PathBuf};

/// A table cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TableError {
    /// The file cannot be read.
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
}

/// Some cells of a row, in the order in which they were asked for.
pub(super) struct Row<'a, const N: usize> {
    path: &'a Path,
    line: usize,
    columns: [&'static str; N],
    pub(super) cells: [&'a str; N],
}

impl<const N: usize> Row<'_, N> {
    /// The number in a cell; `None` if that is empty.
    ///
    /// # Errors
    ///
    /// If it is something else.
    pub(super) fn number(&self, cell: usize) -> Result<Option<f64>, TableError> {
        if self.cells[cell].is_empty() {
            return Ok(None);
        }
        match self.cells[cell].parse() {
            Ok(number) => Ok(Some(number)),
            Err(_) => Err(TableError::Number {
                path: self.path.to_owned(),
                line: self.line,
                column: self.columns[cell],
            }),
        }
    }

    /// The same, or NaN if the cell is empty.
    pub(super) fn number_or_nan(&self, cell: usize) -> Result<f64, TableError> {
        Ok(self.number(cell)?.unwrap_or(f64::NAN))
    }
}

/// Shows the rows of a table, one by one, with the cells of some columns; cells that a short
/// row does not have are empty.
///
/// # Errors
///
/// If it cannot be read, or lacks a column, or those of `each`.
pub(super) fn read<const N: usize>(
    path: &Path,
    columns: [&'static str; N],
    mut each: impl FnMut(Row<'_, N>) -> Result<(), TableError>,
) -> Result<(), TableError> {
    let failure = |source| TableError::Read {
        path: path.to_owned(),
        source,
    };
    let mut lines = BufReader::new(File::open(path).map_err(failure)?).lines();
    let header = lines.next().transpose().map_err(failure)?;
    let header = header.unwrap_or_default();
    let mut places = [0; N];
    for (place, column) in places.iter_mut().zip(columns) {
        let found = header.split(',').position(|name| name == column);
        *place = found.ok_or_else(|| TableError::Column {
            path: path.to_owned(),
            column,
        })?;
    }
    for (index, line) in lines.enumerate() {
        let line = line.map_err(failure)?;
        let all: Vec<&str> = line.split(',').collect();
        each(Row {
            path,
            line: index + 2,
            columns,
            cells: places.map(|place| all.get(place).copied().unwrap_or("")),
        })?;
    }
    Ok(())
}
