//! Which vector instructions the compiler may use; never what is computed.

/// A way to run a loop. All give the same bits; they differ in speed.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Path {
    /// What the target guarantees.
    Plain,
    /// AVX2.
    #[cfg(target_arch = "x86_64")]
    V3(pulp::x86::V3),
    /// AVX-512.
    #[cfg(target_arch = "x86_64")]
    V4(pulp::x86::V4),
}

impl Path {
    /// All ways this CPU offers, slowest first.
    pub(crate) fn available() -> Vec<Self> {
        let plain = std::iter::once(Self::Plain);
        #[cfg(target_arch = "x86_64")]
        let plain =
            plain.chain(pulp::x86::V3::try_new().map(Self::V3)).chain(pulp::x86::V4::try_new().map(Self::V4));
        plain.collect()
    }

    /// The fastest way this CPU offers.
    pub(crate) fn detect() -> Self {
        Self::available().pop().unwrap_or(Self::Plain)
    }

    /// Runs `job` with the path's instructions enabled in everything inlined into it.
    #[inline(always)]
    pub(crate) fn dispatch<J: pulp::NullaryFnOnce>(self, job: J) -> J::Output {
        match self {
            Self::Plain => job.call(),
            #[cfg(target_arch = "x86_64")]
            Self::V3(simd) => simd.vectorize(job),
            #[cfg(target_arch = "x86_64")]
            Self::V4(simd) => simd.vectorize(job),
        }
    }
}
