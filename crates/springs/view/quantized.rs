//! Numbers over time in few bytes: rounded to a grid, as differences in time, deflated.
//!
//! A number x of component c is low[c] + step[c] q with a whole q of so many bits, so it is
//! at most half a step off. Frame by frame the page has what q differs from a prediction
//! of its order by the frames before:
//!
//! | order | prediction |
//! | --- | --- |
//! | 0 | 0 |
//! | 1 | q₋₁ |
//! | 2 | 2 q₋₁ − q₋₂ |
//! | 3 | 3 q₋₁ − 3 q₋₂ + q₋₃ |
//!
//! Frame t is predicted with an order of at most t. Differences d are modulo 2¹⁶, signs
//! last ((d << 1) ^ (d >> 15)); of each frame there are all low bytes and then all high
//! bytes, since most of the latter are zero.

use flate2::Compression;
use flate2::write::DeflateEncoder;
use serde::Serialize;
use std::io::Write as _;

/// Numbers of all frames on a grid.
pub(super) struct Quantized {
    grids: Vec<Grid>,
    /// Numbers in a frame.
    width: usize,
    numbers: Vec<u16>,
}

/// The grid of a component.
#[derive(Clone, Copy)]
struct Grid {
    low: f64,
    step: f64,
    most: f64,
}

/// The least and the largest number of each component; numbers take turns.
#[derive(Clone)]
pub(super) struct Ranges(Vec<(f64, f64)>);

impl Ranges {
    pub(super) fn new(n_components: usize) -> Self {
        Self(vec![(f64::INFINITY, f64::NEG_INFINITY); n_components])
    }

    pub(super) fn take(&mut self, numbers: &[f64]) {
        for frame in numbers.chunks(self.0.len()) {
            for (range, number) in self.0.iter_mut().zip(frame) {
                *range = (range.0.min(*number), range.1.max(*number));
            }
        }
    }

    /// Half of the largest step of a grid of so many bits.
    pub(super) fn error(&self, bits: u32) -> f64 {
        let steps = self.0.iter().map(|range| Grid::of(*range, bits).step);
        0.5 * steps.fold(0.0, f64::max)
    }
}

impl Grid {
    fn of((low, high): (f64, f64), bits: u32) -> Self {
        let most = f64::from((1_u32 << bits) - 1);
        if low > high {
            // There are no numbers.
            return Self {
                low: 0.0,
                step: 0.0,
                most,
            };
        }
        Self {
            low,
            step: high / most - low / most,
            most,
        }
    }

    fn index(&self, number: f64) -> u16 {
        if self.step > 0.0 {
            ((number - self.low) / self.step)
                .round()
                .clamp(0.0, self.most) as u16
        } else {
            0
        }
    }
}

/// An array of the page.
#[derive(Serialize)]
pub(super) struct Packed {
    /// Numbers in a frame.
    pub(super) width: usize,
    pub(super) low: Vec<f64>,
    pub(super) step: Vec<f64>,
    pub(super) order: usize,
    #[serde(skip)]
    pub(super) bytes: Vec<u8>,
}

impl Quantized {
    pub(super) fn new(ranges: &Ranges, width: usize, bits: u32) -> Self {
        Self {
            grids: ranges
                .0
                .iter()
                .map(|range| Grid::of(*range, bits))
                .collect(),
            width,
            numbers: Vec::new(),
        }
    }

    /// Appends a frame.
    pub(super) fn push(&mut self, numbers: &[f64]) {
        let grids = self.grids.iter().cycle();
        let indices = numbers.iter().zip(grids);
        self.numbers
            .extend(indices.map(|(number, grid)| grid.index(*number)));
    }

