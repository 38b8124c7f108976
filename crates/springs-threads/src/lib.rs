//! The same work on many items, on at most so many threads.
//!
//! [`in_parallel`] gives results in the order of the items whoever did them, so they
//! have the same bits for any number of threads as long as the work on one item does
//! not depend on the others. [`with_threads`] keeps the threads for several such calls.
//!
//! ```
//! let squares = springs_threads::in_parallel(vec![1, 2, 3], 2, |item| item * item);
//! assert_eq!(squares, [1, 4, 9]);
//! ```
//!
//! # Where the threads are
//!
//! One thread is the one that calls: nothing is started. Several are a rayon pool of
//! exactly so many, which does the work while the calling thread waits, and is lent to
//! one call at a time and kept for the next (`pools.rs`). So
//!
//! - `n` threads are `n`, however many cores the machine has, for each of several
//!   calls at once;
//! - who never asks for two threads has none, and who asks a million times starts them
//!   once.
//!
//! A call from inside a pool uses that pool, and no more than `n` threads of it: parts
//! of some work that are themselves shared out have, all together, the threads of the
//! outermost call. A thread that waits there helps others meanwhile, so that nesting
//! cannot come to a standstill. The same holds for pools of the caller's own, who
//! decides with them how many threads there are.
//!
//! If the system gives fewer threads, the pool has fewer; if it gives none, all is done
//! by the calling thread. A panic of the work is one of the call.

mod pools;
mod queue;

use self::pools::Loan;
use self::queue::Queue;
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use std::sync::Mutex;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// Does `work`, all whose calls of this crate then find `threads` threads, without coming
/// back to the calling one in between.
pub fn with_threads<R: Send>(threads: usize, work: impl FnOnce() -> R + Send) -> R {
    if threads <= 1 || rayon::current_thread_index().is_some() {
        return work();
    }
    match Loan::of(threads).pool() {
        Some(pool) => pool.install(work),
        None => work(),
    }
}

/// Time between two calls of who watches.
const LOOK: Duration = Duration::from_millis(20);

/// The same while the calling thread, which is one more, calls `watch` every 20 ms; it
/// does not where it has to do the work itself.
pub fn with_threads_watched<R: Send>(
    threads: usize,
    work: impl FnOnce() -> R + Send,
    watch: &mut dyn FnMut(),
) -> R {
    let loan = Loan::of(threads);
    let Some(pool) = loan.pool() else {
        return work();
    };
    let mut result = None;
    pool.in_place_scope(|scope| {
        let (at_work, is_done) = channel::<()>();
        let result = &mut result;
        scope.spawn(move |_| {
            // Dropped at the end, even by a panic.
            let _at_work = at_work;
            *result = Some(work());
        });
        while is_done.recv_timeout(LOOK) == Err(RecvTimeoutError::Timeout) {
            watch();
        }
    });
    result.expect("a panic of the work is one of the scope")
}

/// Items with the largest first.
pub fn largest_first<T>(items: impl Iterator<Item = T>, size: impl Fn(&T) -> f64) -> Vec<T> {
    let mut items: Vec<T> = items.collect();
    items.sort_by(|a, b| size(b).total_cmp(&size(a)));
    items
}

/// The threads that [`share_out`] finds where it is called: those of the pool, or one.
pub fn threads_here() -> usize {
    rayon::current_thread_index().map_or(1, |_| rayon::current_num_threads())
}

/// Does `work` on every item, on the threads of the pool that this is called in (see
/// [`with_threads`]), or one after the other; results are in the order of the items.
///
/// For many short items of about the same size, again and again: neighbours go to the same
/// thread, and nothing is queued.
pub fn share_out<T: Send, R: Send>(
    items: impl IntoIterator<Item = T>,
    work: impl Fn(T) -> R + Sync + Send,
) -> Vec<R> {
    let items = items.into_iter();
    if threads_here() <= 1 {
        return items.map(work).collect();
    }
    let items: Vec<T> = items.collect();
    items.into_par_iter().map(work).collect()
}

/// Items of a share where a pass over many short ones, a few vectors each, is shared out.
const SHARE: usize = 4096;
/// Passes over fewer items than so many take less time than to share them out.
const FEW: usize = 4 * SHARE;

/// How many of `n` short items, a few vectors each, a share of a pass over all of them has.
/// `None` where the pass is best left whole. Sums over the items that are added up share by
/// share do not depend on the threads, since this does not.
pub fn share_of_pass(n: usize) -> Option<usize> {
    (n > FEW).then_some(SHARE)
}

/// The same for passes without a sum, which are left whole, too, where there is one thread.
pub fn share_of_pass_here(n: usize) -> Option<usize> {
    share_of_pass(n).filter(|_| threads_here() > 1)
}

/// Does `work` on every item, on `threads` threads at most; results are in the order of
/// the items. Items are begun in their order: the longest should be the first.
pub fn in_parallel<T: Send, R: Send>(
    items: Vec<T>,
    threads: usize,
    work: impl Fn(T) -> R + Sync,
) -> Vec<R> {
    if threads <= 1 || items.len() <= 1 {
        return items.into_iter().map(work).collect();
    }
    // They take no room.
    let mut workspaces = vec![(); threads];
    in_parallel_with(items, &mut workspaces, |item, ()| work(item))
}

