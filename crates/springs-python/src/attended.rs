//! Long work without the lock of the interpreter, while Python's signals are heard.

use crate::errors::Fault;
use pyo3::prelude::*;
use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

/// Time between two looks at signals.
pub(crate) const LOOK: Duration = Duration::from_millis(20);

/// As the main thread of most systems has.
const STACK: usize = 8 << 20;

/// What the worker and the thread that attends it share.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shared {
    /// Whether the work is to stop soon.
    pub(crate) is_stopped: Arc<AtomicBool>,
    /// How far it is: the bits of a number from 0 to 1.
    progress: Arc<AtomicU64>,
}

impl Shared {
    pub(crate) fn set_progress(&self, progress: f64) {
        self.progress.store(progress.to_bits(), Ordering::Relaxed);
    }

    /// The next work is not to stop.
    pub(crate) fn go_on(&self) {
        self.is_stopped.store(false, Ordering::Relaxed);
    }

    pub(crate) fn is_stopped(&self) -> bool {
        self.is_stopped.load(Ordering::Relaxed)
    }
}

/// Who is told of the progress: a function of a number from 0 to 1.
pub(crate) struct Progress(Option<Py<PyAny>>);

impl Progress {
    /// `None` and `False`: nobody; `True`: a bar; else whom to call.
    pub(crate) fn new(value: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let Some(value) = value else {
            return Ok(Self(None));
        };
        if value.is_callable() {
            return Ok(Self(Some(value.clone().unbind())));
        }
        if !value.is_truthy()? {
            return Ok(Self(None));
        }
        let bar = value
            .py()
            .import("springs._progress")?
            .call_method0("bar")?;
        Ok(Self(Some(bar.unbind())))
    }

    fn tell(&self, py: Python<'_>, progress: f64) -> PyResult<()> {
        let Some(function) = &self.0 else {
            return Ok(());
        };
        function.call1(py, (progress,)).map(drop)
    }
}

/// Runs `work` in a thread of its own, and hears signals and tells the progress in this
/// one. Where a handler of signals or the progress raises something, the work is asked to
/// stop, and that is given back beside its result.
pub(crate) fn attended<R: Send>(
    py: Python<'_>,
    shared: &Shared,
    progress: &Progress,
    work: impl FnOnce() -> R + Send,
) -> PyResult<(R, Option<PyErr>)> {
    let attend = || {
        thread::scope(|scope| {
            let (done, is_done) = channel::<()>();
            let work = move || {
                let result = work();
                drop(done);
                result
            };
            let builder = thread::Builder::new().stack_size(STACK);
            let worker = builder.spawn_scoped(scope, work)?;
            let mut raised = None;
            while is_done.recv_timeout(LOOK) == Err(RecvTimeoutError::Timeout) {
                if raised.is_some() {
                    continue;
                }
                let heard = Python::attach(|py| {
                    py.check_signals()?;
                    let bits = shared.progress.load(Ordering::Relaxed);
                    progress.tell(py, f64::from_bits(bits))
                });
                if let Err(error) = heard {
                    shared.is_stopped.store(true, Ordering::Relaxed);
                    raised = Some(error);
                }
            }
            match worker.join() {
                Ok(result) => Ok((result, raised)),
                Err(panic) => resume_unwind(panic),
            }
        })
    };
    let done: std::io::Result<_> = py.detach(attend);
    let (result, mut raised) = done.map_err(Fault::system)?;
    if raised.is_none() && !shared.is_stopped() {
        raised = progress.tell(py, 1.0).err();
    }
    Ok((result, raised))
}
