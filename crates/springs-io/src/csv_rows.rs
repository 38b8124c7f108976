//! Tables of numbers over time in files beside a scene.

use crate::read::read_text;
use springs_scene::printable;
use std::fs::File;
use std::path::Path;

/// Rows of so many numbers, of which the first is a time and later from row to row; the first
/// line may be a header. `scene` is the name of the scene file, beside which the file is.
///
/// # Errors
///
/// In words, with the file and the line.
pub(crate) fn read_rows<const N: usize>(scene: &str, name: &str) -> Result<Vec<[f64; N]>, String> {
    let path = Path::new(scene).parent().unwrap_or(Path::new(""));
    let path = path.join(name);
    let shown = printable(&path.display().to_string());
    let text = read_text(&shown, File::open(&path)).map_err(|error| error.to_string())?;
    let mut rows: Vec<[f64; N]> = Vec::new();
    for (index, line) in text.lines().enumerate() {
        if line.trim().is_empty() {
            continue;
        }
        let wrong = |what: String| Err(format!("{shown}:{}: {what}", index + 1));
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        let numbers: Result<Vec<f64>, _> = cells.iter().map(|cell| cell.parse()).collect();
        let is_header = index == 0 && cells[0].parse::<f64>().is_err();
        let numbers = numbers
            .ok()
            .filter(|all| all.iter().all(|one| one.is_finite()));
        match numbers.and_then(|numbers| <[f64; N]>::try_from(numbers).ok()) {
            Some(row) => {
                if let Some(last) = rows.last().filter(|last| last[0] >= row[0]) {
                    let (before, after) = (last[0], row[0]);
                    return wrong(format!("{after:?} s must not stand after {before:?} s"));
                }
                rows.push(row);
            }
            None if is_header => {}
            None => {
                let line = printable(line);
                return wrong(format!("`{line}` is no row of {N} numbers"));
            }
        }
    }
    if rows.is_empty() {
        return Err(format!("{shown} has no row of {N} numbers"));
    }
    Ok(rows)
}