/// The same with one of some workspaces for each thread; there are as many threads as
/// workspaces at most.
///
/// # Panics
///
/// If there are items, but no workspace.
pub fn in_parallel_with<T: Send, W: Send, R: Send>(
    items: Vec<T>,
    workspaces: &mut [W],
    work: impl Fn(T, &mut W) -> R + Sync,
) -> Vec<R> {
    let at_once = workspaces.len().min(items.len());
    if at_once <= 1 {
        let work = |item| work(item, &mut workspaces[0]);
        return items.into_iter().map(work).collect();
    }
    let queue = Queue::new(items);
    let threads = workspaces.len();
    let workspaces = Mutex::new(workspaces.iter_mut());
    let work_off = || {
        let workspace = workspaces.lock().ok().and_then(|mut left| left.next());
        if let Some(workspace) = workspace {
            queue.work_off(|item| work(item, workspace));
        }
    };
    with_threads(threads, || {
        // Outside of a pool there is nobody else.
        if rayon::current_thread_index().is_none() {
            return work_off();
        }
        rayon::in_place_scope(|scope| {
            for _ in 1..at_once {
                scope.spawn(|_| work_off());
            }
            work_off();
        });
    });
    queue.into_results()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;
    use std::panic::catch_unwind;
    use std::sync::Barrier;
    use std::thread;

    #[test]
    fn results_are_in_the_order_of_the_items() {
        for threads in [1, 2, 7, 100] {
            let items: Vec<u32> = (0..20).collect();
            let expected: Vec<u32> = items.iter().map(|item| item * item).collect();
            let squares = || in_parallel(items.clone(), threads, |item| item * item);
            assert_eq!(squares(), expected);
            assert_eq!(with_threads_watched(threads, squares, &mut || ()), expected);
        }
        assert_eq!(in_parallel_with(vec![], &mut [(); 0], |(), ()| 1), []);
    }

    #[test]
    fn short_items_are_shared_out_among_the_threads_of_the_pool() {
        let squares = || share_out(0..1000, |item: u64| item * item);
        let expected: Vec<u64> = (0..1000).map(|item| item * item).collect();
        assert_eq!((threads_here(), squares()), (1, expected.clone()));
        for threads in [2, 3, 8] {
            let here = with_threads(threads, || (threads_here(), squares()));
            assert_eq!(here, (threads, expected.clone()));
        }
        // Each waits for the other, so it is another.
        let barrier = Barrier::new(2);
        let meet = |()| {
            barrier.wait();
            thread::current().id()
        };
        let met = with_threads(2, || share_out(vec![(); 2], meet));
        assert_ne!(met[0], met[1]);
    }

    #[test]
    fn every_workspace_is_used_by_one_thread_at_a_time() {
        let mut workspaces = vec![0; 3];
        in_parallel_with(vec![1; 1000], &mut workspaces, |item, sum| *sum += item);
        assert_eq!(workspaces.iter().sum::<i32>(), 1000);
    }

    /// More than any machine has; and no others the next time.
    #[test]
    fn so_many_threads_as_asked_for_are_at_work_and_kept() {
        const N: usize = 301;
        let all_meet = || {
            let barrier = Barrier::new(N);
            let meet = |()| {
                barrier.wait();
                thread::current().id()
            };
            let met = in_parallel(vec![(); N], N, meet);
            HashSet::<thread::ThreadId>::from_iter(met)
        };
        let first = all_meet();
        assert_eq!(first.len(), N);
        assert_eq!(all_meet(), first);
    }

    #[test]
    fn one_thread_is_the_calling_one() {
        let here = thread::current().id();
        let ids = with_threads(1, || {
            in_parallel(vec![(); 9], 1, |()| thread::current().id())
        });
        assert_eq!(ids, [here; 9]);
    }

    /// Parts that are shared out themselves, more of them than threads.
    #[test]
    fn calls_inside_use_the_threads_of_the_outermost() {
        let inner = |part: u64| {
            let ids = |_: u64| thread::current().id();
            let sums = in_parallel((0..50).collect(), 4, |item| part * item);
            (
                sums.iter().sum::<u64>(),
                in_parallel((0..9).collect(), 3, ids),
            )
        };
        let done = with_threads(4, || in_parallel((0..40).collect(), 3, inner));
        let sums: Vec<u64> = done.iter().map(|(sum, _)| *sum).collect();
        assert_eq!(sums, Vec::from_iter((0..40).map(|part| part * 1225)));
        let ids = done.into_iter().flat_map(|(_, ids)| ids);
        assert!(HashSet::<thread::ThreadId>::from_iter(ids).len() <= 4);
    }

    /// Each of them has its own.
    #[test]
    fn several_calls_at_once_do_not_wait_for_each_other() {
        let barrier = Barrier::new(6);
        let meet = |()| barrier.wait();
        thread::scope(|scope| {
            for _ in 0..2 {
                scope.spawn(|| in_parallel(vec![(); 3], 3, meet));
            }
        });
    }

    #[test]
    fn who_watches_is_called_while_others_work() {
        let (looks, seen) = channel();
        let mut watch = || looks.send(()).unwrap();
        let work = || seen.into_iter().take(3).count();
        assert_eq!(with_threads_watched(2, work, &mut watch), 3);
    }

    #[test]
    fn panics_come_to_the_caller_and_break_nothing() {
        let fail = |item| assert!(item != 5, "item {item}");
        for _ in 0..3 {
            let panic = catch_unwind(|| in_parallel((0..9).collect(), 3, fail)).unwrap_err();
            assert_eq!(panic.downcast_ref::<String>().unwrap(), "item 5");
            let watched = || with_threads_watched(3, || fail(5), &mut || ());
            assert!(catch_unwind(watched).is_err());
        }
        assert_eq!(in_parallel(vec![1, 2], 3, |item| item), [1, 2]);
    }
}
