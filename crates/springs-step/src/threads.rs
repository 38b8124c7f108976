//! How many threads there are.

use springs_scene::RunOptions;
use std::num::NonZeroUsize;
use std::sync::LazyLock;

/// Asked for once: the answer takes longer than a small scene.
static OF_MACHINE: LazyLock<usize> =
    LazyLock::new(|| std::thread::available_parallelism().map_or(1, NonZeroUsize::get));

/// Threads that options mean: so many as they say, or as the machine has.
pub fn threads(options: &RunOptions) -> usize {
    match options.threads {
        0 => *OF_MACHINE,
        asked => asked,
    }
}
