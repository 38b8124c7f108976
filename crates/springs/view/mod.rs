//! `view.html`: a run to look at in a browser, in one page that needs nothing else.

mod contents;
mod marks;
mod page;
mod quantized;

pub use page::{ViewError, page_of, write_page};

use springs_io::{
    ContinueError, Mark, ResumeSink, RunEnd, RunPlan, Sink, SinkKind, WriteError, Written,
};
use std::io;
use std::path::{Path, PathBuf};

/// The page.
pub const FILE: &str = "view.html";

/// The output `view`: [`write_page`] of the outputs `npz` and `energy`, at the end.
#[derive(Clone, Copy, Debug)]
pub struct View;

impl SinkKind for View {
    fn name(&self) -> &'static str {
        "view"
    }

    fn about(&self) -> &'static str {
        "view.html: the run to look at in a browser; writes npz and energy, too"
    }

    fn files(&self) -> Vec<&'static str> {
        vec![FILE]
    }

    fn needs(&self) -> &'static [&'static str] {
        &["npz", "energy"]
    }

    fn begin(&self, folder: &Path, _plan: &RunPlan<'_>) -> Result<Box<dyn Sink>, WriteError> {
        let folder = folder.to_owned();
        Ok(Box::new(AtTheEnd { folder }))
    }

    fn resume(
        &self,
        folder: &Path,
        _plan: &RunPlan<'_>,
        mark: &Mark,
    ) -> Result<ResumeSink, ContinueError> {
        let () = mark.read(FILE)?;
        let folder = folder.to_owned();
        Ok(Box::new(|| Ok(Box::new(AtTheEnd { folder }))))
    }
}

/// What the page is made of is written by others.
struct AtTheEnd {
    folder: PathBuf,
}

impl Sink for AtTheEnd {
    fn written(&mut self) -> &mut dyn Written {
        self
    }

    fn finish(self: Box<Self>, end: &RunEnd<'_>) -> Result<(), WriteError> {
        match write_page(&self.folder, end.scene) {
            Ok(_) => Ok(()),
            Err(ViewError::Write(error)) => Err(error),
            Err(error) => Err(WriteError {
                path: self.folder.join(FILE),
                source: io::Error::other(error),
            }),
        }
    }
}

impl Written for AtTheEnd {
    fn mark(&self) -> Mark {
        Mark::of(&())
    }
}
