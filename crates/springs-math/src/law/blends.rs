//! Laws of linear pieces with a ramp between them.

use crate::spring::{LengthLaw, Spring};

/// A ramp r(s), see the [module](super).
#[derive(Clone, Copy)]
struct Ramp {
    /// w in m; a kink if zero.
    width: f64,
}

impl Ramp {
    /// `stiffness` in N/m times ∫ r ds from 0 to `s`, in J: s²/2 − w²/10 above w.
    /// Zero for no stiffness even where s² exceeds the number range.
    #[inline(always)]
    fn energy(self, stiffness: f64, s: f64) -> f64 {
        if s <= 0.0 {
            0.0
        } else if s >= self.width {
            0.5 * stiffness * s * s - 0.1 * stiffness * self.width * self.width
        } else {
            let u = s / self.width;
            let square = s * u;
            stiffness * square * square * (1.5 - u * (1.6 - 0.5 * u))
        }
    }

    /// r(s), in m.
    #[inline(always)]
    fn value(self, s: f64) -> f64 {
        if s <= 0.0 {
            0.0
        } else if s >= self.width {
            s
        } else {
            let u = s / self.width;
            s * u * u * (6.0 - u * (8.0 - 3.0 * u))
        }
    }

    /// r′(s).
    #[inline(always)]
    fn slope(self, s: f64) -> f64 {
        if s <= 0.0 {
            0.0
        } else if s >= self.width {
            1.0
        } else {
            let u = s / self.width;
            u * u * (18.0 - u * (32.0 - 15.0 * u))
        }
    }

    /// The largest r′.
    #[inline(always)]
    fn largest_slope(self) -> f64 {
        if self.width > 0.0 { 189.0 / 125.0 } else { 1.0 }
    }
}

/// One stiffness above l₀ and another below it; T = 0 at l₀.
///
/// With k₁ the smaller and k₂ the larger of the two, T = k₁ s on the side of k₁ and
/// T = k₁ s + (k₂ − k₁) r(s) on the other (mirrored if that is the compressed one). The
/// blend, of width δ·l₀, lies on the stiffer side, where k goes from k₁ to
/// k₁ + 1.512 (k₂ − k₁) and then to k₂: on the other side k could be negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bilinear {
    /// K, of the stretched spring, in N/m; not negative.
    pub stiffness: f64,
    /// K₋, of the compressed spring, in N/m; not negative.
    pub compression: f64,
    /// l₀, in m; may be zero.
    pub rest_length: f64,
    /// δ, a strain; with 0, k jumps at l₀.
    pub blend: f64,
}

/// A [`Bilinear`] law as a sum of a linear one and a ramp.
struct Halves {
    /// The smaller stiffness, in N/m.
    soft: f64,
    /// What the larger one has more, in N/m.
    more: f64,
    /// 1 if the spring is stiffer when stretched, −1 if when compressed.
    side: f64,
    ramp: Ramp,
}

impl Bilinear {
    #[inline(always)]
    fn halves(&self) -> Halves {
        let more = self.stiffness - self.compression;
        Halves {
            soft: self.stiffness.min(self.compression),
            more: more.abs(),
            side: 1f64.copysign(more),
            ramp: Ramp {
                width: self.blend * self.rest_length,
            },
        }
    }
}

impl LengthLaw for Bilinear {
    #[inline]
    fn energy(&self, length: f64) -> f64 {
        let halves = self.halves();
        let s = length - self.rest_length;
        0.5 * halves.soft * s * s + halves.ramp.energy(halves.more, halves.side * s)
    }

    #[inline]
    fn tension(&self, length: f64) -> f64 {
        let halves = self.halves();
        let s = length - self.rest_length;
        halves.soft * s + halves.side * halves.more * halves.ramp.value(halves.side * s)
    }

    #[inline]
    fn stiffness(&self, length: f64) -> f64 {
        let halves = self.halves();
        let s = length - self.rest_length;
        halves.soft + halves.more * halves.ramp.slope(halves.side * s)
    }

    #[inline]
    fn largest_stiffness(&self) -> f64 {
        let halves = self.halves();
        halves.soft + halves.more * halves.ramp.largest_slope()
    }

    #[inline]
    fn rest_length(&self) -> f64 {
        self.rest_length
    }

    fn set_spring(&mut self, spring: Spring) {
        self.stiffness = spring.stiffness;
        self.rest_length = spring.rest_length;
    }

    #[inline]
    fn is_convex(&self) -> bool {
        true
    }
}

