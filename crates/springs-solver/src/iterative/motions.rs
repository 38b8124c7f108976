//! Motions of aggregates: what blocks do when their aggregate moves.
//!
//! The coarse unknowns of an aggregate are a translation t and, where it may turn, a
//! rotation w = R ω about its centre, with the root mean square R of the distances of its
//! nodes: all of them lengths. A block with D unknowns takes part in the M motions of its
//! aggregate.

use crate::block::dot;

/// How one block takes part.
pub(crate) trait Motion<const D: usize, const M: usize>:
    Copy + Send + Sync + 'static
{
    /// How many of the last motions are rotations.
    const N_ROTATIONS: usize;

    /// Of a block at an arm a/R from the centre, and with radius r at r/R if it turns
    /// itself.
    fn at(arm: [f64; 3], radius: f64) -> Self;

    /// Of a block in an aggregate.
    fn in_whole(block: &Place, whole: &Place) -> Self {
        let part = |length: f64| {
            if whole.radius > 0.0 {
                length / whole.radius
            } else {
                0.0
            }
        };
        // What nothing turns may turn by any part.
        let radius = if block.radius > 0.0 {
            part(block.radius)
        } else {
            1.0
        };
        Self::at(whole.arm_to(block).map(part), radius)
    }

    /// What the block does in a motion of its aggregate.
    fn prolong(&self, motion: &[f64; M]) -> [f64; D];

    /// The transposed: what a force on the block is to the motions of its aggregate.
    fn restrict(&self, force: &[f64; D]) -> [f64; M];
}

/// Blocks only move along with their aggregates.
#[derive(Clone, Copy)]
pub(crate) struct Along;

/// Blocks are points of aggregates that turn, too.
#[derive(Clone, Copy)]
pub(crate) struct Point<const D: usize> {
    arm: [f64; D],
}

/// Blocks are aggregates that turn themselves, in D dimensions.
#[derive(Clone, Copy)]
pub(crate) struct Body<const D: usize> {
    point: Point<D>,
    radius: f64,
}

impl<const D: usize> Motion<D, D> for Along {
    const N_ROTATIONS: usize = 0;

    fn at(_: [f64; 3], _: f64) -> Self {
        Self
    }

    #[inline(always)]
    fn prolong(&self, motion: &[f64; D]) -> [f64; D] {
        *motion
    }

    #[inline(always)]
    fn restrict(&self, force: &[f64; D]) -> [f64; D] {
        *force
    }
}

impl Motion<3, 6> for Point<3> {
    const N_ROTATIONS: usize = 3;

    fn at(arm: [f64; 3], _: f64) -> Self {
        Self { arm }
    }

    #[inline(always)]
    fn prolong(&self, &[t, u, v, p, q, r]: &[f64; 6]) -> [f64; 3] {
        let [x, y, z] = self.arm;
        [t + q * z - r * y, u + r * x - p * z, v + p * y - q * x]
    }

    #[inline(always)]
    fn restrict(&self, &[f, g, h]: &[f64; 3]) -> [f64; 6] {
        let [x, y, z] = self.arm;
        [f, g, h, y * h - z * g, z * f - x * h, x * g - y * f]
    }
}

impl Motion<2, 3> for Point<2> {
    const N_ROTATIONS: usize = 1;

    fn at([x, y, _]: [f64; 3], _: f64) -> Self {
        Self { arm: [x, y] }
    }

    #[inline(always)]
    fn prolong(&self, &[t, u, w]: &[f64; 3]) -> [f64; 2] {
        let [x, y] = self.arm;
        [t - w * y, u + w * x]
    }

    #[inline(always)]
    fn restrict(&self, &[f, g]: &[f64; 2]) -> [f64; 3] {
        let [x, y] = self.arm;
        [f, g, x * g - y * f]
    }
}

impl Motion<6, 6> for Body<3> {
    const N_ROTATIONS: usize = 3;

    fn at(arm: [f64; 3], radius: f64) -> Self {
        let point = Point::at(arm, radius);
        Self { point, radius }
    }

    #[inline(always)]
    fn prolong(&self, motion: &[f64; 6]) -> [f64; 6] {
        let [t, u, v] = self.point.prolong(motion);
        let [p, q, r] = [motion[3], motion[4], motion[5]].map(|w| self.radius * w);
        [t, u, v, p, q, r]
    }

