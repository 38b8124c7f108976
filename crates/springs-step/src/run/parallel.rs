//! The same work on many items, on several threads.

use std::sync::Mutex;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::Builder;
use std::time::Duration;

/// Does `work` on every item; results are in the order of the items. There are as
/// many threads as items at most, and fewer than asked for where no more can be
/// started.
pub(crate) fn in_parallel<T: Send, R: Send>(
    items: Vec<T>,
    threads: usize,
    work: impl Fn(T) -> R + Sync,
) -> Vec<R> {
    let threads = threads.min(items.len());
    if threads <= 1 {
        return items.into_iter().map(work).collect();
    }
    let queue = Queue::new(items);
    std::thread::scope(|scope| {
        for _ in 1..threads {
            let started = Builder::new().spawn_scoped(scope, || queue.work_off(&work));
            if started.is_err() {
                break;
            }
        }
        queue.work_off(&work);
    });
    queue.into_results()
}

/// Time between two calls of who watches.
const LOOK: Duration = Duration::from_millis(20);

/// The same while this thread calls `watch` again and again; one thread more than
/// that has to be there, or all is done without `watch`.
pub(crate) fn in_parallel_watched<T: Send, R: Send>(
    items: Vec<T>,
    threads: usize,
    work: impl Fn(T) -> R + Sync,
    watch: &mut dyn FnMut(),
) -> Vec<R> {
    let threads = threads.min(items.len());
    let queue = Queue::new(items);
    std::thread::scope(|scope| {
        let (at_work, all_done) = channel::<()>();
        for _ in 0..threads {
            let at_work: Sender<()> = at_work.clone();
            let (queue, work) = (&queue, &work);
            let started = Builder::new().spawn_scoped(scope, move || {
                // Dropped at the end, even by a panic.
                let _at_work = at_work;
                queue.work_off(work);
            });
            if started.is_err() {
                break;
            }
        }
        drop(at_work);
        while all_done.recv_timeout(LOOK) == Err(RecvTimeoutError::Timeout) {
            watch();
        }
        // What is left where no thread could be started.
        queue.work_off(&work);
    });
    queue.into_results()
}

/// Items that wait, and the results of those that are done.
struct Queue<T, R> {
    waiting: Mutex<std::iter::Enumerate<std::vec::IntoIter<T>>>,
    results: Mutex<Vec<(usize, R)>>,
}

impl<T, R> Queue<T, R> {
    fn new(items: Vec<T>) -> Self {
        Self {
            results: Mutex::new(Vec::with_capacity(items.len())),
            waiting: Mutex::new(items.into_iter().enumerate()),
        }
    }

    fn work_off(&self, work: &impl Fn(T) -> R) {
        let take = || self.waiting.lock().ok()?.next();
        while let Some((index, item)) = take() {
            let done = work(item);
            let mut results = self.results.lock().expect("nothing panics with it");
            results.push((index, done));
        }
    }

    fn into_results(self) -> Vec<R> {
        let mut results = self.results.into_inner().expect("nothing panics with it");
        results.sort_by_key(|(index, _)| *index);
        results.into_iter().map(|(_, result)| result).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_in_the_order_of_the_items() {
        for threads in [1, 2, 7, 1000] {
            let items: Vec<u32> = (0..20).collect();
            let expected: Vec<u32> = items.iter().map(|item| item * item).collect();
            let squared = |item: u32| item * item;
            assert_eq!(in_parallel(items.clone(), threads, squared), expected);
            let mut looks = 0;
            let mut watch = || looks += 1;
            let watched = in_parallel_watched(items, threads, squared, &mut watch);
            assert_eq!(watched, expected);
        }
    }
}
