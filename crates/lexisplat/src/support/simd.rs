//! The choice of vector instructions for long loops. It changes their speed, never their results.
//!
//! The long loops of this workspace are additions and multiplications, each rounded, over lanes that never meet. The
//! compiler can therefore use registers of any width, and the bits stay the same. By default the loops use the widest
//! registers of the CPU. [`Simd::scope`] chooses others, to test that the bits are the same or to work around a faulty
//! CPU.
//!
//! The choice is a value of the calling thread, and loops pass it on to their worker threads. The only state of the process
//! is the list of CPU features in `std`, which never changes.

use std::cell::Cell;

/// A set of vector instructions that this CPU has. All sets give the same bits; they differ in speed.
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

thread_local! {
    /// The choice of the innermost scope of this thread; `None` outside of all scopes.
    static CHOSEN: Cell<Option<Simd>> = const { Cell::new(None) };
}

/// Restores the choice of the outer scope, also when the work panics.
struct Outer(Option<Simd>);

impl Drop for Outer {
    fn drop(&mut self) {
        CHOSEN.set(self.0);
    }
}

impl Simd {
    /// The instructions that the target guarantees: SSE2 on `x86_64`, NEON on `aarch64`.
    pub const PLAIN: Self = Self(Set::Plain);

    /// Returns all sets that this CPU has, slowest first.
    #[must_use]
    pub fn available() -> Vec<Self> {
        let all = std::iter::once(Set::Plain);
        #[cfg(target_arch = "x86_64")]
        let all =
            all.chain(pulp::x86::V3::try_new().map(Set::V3)).chain(pulp::x86::V4::try_new().map(Set::V4));
        all.map(Self).collect()
    }

    /// Returns the fastest set that this CPU has.
    #[must_use]
    pub fn widest() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            let v3 = || pulp::x86::V3::try_new().map(Set::V3);
            if let Some(set) = pulp::x86::V4::try_new().map(Set::V4).or_else(v3) {
                return Self(set);
            }
        }
        Self::PLAIN
    }

    /// Returns the set called `name`, if this CPU has it.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::available().into_iter().find(|simd| simd.name() == name)
    }

    /// Returns the name of the set: `plain`, `avx2` or `avx512`.
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

    /// Returns this set with registers of at most 256 bits, which are faster between look-ups of single numbers.
    pub(crate) fn narrow(self) -> Self {
        match self.0 {
            #[cfg(target_arch = "x86_64")]
            Set::V4(simd) => Self(Set::V3(*simd)),
            _ => self,
        }
    }

    /// Calls `work`, in which [`Self::current`] is this set on the calling thread and on the threads of parallel
    /// loops. A thread that `work` starts by itself begins outside of all scopes.
    pub fn scope<R>(self, work: impl FnOnce() -> R) -> R {
        let _outer = Outer(CHOSEN.replace(Some(self)));
        work()
    }

    /// Returns the set of the innermost [`Self::scope`]; outside of all scopes, the widest set.
    #[must_use]
    pub fn current() -> Self {
        CHOSEN.get().unwrap_or_else(Self::widest)
    }

    /// Calls `job` with these instructions enabled in everything that is inlined into it. The closure must be
    /// marked `#[inline(always)]`.
    #[inline(always)]
    pub fn dispatch<R>(self, job: impl FnOnce() -> R) -> R {
        self.run(job)
    }

    /// Calls `job` as [`Self::dispatch`] does. `job` need not be a closure.
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
    use crate::support::parallel::map_chunks;

    #[test]
    fn what_the_cpu_has_can_be_named_and_nothing_else() {
        for simd in Simd::available() {
            assert_eq!(Simd::named(simd.name()).unwrap().name(), simd.name());
            assert_eq!(simd.dispatch(|| 7), 7);
        }
        assert_eq!(Simd::available().pop().unwrap().name(), Simd::widest().name());
        assert!(Simd::named("sse9").is_none());
        #[cfg(target_arch = "x86_64")]
        assert_eq!(Simd::named("avx2").is_some(), std::is_x86_feature_detected!("avx2"));
    }

    #[test]
    fn a_scope_holds_on_all_threads_of_its_loops_and_ends() {
        let names = || map_chunks(100, 1, |_| Simd::current().name());
        for simd in Simd::available() {
            assert_eq!(simd.scope(names), [simd.name(); 100]);
            let inner = simd.scope(|| {
                assert!(std::panic::catch_unwind(|| Simd::PLAIN.scope(|| panic!("an inner scope"))).is_err());
                Simd::current().name()
            });
            assert_eq!(inner, simd.name());
        }
        assert_eq!(names(), [Simd::widest().name(); 100]);
    }
}
