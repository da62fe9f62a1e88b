//! Elapsed time, on platforms with a clock.

/// A measurement of the time since its start.
#[derive(Debug, Clone, Copy)]
pub struct Stopwatch {
    #[cfg(not(target_family = "wasm"))]
    start: std::time::Instant,
}

impl Stopwatch {
    /// Starts a stopwatch.
    #[must_use]
    pub fn start() -> Self {
        Self {
            #[cfg(not(target_family = "wasm"))]
            start: std::time::Instant::now(),
        }
    }

    /// Returns the seconds since the start; 0 in a browser, where `Instant` would panic.
    #[cfg_attr(target_family = "wasm", expect(clippy::unused_self, reason = "there is no clock"))]
    #[must_use]
    pub fn seconds(self) -> f64 {
        #[cfg(not(target_family = "wasm"))]
        {
            self.start.elapsed().as_secs_f64()
        }
        #[cfg(target_family = "wasm")]
        {
            0.0
        }
    }
}
