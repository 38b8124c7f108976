//! Where solutions are known to lie.

/// Where solutions are known to lie, and what the matrices are then like.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Subspace {
    /// Anywhere.
    Space,
    /// In the plane of two orthonormal vectors; right-hand sides do, too, and
    /// the matrix keeps it that way.
    Plane([[f64; 3]; 2]),
    /// Along a unit vector, likewise.
    Line([f64; 3]),
    /// Anywhere, but every block is a multiple of the identity, and so packed as
    /// a symmetric one.
    Isotropic,
}
