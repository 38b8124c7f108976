//! Items that wait, and the results of those that are done.

use std::iter::Enumerate;
use std::sync::Mutex;
use std::vec::IntoIter;

pub(crate) struct Queue<T, R> {
    waiting: Mutex<Enumerate<IntoIter<T>>>,
    results: Mutex<Vec<(usize, R)>>,
}

impl<T, R> Queue<T, R> {
    pub(crate) fn new(items: Vec<T>) -> Self {
        Self {
            results: Mutex::new(Vec::with_capacity(items.len())),
            waiting: Mutex::new(items.into_iter().enumerate()),
        }
    }

    /// Works on one item after the other until none is left.
    pub(crate) fn work_off(&self, mut work: impl FnMut(T) -> R) {
        let take = || self.waiting.lock().ok()?.next();
        while let Some((index, item)) = take() {
            let done = work(item);
            let mut results = self.results.lock().expect("nothing panics with it");
            results.push((index, done));
        }
    }

    /// In the order of the items.
    pub(crate) fn into_results(self) -> Vec<R> {
        let mut results = self.results.into_inner().expect("nothing panics with it");
        results.sort_unstable_by_key(|(index, _)| *index);
        results.into_iter().map(|(_, result)| result).collect()
    }
}
