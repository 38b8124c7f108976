//! Tables of numbers in files.

use crate::read::read_text;
use nalgebra::Vector3;
use springs_scene::printable;
use std::fs::File;
use std::path::Path;

/// Why a file is no table of numbers.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct RowsError(String);

/// Points in the rows of a file, x, y, z with commas between them; the first line may be a
/// header.
///
/// # Errors
///
/// If the file cannot be read, a row is something else, or there is none.
pub fn read_points(path: &Path) -> Result<Vec<Vector3<f64>>, RowsError> {
    let rows = numbered_rows::<3>(path).map_err(RowsError)?;
    Ok(rows.into_iter().map(|(_, row)| row.into()).collect())
}

/// Rows of so many numbers, of which the first is a time and later from row to row; the first
/// line may be a header. `scene` is the name of the scene file, beside which the file is.
///
/// # Errors
///
/// In words, with the file and the line.
pub(crate) fn read_rows<const N: usize>(scene: &str, name: &str) -> Result<Vec<[f64; N]>, String> {
    let path = Path::new(scene)
        .parent()
        .unwrap_or(Path::new(""))
        .join(name);
    let rows = numbered_rows::<N>(&path)?;
    let falls = |pair: &&[(usize, [f64; N])]| pair[0].1[0] >= pair[1].1[0];
    if let Some([(_, before), (line, after)]) = rows.windows(2).find(falls) {
        let (file, before, after) = (shown(&path), before[0], after[0]);
        return Err(format!(
            "{file}:{line}: {after:?} s must not stand after {before:?} s"
        ));
    }
    Ok(rows.into_iter().map(|(_, row)| row).collect())
}

fn shown(path: &Path) -> String {
    printable(&path.display().to_string())
}

/// Rows with their lines, counted from 1; one at least.
fn numbered_rows<const N: usize>(path: &Path) -> Result<Vec<(usize, [f64; N])>, String> {
    let file = shown(path);
    let text = read_text(&file, File::open(path)).map_err(|error| error.to_string())?;
    let mut rows = Vec::new();
    for (line, row) in (1..).zip(text.lines()) {
        if row.trim().is_empty() {
            continue;
        }
        let cells: Vec<&str> = row.split(',').map(str::trim).collect();
        let numbers: Result<Vec<f64>, _> = cells.iter().map(|cell| cell.parse()).collect();
        let is_header = line == 1 && cells[0].parse::<f64>().is_err();
        let numbers = numbers
            .ok()
            .filter(|all| all.iter().all(|one| one.is_finite()));
        match numbers.and_then(|numbers| <[f64; N]>::try_from(numbers).ok()) {
            Some(numbers) => rows.push((line, numbers)),
            None if is_header => {}
            None => {
                let row = printable(row);
                return Err(format!("{file}:{line}: `{row}` is no row of {N} numbers"));
            }
        }
    }
    if rows.is_empty() {
        return Err(format!("{file} has no row of {N} numbers"));
    }
    Ok(rows)
}
