//! Groups of values that are processed side by side.

/// Number of values of a group. A loop over a group becomes vector instructions of 4, 8 or 16 values. The compiler would
/// unroll shorter loops before it could vectorise them.
pub(super) const LANES: usize = 16;

/// One value for each member of a group.
pub(super) type Lanes = [f32; LANES];

/// Applies `f` to the inputs of each lane.
///
/// `f` must be inlined and have no branches. It should be short, because the compiler does not vectorise long loops.
#[inline(always)]
pub(super) fn each<const N: usize, const M: usize>(
    inputs: [&Lanes; N],
    f: impl Fn([f32; N]) -> [f32; M],
) -> [Lanes; M] {
    let mut out = [[0.0; LANES]; M];
    for lane in 0..LANES {
        let values = f(inputs.map(|input| input[lane]));
        for k in 0..M {
            out[k][lane] = values[k];
        }
    }
    out
}
