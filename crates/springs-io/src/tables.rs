//! Frames from the tables of a run.

use crate::frames::{FrameFile, FrameSize};
use crate::members::SPRINGS;
use crate::rows::{TableError, TableRows};
use crate::trajectory::{COLUMNS, TRAJECTORY};
use std::io::{BufWriter, Write as _};
use std::path::Path;

/// Appends the numbers of the rows 0 to n of a frame, each column to its own. The first two
/// columns are the time and the index of such a `thing`. Returns the time, or nothing if there
/// is no frame any more.
fn read_frame<const N: usize>(
    rows: &mut TableRows<N>,
    thing: &str,
    n: usize,
    numbers: &mut [Vec<f64>],
) -> Result<Option<f64>, TableError> {
    numbers.iter_mut().for_each(Vec::clear);
    let mut time = None;
    for index in 0..n {
        let Some(row) = rows.next()? else {
            return if index == 0 {
                Ok(None)
            } else {
                Err(rows.not_of(thing, index))
            };
        };
        let mut read = || {
            let now = row.finite_number(0).ok()?;
            let is_next = row.cells[1].parse() == Ok(index) && time.is_none_or(|time| time == now);
            for (numbers, cell) in numbers.iter_mut().zip(2..) {
                numbers.push(row.number(cell).ok()??);
            }
            is_next.then_some(now)
        };
        match read() {
            Some(now) => time = Some(now),
            None => return Err(rows.not_of(thing, index)),
        }
    }
    Ok(time)
}

/// Reads all frames of `trajectory.csv` and `springs.csv` in a folder; a file of plain
/// numbers, which is gone with the result, holds them.
///
/// # Errors
///
/// If a table is not there or not of a scene of this size.
pub fn read_tables(folder: &Path, size: FrameSize) -> Result<FrameFile, TableError> {
    let mut nodes = TableRows::open(&folder.join(TRAJECTORY.file), COLUMNS)?;
    let columns = ["time", "spring", "length", "tension"];
    let mut springs = TableRows::open(&folder.join(SPRINGS.file), columns)?;
    let mut states: [Vec<f64>; 6] = Default::default();
    let mut members: [Vec<f64>; 2] = Default::default();
    let file = tempfile::tempfile().map_err(|source| nodes.failure(source))?;
    let mut out = BufWriter::new(file);
    let mut n_frames = 0;
    while let Some(time) = read_frame(&mut nodes, "node", size.n_nodes, &mut states)? {
        let same = read_frame(&mut springs, "spring", size.n_springs, &mut members)?;
        if size.n_springs > 0 && same != Some(time) {
            return Err(springs.not_of("spring", 0));
        }
        let [x, y, z, vx, vy, vz] = &states;
        let vectors = [[x, y, z], [vx, vy, vz]].into_iter().flat_map(|[x, y, z]| {
            let numbers = x.iter().zip(y).zip(z);
            numbers.flat_map(|((x, y), z)| [*x, *y, *z])
        });
        let numbers = std::iter::once(time).chain(vectors);
        let numbers = numbers.chain(members.iter().flatten().copied());
        for number in numbers {
            let written = out.write_all(&number.to_le_bytes());
            written.map_err(|source| nodes.failure(source))?;
        }
        n_frames += 1;
    }
    let file = out.into_inner();
    let file = file.map_err(|error| nodes.failure(error.into_error()))?;
    Ok(FrameFile::of_frames(file, size, n_frames))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Quantity;

    const SIZE: FrameSize = FrameSize {
        n_nodes: 2,
        n_springs: 1,
    };

    fn read(nodes: &str, springs: &str) -> Result<FrameFile, String> {
        let folder = tempfile::tempdir().unwrap();
        for (table, rows) in [(&TRAJECTORY, nodes), (&SPRINGS, springs)] {
            let text = format!("{}\n{rows}", table.header());
            std::fs::write(folder.path().join(table.file), text).unwrap();
        }
        let read = read_tables(folder.path(), SIZE);
        read.map_err(|error| {
            let text = error.to_string();
            let (_, place) = text.rsplit_once(std::path::MAIN_SEPARATOR).unwrap();
            place.to_owned()
        })
    }

    const NODES: &str = "0.0,0,1.0,2.0,3.0,4.0,5.0,6.0\n0.0,1,7.0,8.0,9.0,10.0,11.0,12.0\n";
    const MEMBERS: &str = "0.0,0,1.5,0.5,-2.0,pushed\n";

    #[test]
    fn frames_are_those_of_the_tables() {
        let later = |rows: &str| rows.to_owned() + &rows.replace("0.0,", "0.5,");
        let mut frames = read(&later(NODES), &later(MEMBERS)).unwrap();
        assert_eq!((frames.n_frames(), frames.size()), (2, SIZE));
        let mut numbers = Vec::new();
        let mut all = |quantity| {
            frames.read(quantity, 1, &mut numbers).unwrap();
            numbers.clone()
        };
        assert_eq!(all(Quantity::Time), [0.5]);
        assert_eq!(all(Quantity::Position), [1.0, 2.0, 3.0, 7.0, 8.0, 9.0]);
        assert_eq!(all(Quantity::Tension), [-2.0]);
    }

    #[test]
    fn errors_name_the_line() {
        let wrong = |nodes: &str, springs: &str| read(nodes, springs).unwrap_err();
        let half = NODES.lines().next().unwrap();
        let place = "this is no row of";
        let rest = "at this place of a table of this scene";
        assert_eq!(
            wrong(half, MEMBERS),
            format!("trajectory.csv:3: {place} node 1 {rest}")
        );
        assert_eq!(
            wrong(NODES, ""),
            format!("springs.csv:2: {place} spring 0 {rest}")
        );
        assert_eq!(
            wrong(&NODES.replace("8.0", "eight"), MEMBERS),
            format!("trajectory.csv:3: {place} node 1 {rest}")
        );
        assert_eq!(
            wrong(NODES, &MEMBERS.replace("0.0,0", "0.1,0")),
            format!("springs.csv:2: {place} spring 0 {rest}")
        );
    }
}
