//! Springs that broke.

use crate::Archive;

/// A spring that broke during a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Break {
    /// When: the end of a step, in s.
    pub time: f64,
    /// Its index in the scene.
    pub spring: usize,
    /// What it held, in J.
    pub energy: f64,
}

impl Break {
    pub(crate) fn archive(&mut self, archive: &mut Archive) {
        let mut spring = self.spring as u64;
        archive.real(&mut self.time);
        archive.word(&mut spring);
        archive.real(&mut self.energy);
        self.spring = spring as usize;
    }
}
