//! Elimination of one dense symmetric front that may be indefinite.

use crate::Interrupt;
use crate::direct::kernels::subtract_multiple;

/// A pivot is taken if the entries of its column are at most 1/u times as large.
const U: f64 = 0.01;

/// One or two rows that are eliminated at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Pivot {
    /// No entry of its column exceeds the limit: it counts as zero.
    Zero,
    /// A row of its own.
    One(f64),
    /// Two rows, with the entries (1, 1), (1, 2) and (2, 2).
    Two([f64; 3]),
}

/// A front: the lower triangle of a dense symmetric matrix, by columns.
pub(crate) struct Dense<'a> {
    pub(crate) n: usize,
    pub(crate) a: &'a mut [f64],
    /// What its rows are; they move with them.
    pub(crate) rows: &'a mut [u32],
    /// Pivots up to this count as zero.
    pub(crate) limit: f64,
}

impl Dense<'_> {
    #[inline]
    fn at(&self, i: usize, j: usize) -> f64 {
        let (row, column) = if i < j { (j, i) } else { (i, j) };
        self.a[column * self.n + row]
    }

    /// Exchanges rows and columns p and q.
    fn swap(&mut self, p: usize, q: usize) {
        if p == q {
            return;
        }
        let (p, q, n) = (p.min(q), p.max(q), self.n);
        self.rows.swap(p, q);
        let place = |i: usize, j: usize| if i < j { i * n + j } else { j * n + i };
        for k in (0..n).filter(|&k| k != p && k != q) {
            self.a.swap(place(p, k), place(q, k));
        }
        self.a.swap(p * n + p, q * n + q);
    }

    /// Eliminates as many of the first `n_summed` rows as have a pivot that is large
    /// enough within its column (Duff and Reid, ACM TOMS 9, 1983), which come first then;
    /// those left are for the parent. At a root there is none, and all are eliminated.
    /// Columns become those of L, below the pivots. `None` if it is interrupted.
    pub(crate) fn eliminate(
        &mut self,
        n_summed: usize,
        is_root: bool,
        interrupt: &Interrupt,
    ) -> Option<Vec<Pivot>> {
        let mut pivots = Vec::new();
        let (mut k, mut end) = (0, n_summed);
        while k < end {
            if interrupt.is_requested() {
                return None;
            }
            // Small pivots last: they are what rounding of larger ones has left.
            self.swap(k, self.largest_on_diagonal(k, end));
            let width = match self.pivot_at(k, end, n_summed) {
                Some(pivot) => self.take(pivot, k, &mut pivots),
                None => {
                    end -= 1;
                    self.swap(k, end);
                    if k < end {
                        continue;
                    }
                    if !is_root {
                        break;
                    }
                    let pivot = self.largest(k, n_summed);
                    self.take(pivot, k, &mut pivots)
                }
            };
            k += width;
            // What was not large enough may be so now.
            end = n_summed;
        }
        Some(pivots)
    }

    fn largest_on_diagonal(&self, k: usize, end: usize) -> usize {
        let size = |row: &usize| self.at(*row, *row).abs();
        let largest = (k..end).reduce(|a, b| if size(&b) > size(&a) { b } else { a });
        largest.unwrap_or(k)
    }

    /// A pivot with row k, which the second row is brought next to.
    fn pivot_at(&mut self, k: usize, end: usize, n_summed: usize) -> Option<Pivot> {
        let n = self.n;
        let (mut largest, mut partner) = (0.0f64, None);
        let column = &self.a[k * n..(k + 1) * n];
        for (i, entry) in column.iter().enumerate().skip(k + 1) {
            if entry.abs() > largest {
                largest = entry.abs();
                if i < n_summed {
                    partner = Some(i);
                }
            }
        }
        let own = column[k];
        if own.abs() <= self.limit && largest <= self.limit {
            return Some(Pivot::Zero);
        }
        if own.abs() > self.limit && own.abs() >= U * largest {
            return Some(Pivot::One(own));
        }
        let other = partner.filter(|&partner| partner < end)?;
        let (cross, second) = (self.at(other, k), self.at(other, other));
        let determinant = own * second - cross * cross;
        let (mut of_first, mut of_second) = (0.0f64, 0.0f64);
        for i in (k + 1..n).filter(|&i| i != other) {
            of_first = of_first.max(self.at(i, k).abs());
            of_second = of_second.max(self.at(i, other).abs());
        }
        let size = determinant.abs() / U;
        let is_large = second.abs() * of_first + cross.abs() * of_second <= size
            && cross.abs() * of_first + own.abs() * of_second <= size
            && determinant.abs() > self.limit * self.limit;
        is_large.then(|| {
            self.swap(k + 1, other);
            Pivot::Two([own, cross, second])
        })
    }

    /// The pivot with the largest entry of all rows left (Bunch and Parlett, SIAM J.
    /// Numer. Anal. 8, 1971), brought to row k.
    fn largest(&mut self, k: usize, end: usize) -> Pivot {
        let (mut on, mut off) = ((k, 0.0f64), ((k, k), 0.0f64));
        for j in k..end {
            for i in j..end {
                let size = self.at(i, j).abs();
                if i == j && size > on.1 {
                    on = (i, size);
                } else if i != j && size > off.1 {
                    off = ((i, j), size);
                }
            }
        }
        if on.1.max(off.1) <= self.limit {
            return Pivot::Zero;
        }
        // (1 + √17)/8, from the paper.
        const ALPHA: f64 = 0.640_388_203_202_207_6;
        if on.1 >= ALPHA * off.1 {
            self.swap(k, on.0);
            return Pivot::One(self.at(k, k));
        }
        let (i, j) = off.0;
        self.swap(k, j);
        self.swap(k + 1, i);
        Pivot::Two([self.at(k, k), self.at(k + 1, k), self.at(k + 1, k + 1)])
    }

    /// Eliminates the pivot at row k; how many rows that are.
    fn take(&mut self, pivot: Pivot, k: usize, pivots: &mut Vec<Pivot>) -> usize {
        let n = self.n;
        pivots.push(pivot);
        match pivot {
            Pivot::Zero => {
                self.a[k * n + k + 1..(k + 1) * n].fill(0.0);
                1
            }
            Pivot::One(d) => {
                let (done, rest) = self.a.split_at_mut((k + 1) * n);
                let column = &mut done[k * n..];
                for (j, target) in (k + 1..n).zip(rest.chunks_exact_mut(n)) {
                    let factor = column[j] / d;
                    if factor != 0.0 {
                        subtract_multiple(&mut target[j..], &column[j..], factor);
                    }
                    // The columns after j need those of row j no more.
                    column[j] = factor;
                }
                1
            }
            Pivot::Two([first, cross, second]) => {
                let (done, rest) = self.a.split_at_mut((k + 2) * n);
                let (of_first, of_second) = done[k * n..].split_at_mut(n);
                // Scaled by the cross entry, which is the largest.
                let (p, q) = (first / cross, second / cross);
                let scale = 1.0 / (cross * (p * q - 1.0));
                for (j, target) in (k + 2..n).zip(rest.chunks_exact_mut(n)) {
                    let (x, y) = (of_first[j], of_second[j]);
                    let l = (q * x - y) * scale;
                    let m = (p * y - x) * scale;
                    if l != 0.0 || m != 0.0 {
                        subtract_multiple(&mut target[j..], &of_first[j..], l);
                        subtract_multiple(&mut target[j..], &of_second[j..], m);
                    }
                    (of_first[j], of_second[j]) = (l, m);
                }
                of_first[k + 1] = 0.0;
                2
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    /// P A Pᵀ = L D Lᵀ at a root, and Sylvester's law.
    fn check(a: &DMatrix<f64>) {
        let n = a.nrows();
        let mut values = a.as_slice().to_vec();
        let mut rows: Vec<u32> = (0..n as u32).collect();
        let mut dense = Dense {
            n,
            a: &mut values,
            rows: &mut rows,
            limit: 1e-12,
        };
        let pivots = dense.eliminate(n, true, &Interrupt::default()).unwrap();
        let (mut l, mut d) = (DMatrix::identity(n, n), DMatrix::zeros(n, n));
        let mut k = 0;
        let mut negative = 0;
        for pivot in pivots {
            let width = match pivot {
                Pivot::Zero => 1,
                Pivot::One(own) => {
                    d[(k, k)] = own;
                    negative += usize::from(own < 0.0);
                    1
                }
                Pivot::Two([first, cross, second]) => {
                    d[(k, k)] = first;
                    d[(k, k + 1)] = cross;
                    d[(k + 1, k)] = cross;
                    d[(k + 1, k + 1)] = second;
                    negative += 1;
                    assert!(first * second < cross * cross);
                    2
                }
            };
            for column in k..k + width {
                for row in k + width..n {
                    l[(row, column)] = values[column * n + row];
                }
            }
            k += width;
        }
        let product = &l * d * l.transpose();
        for (i, &row) in rows.iter().enumerate() {
            for (j, &column) in rows.iter().enumerate() {
                let expected = a[(row as usize, column as usize)];
                assert!((product[(i, j)] - expected).abs() < 1e-12, "{i} {j}");
            }
        }
        let eigenvalues = a.clone().symmetric_eigenvalues();
        let expected = eigenvalues.iter().filter(|value| **value < -1e-12).count();
        assert_eq!(negative, expected);
    }

    #[test]
    fn factors_and_inertia_are_those_of_the_matrix() {
        check(&DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 1.0, 0.0]));
        check(&DMatrix::zeros(3, 3));
        check(&DMatrix::from_fn(4, 4, |_, _| -1.0));
        // Pseudo-random and saddle-like ones.
        let mut seed = 1u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 33) as f64 / 2f64.powi(31) - 0.5
        };
        for n in 1..12 {
            let b = DMatrix::from_fn(n, n, |_, _| random());
            check(&(&b + b.transpose()));
            let mut saddle = DMatrix::zeros(2 * n, 2 * n);
            saddle.view_mut((0, n), (n, n)).copy_from(&b);
            saddle.view_mut((n, 0), (n, n)).copy_from(&b.transpose());
            check(&saddle);
        }
    }
}
