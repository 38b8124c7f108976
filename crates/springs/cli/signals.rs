//! Signals that end a command: Ctrl-C (SIGINT), SIGTERM and SIGHUP.

use super::EXIT_INTERRUPTED;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::ffi::c_int;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// What signals do to a command. Until it has something to complete, the first
/// one ends the program at once; after that the first one is only noted, and the
/// second one ends the program at once. The exit code is 130 either way.
pub(crate) struct Signals {
    is_interrupted: Arc<AtomicBool>,
    /// Whether any signal ends the program.
    ends_at_once: Arc<AtomicBool>,
}

impl Signals {
    /// Watches from now on. A signal that cannot be watched keeps its usual
    /// effect.
    pub(crate) fn watch() -> Self {
        let signals = Self {
            is_interrupted: Arc::default(),
            ends_at_once: Arc::new(AtomicBool::new(true)),
        };
        let ending = ending_signals();
        let noted: Vec<Arc<AtomicBool>> = ending.iter().map(|_| Arc::default()).collect();
        for (&signal, own) in ending.iter().zip(&noted) {
            let ends_if = |flag: &Arc<AtomicBool>| {
                let code = c_int::from(EXIT_INTERRUPTED);
                flag::register_conditional_shutdown(signal, code, flag.clone())
            };
            // In this order: a signal must not find what it sets itself, and of two that
            // threads take at the same time, one must find the other.
            let others = noted.iter().filter(|flag| !Arc::ptr_eq(flag, own));
            let _ = ends_if(&signals.ends_at_once)
                .and_then(|_| ends_if(own))
                .and_then(|_| flag::register(signal, own.clone()))
                .and_then(|_| flag::register(signal, signals.is_interrupted.clone()))
                .and_then(|last| others.map(ends_if).try_fold(last, |_, id| id));
        }
        // Where a file reaches a size that is not allowed, the system sends this
        // signal, which ends a program that does not watch it without a word.
        // Watched, it makes the write fail.
        #[cfg(unix)]
        let _ = flag::register(signal_hook::consts::SIGXFSZ, Arc::default());
        signals
    }

    /// From now on the first signal is only noted.
    pub(crate) fn note_the_first(&self) {
        self.ends_at_once.store(false, Ordering::SeqCst);
    }

    /// Becomes true with the first signal that is noted.
    pub(crate) fn is_interrupted(&self) -> Arc<AtomicBool> {
        self.is_interrupted.clone()
    }
}

/// Those that this process does not ignore: `nohup` has SIGHUP ignored, and a
/// shell script SIGINT for what it starts in the background.
fn ending_signals() -> Vec<c_int> {
    #[cfg(unix)]
    let signals = [SIGINT, SIGTERM, signal_hook::consts::SIGHUP];
    #[cfg(not(unix))]
    let signals = [SIGINT, SIGTERM];
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = ignored_signals(&status);
    let is_ignored = |signal: &c_int| ignored >> (signal - 1) & 1 == 1;
    signals
        .into_iter()
        .filter(|signal| !is_ignored(signal))
        .collect()
}

/// One bit a signal, from the lowest on, as in `/proc/self/status` of Linux; none
/// where the system does not tell.
fn ignored_signals(status: &str) -> u64 {
    let mut lines = status.lines();
    let mask = lines.find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok())
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ignored_signals_are_read() {
        let status = "Name:\tsprings\nSigBlk:\t0000000000000002\nSigIgn:\t0000000000001001\n";
        assert_eq!(ignored_signals(status), 0x1001);
        assert_eq!(ignored_signals("Name:\tsprings\n"), 0);
    }
}
