//! Elapsed time, on platforms with a clock.

/// Measures the time since it was started.
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

    /// Seconds since the start. In a browser, where `Instant` would panic, it is 0.
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
