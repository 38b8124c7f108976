//! Work shared out among threads.

use std::sync::Mutex;
use std::thread::Builder;

/// Pieces of work for each thread: the largest first, to whom has the least.
pub(crate) fn largest_first<P>(
    pieces: impl Iterator<Item = P>,
    threads: usize,
    size: impl Fn(&P) -> f64,
) -> Vec<Vec<P>> {
    let mut sized: Vec<(f64, P)> = pieces.map(|piece| (size(&piece), piece)).collect();
    sized.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut shares: Vec<(f64, Vec<P>)> = (0..threads).map(|_| (0.0, Vec::new())).collect();
    for (size, piece) in sized {
        let least = shares.iter_mut().min_by(|a, b| a.0.total_cmp(&b.0));
        let share = least.expect("one thread at least");
        share.0 += size;
        share.1.push(piece);
    }
    shares.into_iter().map(|share| share.1).collect()
}

/// Pieces of work for each thread: in turns.
pub(crate) fn in_turns<P>(pieces: impl Iterator<Item = P>, threads: usize) -> Vec<Vec<P>> {
    let mut shares: Vec<Vec<P>> = (0..threads).map(|_| Vec::new()).collect();
    for (k, piece) in pieces.enumerate() {
        shares[k % threads].push(piece);
    }
    shares
}

/// Does the pieces of every share on a thread of its own, each with its workspace; the
/// first on this one, and those for which no thread can be started. Results are in
/// no particular order.
pub(crate) fn work_off<P: Send, D: Send, R: Send>(
    shares: Vec<Vec<P>>,
    workspaces: impl Iterator<Item = D>,
    work: impl Fn(P, &mut D) -> R + Sync,
) -> Vec<R> {
    let shares = shares.into_iter().zip(workspaces);
    let shares = shares.filter(|(pieces, _)| !pieces.is_empty());
    // What no thread takes is still there.
    let shares: Vec<_> = shares.map(|share| Mutex::new(Some(share))).collect();
    let work_off = |share: &Mutex<Option<(Vec<P>, D)>>| -> Vec<R> {
        let taken = share.lock().ok().and_then(|mut share| share.take());
        let Some((pieces, mut workspace)) = taken else {
            return Vec::new();
        };
        let done = pieces.into_iter().map(|piece| work(piece, &mut workspace));
        done.collect()
    };
    let Some((mine, others)) = shares.split_first() else {
        return Vec::new();
    };
    let work_off = &work_off;
    std::thread::scope(|scope| {
        let start = |share| Builder::new().spawn_scoped(scope, move || work_off(share));
        let started: Vec<_> = others.iter().map(start).collect();
        let mut results = work_off(mine);
        for (share, thread) in others.iter().zip(started) {
            results.extend(match thread {
                Ok(thread) => thread.join().expect("work does not panic"),
                Err(_) => work_off(share),
            });
        }
        results
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_piece_is_done_once() {
        for threads in [1, 2, 5] {
            let sizes = [3.0, 1.0, 4.0, 1.0, 5.0, 9.0, 2.0, 6.0];
            for shares in [
                largest_first(sizes.into_iter(), threads, |size| *size),
                in_turns(sizes.into_iter(), threads),
            ] {
                let mut done = work_off(shares, 0..threads, |size, _| size);
                done.sort_by(f64::total_cmp);
                assert_eq!(done, [1.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 9.0]);
            }
        }
    }

    #[test]
    fn shares_are_about_equal() {
        let shares = largest_first([5.0, 4.0, 3.0, 3.0, 3.0].into_iter(), 2, |size| *size);
        let sums: Vec<f64> = shares.iter().map(|share| share.iter().sum()).collect();
        assert_eq!(sums, [8.0, 10.0]);
    }
}
