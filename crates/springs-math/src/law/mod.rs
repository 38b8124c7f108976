//! Laws of springs beside the linear one: tension T (N) as a function of the length
//! l (m), with the energy V (J) whose slope it is and the stiffness k = T′ (N/m).
//!
//! With the stretch s = l − l₀ (m) and the strain ε = l/l₀ − 1:
//!
//! | law | tension | V has continuous derivatives up to |
//! | --- | --- | --- |
//! | [`Spring`] | K s, or EA ε | any order |
//! | [`TensionOnly`] | K r(s) | third |
//! | [`CompressionOnly`] | −K r(−s) | third |
//! | [`Bilinear`] | K s above l₀, K₋ s below, r between | third |
//! | [`StrainLimit`] | K s + E (r(s − e) − r(−s − e)) | third |
//! | [`Polynomial`] | a₁ε + a₂ε² + … | any order |
//! | [`Power`] | K l₀ sign(ε)\|ε\|ᵖ | ⌈p⌉-th; any if p is odd |
//! | [`Plastic`] | K(s − p), where p lasts | first |
//! | [`Table`] | monotone cubics through points (ε, T) | second |
//!
//! Without a blend V has a continuous first derivative only. Where it has m of them at
//! an edge, a step over the edge errs by O(hᵐ⁺¹), that of a power by O(hᵖ⁺¹): methods
//! keep an order up to 4 with blends, 3 with tables, 2 with kinks, 2.5 with p = 3/2, as
//! long as few steps go over edges and steps are shorter than the time within a blend.
//!
//! r is a ramp of width w, in m: zero below 0, s above w, and between them, with
//! u = s/w,
//!
//! r = w(6u³ − 8u⁴ + 3u⁵), r′ = 18u² − 32u³ + 15u⁴.
//!
//! It is the one polynomial of degree 5 with r = r′ = r″ = 0 at 0 and r = w, r′ = 1,
//! r″ = 0 at w (quintic Hermite interpolation), so that r is C². It never falls, and
//! r′ is at most 189/125, at u = 3/5. So laws with a ramp are exact on both sides of
//! it, vanish at l₀ exactly, and are up to 1.512 times as stiff within.
//!
//! Any of them ends beyond a [`Limit`] in [`Breaking`].
//!
//! ```
//! use springs_math::law::TensionOnly;
//! use springs_math::spring::LengthLaw;
//!
//! let cable = TensionOnly { stiffness: 100.0, rest_length: 1.0, blend: 1e-3 };
//! assert_eq!(cable.tension(0.9), 0.0);
//! assert_eq!(cable.tension(1.5), 50.0);
//! ```

mod blends;
mod breaking;
mod plastic;
mod powers;
mod table;

pub use blends::{Bilinear, CompressionOnly, StrainLimit, TensionOnly};
pub use breaking::{Breaking, Limit};
pub use plastic::Plastic;
pub use powers::{Polynomial, Power};
pub use table::{Point, Table, TableError};

use crate::spring::{LengthLaw, Spring};

/// Any law, so that springs with different ones make one batch.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Law {
    /// The linear law.
    Linear(Spring),
    /// Pulls only.
    TensionOnly(TensionOnly),
    /// Pushes only.
    CompressionOnly(CompressionOnly),
    /// One stiffness above the rest length, another below.
    Bilinear(Bilinear),
    /// Stiffer beyond a strain.
    StrainLimit(StrainLimit),
    /// A polynomial in strain.
    Polynomial(Polynomial),
    /// A power of the strain.
    Power(Power),
    /// A curve through points.
    Table(Table),
    /// Yields.
    Plastic(Plastic),
}

macro_rules! each_law {
    ($law:expr, $inner:ident => $result:expr) => {
        match $law {
            Law::Linear($inner) => $result,
            Law::TensionOnly($inner) => $result,
            Law::CompressionOnly($inner) => $result,
            Law::Bilinear($inner) => $result,
            Law::StrainLimit($inner) => $result,
            Law::Polynomial($inner) => $result,
            Law::Power($inner) => $result,
            Law::Table($inner) => $result,
            Law::Plastic($inner) => $result,
        }
    };
}

impl LengthLaw for Law {
    #[inline]
    fn energy(&self, length: f64) -> f64 {
        each_law!(self, law => law.energy(length))
    }

    #[inline]
    fn tension(&self, length: f64) -> f64 {
        each_law!(self, law => law.tension(length))
    }

    #[inline]
    fn stiffness(&self, length: f64) -> f64 {
        each_law!(self, law => law.stiffness(length))
    }

    #[inline]
    fn largest_stiffness(&self) -> f64 {
        each_law!(self, law => law.largest_stiffness())
    }

    #[inline]
    fn rest_length(&self) -> f64 {
        each_law!(self, law => law.rest_length())
    }

    fn set_spring(&mut self, spring: Spring) {
        each_law!(self, law => law.set_spring(spring));
    }

    #[inline]
    fn is_convex(&self) -> bool {
        each_law!(self, law => law.is_convex())
    }

    fn has_memory(&self) -> bool {
        each_law!(self, law => law.has_memory())
    }

    fn update_memory(&mut self, length: f64, known: Option<f64>) -> f64 {
        each_law!(self, law => law.update_memory(length, known))
    }

    fn elongation(&self) -> f64 {
        each_law!(self, law => law.elongation())
    }

    fn each_memory(&mut self, visit: &mut dyn FnMut(&mut f64)) {
        each_law!(self, law => law.each_memory(visit))
    }
}
