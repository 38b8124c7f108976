//! A request to stop long work.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Asks work that may take long to stop soon. All clones are asked at once.
///
/// The default asks for nothing, ever; one made from a shared flag asks as long as
/// that is true.
#[derive(Clone, Debug, Default)]
pub struct Interrupt {
    flag: Option<Arc<AtomicBool>>,
}

impl Interrupt {
    /// Whether it may ever ask work to stop.
    pub fn can_be_requested(&self) -> bool {
        self.flag.is_some()
    }

    /// Whether work is asked to stop.
    pub fn is_requested(&self) -> bool {
        let flag = self.flag.as_ref();
        flag.is_some_and(|flag| flag.load(Ordering::Relaxed))
    }
}

impl From<Arc<AtomicBool>> for Interrupt {
    fn from(flag: Arc<AtomicBool>) -> Self {
        Self { flag: Some(flag) }
    }
}
