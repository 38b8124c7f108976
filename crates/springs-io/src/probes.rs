//! `probes.csv`: what the probes of a scene tell, each at times of its own.

use crate::atomic::WriteError;
use crate::growing::{ContinueError, FileMark, GrowingFile};
use crate::sink::{Mark, ProbeSamples, ResumeSink, RunEnd, RunPlan, Sink, SinkKind, Written};
use springs_scene::{Probe, Scene};
use std::io::Write as _;
use std::path::Path;

/// The name of the output of probes, which a run of a scene that has any always writes.
pub const PROBES: &str = "probes";

const FILE: &str = "probes.csv";

/// The output [`PROBES`]: a row for each number that a probe tells, since probes tell
/// different things at different times.
#[derive(Clone, Copy, Debug)]
pub struct Probes;

impl SinkKind for Probes {
    fn name(&self) -> &'static str {
        PROBES
    }

    fn about(&self) -> &'static str {
        "probes.csv: what the probes of the scene tell, always written where there are any"
    }

    fn files(&self) -> Vec<&'static str> {
        vec![FILE]
    }

    fn begin(&self, folder: &Path, plan: &RunPlan<'_>) -> Result<Box<dyn Sink>, WriteError> {
        let mut file = GrowingFile::begin(&folder.join(FILE))?;
        file.append(|bytes| bytes.extend(b"time,item,index,quantity,value\n"))?;
        Ok(Box::new(Growing {
            labels: labels(plan.scene),
            file,
        }))
    }

    fn resume(
        &self,
        folder: &Path,
        plan: &RunPlan<'_>,
        mark: &Mark,
    ) -> Result<ResumeSink, ContinueError> {
        let labels = labels(plan.scene);
        let mark: FileMark = mark.read(FILE)?;
        let found = GrowingFile::find(&folder.join(FILE), mark)?;
        Ok(Box::new(move || {
            let file = found.go_on()?;
            Ok(Box::new(Growing { labels, file }))
        }))
    }
}

/// What stands between the time and the value of each number of each probe.
fn labels(scene: &Scene) -> Vec<Vec<String>> {
    let of_probe = |probe: &Probe| -> Vec<String> {
        let indices = probe.on.indices().iter();
        let labels = indices.flat_map(|index| {
            let numbers = probe.of.iter().flat_map(|quantity| quantity.numbers());
            numbers.map(move |number| format!("{},{index},{number}", probe.on.item()))
        });
        labels.collect()
    };
    scene.output.probes.iter().map(of_probe).collect()
}

struct Growing {
    labels: Vec<Vec<String>>,
    file: GrowingFile,
}

impl Sink for Growing {
    fn wants_samples(&self) -> bool {
        true
    }

    fn samples(&mut self, samples: &ProbeSamples<'_>) -> Result<(), WriteError> {
        let (labels, time) = (&self.labels, samples.time);
        self.file.append(|bytes| {
            for &(probe, values) in samples.samples {
                for (label, value) in labels[probe].iter().zip(values) {
                    writeln!(bytes, "{time:?},{label},{value:?}").expect("writing to memory");
                }
            }
        })
    }

    fn written(&mut self) -> &mut dyn Written {
        &mut self.file
    }

    fn finish(self: Box<Self>, _end: &RunEnd<'_>) -> Result<(), WriteError> {
        self.file.finish()
    }
}