    /// The array with the order of prediction that leaves the smallest differences.
    pub(super) fn pack(&self) -> Packed {
        let sizes = (0..=MOST_ORDER).map(|order| {
            let differences = self.frames().map(|frame| self.differences(frame, order));
            let bits = differences
                .flatten()
                .map(|one| u64::from(u16::BITS - one.leading_zeros()));
            (bits.sum::<u64>(), order)
        });
        let (_, order) = sizes.min().unwrap_or_default();
        let mut bytes = Deflated::default();
        for frame in self.frames() {
            let differences: Vec<u16> = self.differences(frame, order).collect();
            bytes.push(differences.iter().map(|one| one.to_le_bytes()[0]));
            bytes.push(differences.iter().map(|one| one.to_le_bytes()[1]));
        }
        Packed {
            width: self.width,
            low: self.grids.iter().map(|grid| grid.low).collect(),
            step: self.grids.iter().map(|grid| grid.step).collect(),
            order,
            bytes: bytes.finish(),
        }
    }

    fn frames(&self) -> std::ops::Range<usize> {
        0..self.numbers.len().checked_div(self.width).unwrap_or(0)
    }

    /// Of a frame from what is predicted, signs last.
    fn differences(&self, frame: usize, order: usize) -> impl Iterator<Item = u16> {
        let numbers = &self.numbers;
        let start = frame * self.width;
        let coefficients = PREDICTIONS[order.min(frame)];
        (start..start + self.width).map(move |index| {
            let mut difference = numbers[index];
            for (back, coefficient) in coefficients.iter().enumerate() {
                let before = numbers[index - (back + 1) * self.width];
                difference = difference.wrapping_sub(before.wrapping_mul(*coefficient));
            }
            let signed = difference as i16;
            ((signed << 1) ^ (signed >> 15)) as u16
        })
    }
}

const MOST_ORDER: usize = 3;
/// Coefficients of the frames before, modulo 2¹⁶.
const PREDICTIONS: [&[u16]; MOST_ORDER + 1] = [
    &[],
    &[1],
    &[2, 1_u16.wrapping_neg()],
    &[3, 3_u16.wrapping_neg(), 1],
];

/// Bytes that are deflated (RFC 1951) on the way.
pub(super) struct Deflated(DeflateEncoder<Vec<u8>>);

impl Default for Deflated {
    fn default() -> Self {
        Self(DeflateEncoder::new(Vec::new(), Compression::default()))
    }
}

impl Deflated {
    pub(super) fn push(&mut self, bytes: impl Iterator<Item = u8>) {
        let bytes: Vec<u8> = bytes.collect();
        self.0.write_all(&bytes).expect("writing to memory");
    }

    pub(super) fn finish(self) -> Vec<u8> {
        self.0.finish().expect("writing to memory")
    }
}

/// Bytes as text, after RFC 4648.
pub(super) fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for group in bytes.chunks(3) {
        let byte = |index: usize| u32::from(group.get(index).copied().unwrap_or(0));
        let word = byte(0) << 16 | byte(1) << 8 | byte(2);
        for letter in 0..4 {
            if letter <= group.len() {
                let index = word >> (18 - 6 * letter) & 63;
                text.push(char::from(LETTERS[index as usize]));
            } else {
                text.push('=');
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The examples of RFC 4648.
    #[test]
    fn bytes_are_text() {
        let pairs = [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foobar", "Zm9vYmFy"),
        ];
        for (bytes, text) in pairs {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
    }

    /// A parabola is predicted to rounding by the third order, a constant by the first.
    #[test]
    fn the_order_fits_the_motion() {
        let of = |motion: fn(f64) -> f64| {
            let mut ranges = Ranges::new(1);
            ranges.take(&[0.0, 1e4]);
            let mut quantized = Quantized::new(&ranges, 1, 16);
            for frame in 0..50 {
                quantized.push(&[motion(f64::from(frame))]);
            }
            quantized.pack()
        };
        assert_eq!(of(|_| 7.0).order, 1);
        assert_eq!(of(|t| 200.0 * t).order, 2);
        assert_eq!(of(|t| 4.0 * t * t).order, 3);
        assert_eq!(of(|t| if t > 48.0 { 9e3 } else { 0.0 }).order, 0);
    }

    #[test]
    fn no_numbers_are_no_bytes() {
        let packed = Quantized::new(&Ranges::new(3), 0, 16).pack();
        assert_eq!((packed.width, packed.low[0], packed.step[0]), (0, 0.0, 0.0));
    }
}
