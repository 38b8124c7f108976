//! Vector registers as others expect them.

/// Calls into faer's dense kernels, and leaves the upper halves of the vector
/// registers zero.
///
/// Some of the kernels use registers of 256 or 512 bits and return without the
/// instruction `vzeroupper`. From then on, for as long as the thread lives, most
/// processors execute code for registers of 128 bits, which is most of a program,
/// several times more slowly. `docs/upstream.md` has the details.
pub(crate) fn with_clean_registers<R>(call_kernels: impl FnOnce() -> R) -> R {
    let result = call_kernels();
    // A function that uses wide registers ends with that instruction, so it is
    // enough to use them: the compiler cannot leave out what is done to this array.
    pulp::Arch::new().dispatch(
        #[inline(always)]
        || {
            std::hint::black_box([0.0f64; 8]);
        },
    );
    result
}
