//! Why there is no factor.

/// Why there is no factor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NoFactor {
    /// The matrix is not positive definite at this column, in order of
    /// elimination.
    NotPositive {
        column: usize,
    },
    Interrupted,
}

/// The failure that one thread, which goes from column to column, would have met.
pub(crate) fn first_failure(
    a: Result<(), NoFactor>,
    b: Result<(), NoFactor>,
) -> Result<(), NoFactor> {
    match (a, b) {
        (
            Err(NoFactor::NotPositive { column: of_a }),
            Err(NoFactor::NotPositive { column: of_b }),
        ) => Err(NoFactor::NotPositive {
            column: of_a.min(of_b),
        }),
        (Err(NoFactor::NotPositive { .. }) | Ok(()), b @ Err(_)) => b,
        (a, _) => a,
    }
}
