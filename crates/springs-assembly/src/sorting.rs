//! Sorting where a small number decides first.

/// The items in their order, in which the row of each decides first: sorted by counting, and
/// then row by row, which are short.
///
/// # Panics
///
/// If a row is not below `n_rows`.
pub(crate) fn sorted_by_rows<T: Ord + Copy>(
    items: &[T],
    n_rows: usize,
    row: impl Fn(&T) -> usize,
) -> Vec<T> {
    let mut ends = vec![0; n_rows];
    for item in items {
        ends[row(item)] += 1;
    }
    let mut n_before = 0;
    for end in &mut ends {
        // Where the row begins, until its items are there.
        n_before += std::mem::replace(end, n_before);
    }
    let mut sorted = items.to_vec();
    for item in items {
        let end = &mut ends[row(item)];
        sorted[*end] = *item;
        *end += 1;
    }
    let mut begin = 0;
    for end in ends {
        sorted[begin..end].sort_unstable();
        begin = end;
    }
    sorted
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear_runs::tests::Dice;

    #[test]
    fn items_are_sorted() {
        let mut dice = Dice(3);
        for (n_items, n_rows) in [(0, 0), (0, 5), (1, 1), (300, 7), (300, 1000)] {
            let mut item = |_| [n_rows, 50].map(|n| (dice.roll() * n as f64) as usize);
            let items: Vec<[usize; 2]> = (0..n_items).map(&mut item).collect();
            let mut expected = items.clone();
            expected.sort();
            assert_eq!(sorted_by_rows(&items, n_rows, |item| item[0]), expected);
        }
    }
}
