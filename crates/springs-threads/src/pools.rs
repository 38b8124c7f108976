//! Pools of threads, each lent to one call at a time.

use rayon::{ThreadPool, ThreadPoolBuilder};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Pools that nobody uses at present. They are kept for as long as the process lives,
/// and their threads sleep: there are as many pools of a size as were in use at once.
static IDLE: Mutex<Vec<Pool>> = Mutex::new(Vec::new());

struct Pool {
    /// Threads that were asked for.
    asked: usize,
    /// With as many as could be started; `None` without any, which is kept, too, so as
    /// not to try in vain at every call.
    threads: Option<ThreadPool>,
}

impl Pool {
    fn start(asked: usize) -> Self {
        let mut threads = None;
        let mut size = asked;
        while size > 1 && threads.is_none() {
            let mut started = Vec::new();
            let builder = ThreadPoolBuilder::new().num_threads(size);
            let builder = builder.spawn_handler(|thread| {
                let name = format!("springs-{}", thread.index());
                let builder = std::thread::Builder::new().name(name);
                started.push(builder.spawn(|| thread.run())?);
                Ok(())
            });
            threads = builder.build().ok();
            if threads.is_none() {
                // Some are left for others; these end first, to make room.
                size = started.len() / 2;
                for thread in started {
                    let _ended = thread.join();
                }
            }
        }
        Self { asked, threads }
    }
}

/// A pool for as long as this lives.
pub(crate) struct Loan(Option<Pool>);

impl Loan {
    /// A pool of so many threads that nobody else uses.
    pub(crate) fn of(threads: usize) -> Self {
        let kept = {
            let mut idle = idle();
            let found = idle.iter().rposition(|pool| pool.asked == threads);
            found.map(|index| idle.swap_remove(index))
        };
        Self(Some(kept.unwrap_or_else(|| Pool::start(threads))))
    }

    /// `None` where no threads could be started.
    pub(crate) fn pool(&self) -> Option<&ThreadPool> {
        self.0.as_ref()?.threads.as_ref()
    }
}

impl Drop for Loan {
    fn drop(&mut self) {
        if let Some(pool) = self.0.take() {
            idle().push(pool);
        }
    }
}

fn idle() -> MutexGuard<'static, Vec<Pool>> {
    // Nothing can be half done there.
    IDLE.lock().unwrap_or_else(PoisonError::into_inner)
}
