//! The least and the largest of some numbers.

use super::words::short;
use serde::Serialize;
use std::fmt;

/// The least and the largest of some numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Range {
    /// The least.
    pub least: f64,
    /// The index of the node or spring that has it; of several the first.
    pub at_least: usize,
    /// The largest.
    pub most: f64,
    /// The index of the node or spring that has it; of several the first.
    pub at_most: usize,
    /// How many numbers there are.
    pub count: usize,
}

impl Range {
    /// Of numbers with their indices; `None` if there are none.
    pub(crate) fn of(numbers: impl Iterator<Item = (usize, f64)>) -> Option<Self> {
        let one = numbers.map(|(index, number)| Self {
            least: number,
            at_least: index,
            most: number,
            at_most: index,
            count: 1,
        });
        one.reduce(|sum, one| {
            let low = if one.least < sum.least { one } else { sum };
            let high = if one.most > sum.most { one } else { sum };
            Self {
                least: low.least,
                at_least: low.at_least,
                most: high.most,
                at_most: high.at_most,
                count: sum.count + 1,
            }
        })
    }
}

/// "2 to 3", or "2" where four digits do not tell them apart.
impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (least, most) = (short(self.least), short(self.most));
        if least == most {
            f.write_str(&least)
        } else {
            write!(f, "{least} to {most}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_know_where_their_ends_are() {
        let range = Range::of([3.0, 1.0, 4.0, 1.0, 4.0].into_iter().enumerate()).unwrap();
        assert_eq!((range.at_least, range.at_most, range.count), (1, 2, 5));
        assert_eq!(range.to_string(), "1 to 4");
        let one = Range::of([(7, 1.00001), (8, 1.00002)].into_iter()).unwrap();
        assert_eq!(one.to_string(), "1");
        assert_eq!(Range::of(std::iter::empty()), None);
    }
}
