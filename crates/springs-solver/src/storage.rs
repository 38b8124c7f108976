//! Allocation that may fail.

/// Zeroed storage, or `None` if there is not enough memory.
pub(crate) fn zeros(length: usize) -> Option<Vec<f64>> {
    filled(0.0, length)
}

/// Storage full of one value, likewise.
pub(crate) fn filled<V: Clone>(value: V, length: usize) -> Option<Vec<V>> {
    let mut values = Vec::new();
    values.try_reserve_exact(length).ok()?;
    values.resize(length, value);
    Some(values)
}
