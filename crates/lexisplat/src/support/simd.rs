//! Which vector instructions long loops may use; never what they compute.
//!
//! Everything that is slow here is a loop of additions and multiplications, each rounded, over lanes that do not
//! meet. The compiler makes it of wider registers where the CPU has them, and the bits stay the same. So a choice
//! is only ever needed to test that, or to work around a CPU: the environment variable [`VARIABLE`] makes it for
//! the whole process.

use std::sync::OnceLock;

use crate::support::error::{Error, Result};

/// The environment variable that chooses: `plain`, `avx2` or `avx512`. It is looked at once.
pub const VARIABLE: &str = "LEXISPLAT_SIMD";

/// A set of vector instructions that this CPU has. All give the same bits; they differ in speed.
#[derive(Debug, Clone, Copy)]
pub struct Simd(Set);

#[derive(Debug, Clone, Copy)]
enum Set {
    Plain,
    #[cfg(target_arch = "x86_64")]
    V3(pulp::x86::V3),
    #[cfg(target_arch = "x86_64")]
    V4(pulp::x86::V4),
}

impl Simd {
    /// What the target guarantees: SSE2 on `x86_64`, NEON on `aarch64`.
    pub const PLAIN: Self = Self(Set::Plain);

    /// All that this CPU has, slowest first.
    #[must_use]
    pub fn available() -> Vec<Self> {
        let all = std::iter::once(Set::Plain);
        #[cfg(target_arch = "x86_64")]
        let all =
            all.chain(pulp::x86::V3::try_new().map(Set::V3)).chain(pulp::x86::V4::try_new().map(Set::V4));
        all.map(Self).collect()
    }

    /// The one that [`VARIABLE`] names; the fastest if it is not set or empty.
    ///
    /// # Errors
    /// [`Error::Parameter`] if it names none, or one that this CPU has not.
    pub fn chosen() -> Result<Self> {
        match std::env::var_os(VARIABLE) {
            Some(name) if !name.is_empty() => Self::named(&name.to_string_lossy()),
            _ => Ok(Self::fastest()),
        }
    }

    /// [`Self::chosen`], found once for the whole process; the fastest where that is an error.
    #[must_use]
    pub fn detect() -> Self {
        static DETECTED: OnceLock<Simd> = OnceLock::new();
        *DETECTED.get_or_init(|| Self::chosen().unwrap_or_else(|_| Self::fastest()))
    }

    fn fastest() -> Self {
        Self::available().pop().unwrap_or(Self::PLAIN)
    }

    fn named(name: &str) -> Result<Self> {
        let available = Self::available();
        available.iter().copied().find(|simd| simd.name() == name).ok_or_else(|| {
            let names: Vec<&str> = available.into_iter().map(Self::name).collect();
            Error::parameter(VARIABLE, name, format!("{}: this CPU has no other", names.join(" or ")))
        })
    }

    /// What [`VARIABLE`] calls it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self.0 {
            Set::Plain => "plain",
            #[cfg(target_arch = "x86_64")]
            Set::V3(_) => "avx2",
            #[cfg(target_arch = "x86_64")]
            Set::V4(_) => "avx512",
        }
    }

    /// Runs `job` with these instructions enabled in everything inlined into it: mark the closure
    /// `#[inline(always)]`.
    #[inline(always)]
    pub fn dispatch<R>(self, job: impl FnOnce() -> R) -> R {
        self.run(job)
    }

    /// [`Self::dispatch`] of a job that is no closure.
    #[inline(always)]
    pub(crate) fn run<J: pulp::NullaryFnOnce>(self, job: J) -> J::Output {
        match self.0 {
            Set::Plain => job.call(),
            #[cfg(target_arch = "x86_64")]
            Set::V3(simd) => simd.vectorize(job),
            #[cfg(target_arch = "x86_64")]
            Set::V4(simd) => simd.vectorize(job),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_cpu_has_can_be_named_and_nothing_else() {
        for simd in Simd::available() {
            assert_eq!(Simd::named(simd.name()).unwrap().name(), simd.name());
            assert_eq!(simd.dispatch(|| 7), 7);
        }
        let error = Simd::named("sse9").unwrap_err().to_string();
        assert!(error.contains("LEXISPLAT_SIMD = sse9: plain"), "{error}");
        #[cfg(target_arch = "x86_64")]
        assert_eq!(Simd::named("avx2").is_ok(), std::is_x86_feature_detected!("avx2"));
    }
}