    #[inline(always)]
    fn restrict(&self, &[f, g, h, k, l, m]: &[f64; 6]) -> [f64; 6] {
        let mut moments = self.point.restrict(&[f, g, h]);
        for (sum, moment) in moments[3..].iter_mut().zip([k, l, m]) {
            *sum += self.radius * moment;
        }
        moments
    }
}

impl Motion<3, 3> for Body<2> {
    const N_ROTATIONS: usize = 1;

    fn at(arm: [f64; 3], radius: f64) -> Self {
        let point = Point::<2>::at(arm, radius);
        Self { point, radius }
    }

    #[inline(always)]
    fn prolong(&self, motion: &[f64; 3]) -> [f64; 3] {
        let [t, u] = self.point.prolong(motion);
        [t, u, self.radius * motion[2]]
    }

    #[inline(always)]
    fn restrict(&self, &[f, g, m]: &[f64; 3]) -> [f64; 3] {
        let mut moments = self.point.restrict(&[f, g]);
        moments[2] += self.radius * m;
        moments
    }
}

/// Where the nodes of a block are.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Place {
    /// How many there are.
    pub(crate) weight: f64,
    /// Their centre.
    pub(crate) centre: [f64; 3],
    /// The root mean square of their distances from it.
    pub(crate) radius: f64,
}

impl Place {
    /// One node.
    pub(crate) fn node(position: [f64; 3]) -> Self {
        Self {
            weight: 1.0,
            centre: position,
            radius: 0.0,
        }
    }

    /// Of all nodes of some blocks, in any order but always the same one. Everything is
    /// relative to one of them: nothing depends on where the origin is.
    pub(crate) fn around<'a>(blocks: impl Iterator<Item = &'a Self> + Clone) -> Self {
        let weight: f64 = blocks.clone().map(|block| block.weight).sum();
        let Some(first) = blocks.clone().next() else {
            return Self::default();
        };
        let mut centre = first.centre;
        for block in blocks.clone() {
            for (sum, arm) in centre.iter_mut().zip(first.arm_to(block)) {
                *sum += block.weight / weight * arm;
            }
        }
        let mut whole = Self {
            weight,
            centre,
            radius: 0.0,
        };
        let squares = blocks.map(|block| {
            let arm = whole.arm_to(block);
            block.weight * (dot(&arm, &arm) + block.radius * block.radius)
        });
        whole.radius = (squares.sum::<f64>() / weight).sqrt();
        whole
    }

    /// From its centre to another.
    pub(crate) fn arm_to(&self, other: &Self) -> [f64; 3] {
        std::array::from_fn(|axis| other.centre[axis] - self.centre[axis])
    }

    /// Which of its nodes' rotations about its centre move none of them.
    pub(crate) fn idle_rotations<'a>(
        &self,
        nodes: impl Iterator<Item = &'a Self> + Clone,
    ) -> Option<Idle> {
        // The node that is farthest from the centre shows the direction of a line.
        let mut farthest = ([0.0; 3], 0.0);
        for node in nodes.clone() {
            let arm = self.arm_to(node);
            let square = dot(&arm, &arm);
            if square > farthest.1 {
                farthest = (arm, square);
            }
        }
        let (direction, square) = farthest;
        if square == 0.0 {
            return Some(Idle::All);
        }
        let across = nodes.map(|node| {
            let arm = self.arm_to(node);
            let along = dot(&arm, &direction) / square;
            let off: [f64; 3] = std::array::from_fn(|axis| arm[axis] - along * direction[axis]);
            dot(&off, &off)
        });
        let around = self.weight * self.radius * self.radius;
        let is_on_a_line = across.sum::<f64>() <= ON_A_LINE * around;
        let axis = direction.map(|component| component / square.sqrt());
        is_on_a_line.then_some(Idle::About(axis))
    }
}

/// Rotations that move nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Idle {
    /// All: everything is at one point.
    All,
    /// Those about an axis on which everything is.
    About([f64; 3]),
}

/// Nodes are on a line if the mean square of their distances from it is below this part of
/// that from their centre.
const ON_A_LINE: f64 = 1e-10;