/// A cable: T = K r(l − l₀) pulls, and is zero up to l₀ inclusive.
///
/// The blend, of width δ·l₀, lies above l₀; beyond it T = K(l − l₀).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TensionOnly {
    /// K, in N/m; not negative.
    pub stiffness: f64,
    /// l₀, in m; may be zero.
    pub rest_length: f64,
    /// δ, a strain; with 0, k jumps at l₀.
    pub blend: f64,
}

impl TensionOnly {
    #[inline(always)]
    fn bilinear(&self) -> Bilinear {
        Bilinear {
            stiffness: self.stiffness,
            compression: 0.0,
            rest_length: self.rest_length,
            blend: self.blend,
        }
    }
}

/// A contact: T = −K r(l₀ − l) pushes, and is zero from l₀ on.
///
/// The blend, of width δ·l₀, lies below l₀; beyond it T = K(l − l₀).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CompressionOnly {
    /// K, in N/m; not negative.
    pub stiffness: f64,
    /// l₀, in m.
    pub rest_length: f64,
    /// δ, a strain; with 0, k jumps at l₀.
    pub blend: f64,
}

impl CompressionOnly {
    #[inline(always)]
    fn bilinear(&self) -> Bilinear {
        Bilinear {
            stiffness: 0.0,
            compression: self.stiffness,
            rest_length: self.rest_length,
            blend: self.blend,
        }
    }
}

macro_rules! one_sided {
    ($law:ty) => {
        impl LengthLaw for $law {
            #[inline]
            fn energy(&self, length: f64) -> f64 {
                self.bilinear().energy(length)
            }

            #[inline]
            fn tension(&self, length: f64) -> f64 {
                self.bilinear().tension(length)
            }

            #[inline]
            fn stiffness(&self, length: f64) -> f64 {
                self.bilinear().stiffness(length)
            }

            #[inline]
            fn largest_stiffness(&self) -> f64 {
                self.bilinear().largest_stiffness()
            }

            #[inline]
            fn rest_length(&self) -> f64 {
                self.rest_length
            }

            fn set_spring(&mut self, spring: Spring) {
                self.stiffness = spring.stiffness;
                self.rest_length = spring.rest_length;
            }

            #[inline]
            fn is_convex(&self) -> bool {
                true
            }
        }
    };
}

one_sided!(TensionOnly);
one_sided!(CompressionOnly);

/// A linear spring with an extra stiffness E beyond a strain of ±`strain`.
///
/// T = K s + E (r(s − e) − r(−s − e)) with e = `strain`·l₀ and a ramp of width δ·l₀:
/// linear up to ±e inclusive, T = K s ± E(|s| − e) beyond e + δ·l₀. With a strain of 1
/// or more nothing limits compression.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrainLimit {
    /// The spring within the limit.
    pub spring: Spring,
    /// The strain from which on it is stiffer, on both sides; not negative.
    pub strain: f64,
    /// E, added to K, in N/m; not negative.
    pub stiffness: f64,
    /// δ, the strain over which E sets in; with 0, k jumps at the limit.
    pub blend: f64,
}

impl StrainLimit {
    #[inline(always)]
    fn ramp(&self) -> Ramp {
        Ramp {
            width: self.blend * self.spring.rest_length,
        }
    }

    /// Stretch beyond the limit, in m, and the sign of the stretch.
    #[inline(always)]
    fn excess(&self, length: f64) -> (f64, f64) {
        let s = length - self.spring.rest_length;
        let excess = s.abs() - self.strain * self.spring.rest_length;
        (excess, 1f64.copysign(s))
    }
}

impl LengthLaw for StrainLimit {
    #[inline]
    fn energy(&self, length: f64) -> f64 {
        let (excess, _) = self.excess(length);
        self.spring.energy(length) + self.ramp().energy(self.stiffness, excess)
    }

    #[inline]
    fn tension(&self, length: f64) -> f64 {
        let (excess, sign) = self.excess(length);
        self.spring.tension(length) + sign * self.stiffness * self.ramp().value(excess)
    }

    #[inline]
    fn stiffness(&self, length: f64) -> f64 {
        let (excess, _) = self.excess(length);
        self.spring.stiffness + self.stiffness * self.ramp().slope(excess)
    }

    #[inline]
    fn largest_stiffness(&self) -> f64 {
        self.spring.stiffness + self.stiffness * self.ramp().largest_slope()
    }

    #[inline]
    fn rest_length(&self) -> f64 {
        self.spring.rest_length
    }

    fn set_spring(&mut self, spring: Spring) {
        self.spring = spring;
    }

    #[inline]
    fn is_convex(&self) -> bool {
        true
    }
}
