//! Outputs that are a table as CSV.

use crate::atomic::WriteError;
use crate::growing::{ContinueError, FileMark, GrowingFile};
use crate::sink::{
    FrameEnergies, FrameMembers, Mark, ResumeSink, RunEnd, RunPlan, Sink, SinkKind,
    TrajectoryFrame, Written,
};
use crate::steps::StepRow;
use std::path::Path;

/// An output that is one table, with rows for each frame.
#[derive(Clone, Copy, Debug)]
pub struct Table {
    /// What asks for it.
    pub name: &'static str,
    /// What it holds, in a few words.
    pub about: &'static str,
    /// The name of its file.
    pub file: &'static str,
    /// Names of the columns.
    pub columns: &'static [&'static str],
    /// What its rows are of.
    pub rows: Rows,
}

/// What the rows of a table are of. They are appended to the bytes; every number
/// has to read back to the same bits.
#[derive(Clone, Copy, Debug)]
pub enum Rows {
    /// The nodes at each frame.
    Frames(fn(&TrajectoryFrame<'_>, &mut Vec<u8>)),
    /// What springs and supports carry at each frame.
    Members(fn(&TrajectoryFrame<'_>, &FrameMembers<'_>, &mut Vec<u8>)),
    /// The energies at each frame.
    Energies(fn(&FrameEnergies, &mut Vec<u8>)),
    /// The steps.
    Steps(fn(&StepRow, &mut Vec<u8>)),
}

impl Table {
    /// Its first line.
    pub(crate) fn header(&self) -> String {
        self.columns.join(",")
    }
}

impl SinkKind for Table {
    fn name(&self) -> &'static str {
        self.name
    }

    fn about(&self) -> &'static str {
        self.about
    }

    fn files(&self) -> Vec<&'static str> {
        vec![self.file]
    }

    fn begin(&self, folder: &Path, _plan: &RunPlan<'_>) -> Result<Box<dyn Sink>, WriteError> {
        let mut file = GrowingFile::begin(&folder.join(self.file))?;
        file.append(|bytes| bytes.extend(format!("{}\n", self.header()).bytes()))?;
        Ok(Box::new(GrowingTable { table: *self, file }))
    }

    fn resume(
        &self,
        folder: &Path,
        _plan: &RunPlan<'_>,
        mark: &Mark,
    ) -> Result<ResumeSink, ContinueError> {
        let table = *self;
        let mark: FileMark = mark.read(table.file)?;
        let found = GrowingFile::find(&folder.join(table.file), mark)?;
        Ok(Box::new(move || {
            let file = found.go_on()?;
            Ok(Box::new(GrowingTable { table, file }))
        }))
    }
}

struct GrowingTable {
    table: Table,
    file: GrowingFile,
}

impl Sink for GrowingTable {
    fn wants_energies(&self) -> bool {
        matches!(self.table.rows, Rows::Energies(_))
    }

    fn wants_members(&self) -> bool {
        matches!(self.table.rows, Rows::Members(_))
    }

    fn wants_steps(&self) -> bool {
        matches!(self.table.rows, Rows::Steps(_))
    }

    fn frame(&mut self, frame: &TrajectoryFrame<'_>) -> Result<(), WriteError> {
        match (self.table.rows, &frame.members) {
            (Rows::Frames(rows), _) => self.file.append(|bytes| rows(frame, bytes)),
            (Rows::Members(rows), Some(members)) => {
                self.file.append(|bytes| rows(frame, members, bytes))
            }
            _ => Ok(()),
        }
    }

    fn energies(&mut self, energies: &FrameEnergies) -> Result<(), WriteError> {
        if let Rows::Energies(rows) = self.table.rows {
            self.file.append(|bytes| rows(energies, bytes))?;
        }
        Ok(())
    }

    fn step(&mut self, step: &StepRow) -> Result<(), WriteError> {
        if let Rows::Steps(rows) = self.table.rows {
            self.file.append(|bytes| rows(step, bytes))?;
        }
        Ok(())
    }

    fn written(&mut self) -> &mut dyn Written {
        &mut self.file
    }

    fn finish(self: Box<Self>, _end: &RunEnd<'_>) -> Result<(), WriteError> {
        self.file.finish()
    }
}
