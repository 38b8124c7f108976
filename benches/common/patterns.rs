//! Patterns of cloth and blocks with random matrices, and pairs of timings.

// Every benchmark takes what it needs.
#![allow(dead_code, unreachable_pub)]

use std::time::Instant;

/// Coupled blocks and where they are.
pub struct Pattern {
    pub name: String,
    pub positions: Vec<[f64; 3]>,
    pub pairs: Vec<[u32; 2]>,
}

/// A lattice of the given size, each block coupled with those at the offsets.
fn lattice(name: String, size: [i32; 3], offsets: &[[i32; 3]]) -> Pattern {
    let [nx, ny, nz] = size;
    let index = |[x, y, z]: [i32; 3]| ((x * ny + y) * nz + z) as u32;
    let is_inside = |at: [i32; 3]| at.iter().zip(size).all(|(at, n)| (0..n).contains(at));
    let (mut positions, mut pairs) = (Vec::new(), Vec::new());
    for at in (0..nx * ny * nz).map(|k| [k / nz / ny, k / nz % ny, k % nz]) {
        positions.push(at.map(f64::from));
        for offset in offsets {
            let to = std::array::from_fn(|axis| at[axis] + offset[axis]);
            if is_inside(to) {
                pairs.push([index(at), index(to)]);
            }
        }
    }
    Pattern {
        name,
        positions,
        pairs,
    }
}

/// Structural, shear and bend springs of n × n nodes.
pub fn cloth(n: i32) -> Pattern {
    let offsets = [
        [1, 0, 0],
        [0, 1, 0],
        [1, 1, 0],
        [1, -1, 0],
        [2, 0, 0],
        [0, 2, 0],
    ];
    lattice(format!("cloth {n}"), [n, n, 1], &offsets)
}

/// Edges and face diagonals of n × n × n nodes.
pub fn block(n: i32) -> Pattern {
    let offsets = [
        [1, 0, 0],
        [0, 1, 0],
        [0, 0, 1],
        [1, 1, 0],
        [1, -1, 0],
        [0, 1, 1],
        [0, 1, -1],
        [1, 0, 1],
        [1, 0, -1],
    ];
    lattice(format!("block {n}"), [n; 3], &offsets)
}

/// A sequence of numbers in −1 … 1 that look random (an LCG of Knuth).
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005);
        self.0 = self.0.wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / 2f64.powi(52) - 1.0
    }

    pub fn vector(&mut self) -> [f64; 3] {
        [self.next(), self.next(), self.next()]
    }
}

/// u uᵀ, packed.
fn packed_square(u: [f64; 3]) -> [f64; 6] {
    [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].map(|(row, column)| u[row] * u[column])
}

fn add(sum: &mut [f64; 6], block: [f64; 6]) {
    for (sum, entry) in sum.iter_mut().zip(block) {
        *sum += entry;
    }
}

/// The identity, and for every pair k(n nᵀ + I/10) as a spring couples it.
pub fn symmetric_blocks(pattern: &Pattern, k: f64) -> (Vec<[f64; 6]>, Vec<[f64; 6]>) {
    let mut random = Random(7);
    let mut diagonal = vec![[1.0, 0.0, 0.0, 1.0, 0.0, 1.0]; pattern.positions.len()];
    let off_diagonal = pattern.pairs.iter().map(|pair| {
        let mut block = packed_square(random.vector());
        add(&mut block, [0.1, 0.0, 0.0, 0.1, 0.0, 0.1]);
        let block = block.map(|entry| k * entry);
        for &end in pair {
            add(&mut diagonal[end as usize], block);
        }
        block.map(|entry| -entry)
    });
    let off_diagonal = off_diagonal.collect();
    (diagonal, off_diagonal)
}

/// The same, and for every pair w wᵀ with six numbers w.
pub fn general_blocks(pattern: &Pattern, k: f64) -> (Vec<[f64; 6]>, Vec<[f64; 9]>) {
    let mut random = Random(9);
    let (mut diagonal, symmetric) = symmetric_blocks(pattern, k);
    let off_diagonal = pattern.pairs.iter().zip(symmetric).map(|(pair, block)| {
        let w = [random.vector(), random.vector()];
        for (&end, w) in pair.iter().zip(w) {
            add(&mut diagonal[end as usize], packed_square(w));
        }
        let [xx, xy, xz, yy, yz, zz] = block;
        let mut general = [xx, xy, xz, xy, yy, yz, xz, yz, zz];
        for (k, entry) in general.iter_mut().enumerate() {
            *entry += w[0][k / 3] * w[1][k % 3];
        }
        general
    });
    let off_diagonal = off_diagonal.collect();
    (diagonal, off_diagonal)
}

/// Times of several pieces of work that took turns.
pub struct Turns {
    /// In s, of each piece: those of all turns.
    times: Vec<Vec<f64>>,
}

impl Turns {
    /// Lets the pieces take turns, once for nothing and then for about so many
    /// seconds.
    pub fn take(seconds: f64, work: &mut [&mut dyn FnMut()]) -> Self {
        let time = |work: &mut dyn FnMut()| {
            let begin = Instant::now();
            work();
            begin.elapsed().as_secs_f64()
        };
        let first: f64 = work.iter_mut().map(|work| time(*work)).sum();
        let turns = (seconds / first).clamp(5.0, 300.0) as usize;
        let mut times = vec![Vec::new(); work.len()];
        for _ in 0..turns {
            for (times, work) in times.iter_mut().zip(work.iter_mut()) {
                times.push(time(*work));
            }
        }
        Self { times }
    }

    /// The least time of a piece, in ms.
    pub fn milliseconds(&self, piece: usize) -> f64 {
        1e3 * self.times[piece]
            .iter()
            .copied()
            .fold(f64::INFINITY, f64::min)
    }

    /// The median of the ratios of one piece to another of the same turn, and half
    /// the distance of the quartiles.
    pub fn ratio(&self, piece: usize, to: usize) -> (f64, f64) {
        let both = self.times[piece].iter().zip(&self.times[to]);
        let mut ratios: Vec<f64> = both.map(|(piece, to)| piece / to).collect();
        ratios.sort_by(f64::total_cmp);
        let at = |part: usize| ratios[part * (ratios.len() - 1) / 4];
        (at(2), (at(3) - at(1)) / 2.0)
    }
}
