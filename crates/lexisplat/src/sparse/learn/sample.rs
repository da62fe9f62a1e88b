//! The choice of vectors to learn from, and of vectors to measure progress by.

use super::LearnOptions;
use crate::support::error::Result;
use crate::support::rng::SplitMix64;

/// Largest number of vectors held out. With so many, the standard error of mean nonzeros is about 0.1.
const MAX_HELD_OUT: usize = 4096;
/// One vector in this many is held out, up to [`MAX_HELD_OUT`] vectors.
const HELD_OUT_SHARE: usize = 10;
/// Number mixed into the seed, so that the sample does not depend on the random numbers of the first atoms.
const SAMPLE_STREAM: u64 = 0x53;

/// Two disjoint sets of vectors, in random order.
#[derive(Debug)]
pub(super) struct Sample {
    /// Vectors to learn from. Vectors within the tolerance are left out, because they need no atoms.
    pub(super) learn: Vec<f32>,
    /// Vectors to measure progress by, of any norm.
    pub(super) held_out: Vec<f32>,
}

/// Number of vectors fetched at a time.
const BATCH: usize = 4096;

/// A function that appends the vectors with the given numbers, in the given order, to a list.
pub(crate) type Fetch<'a> = dyn FnMut(&[usize], &mut Vec<f32>) -> Result<()> + 'a;

impl Sample {
    /// Draws a sample of `vectors` vectors, each of `dim` values.
    pub(super) fn draw(
        dim: usize,
        vectors: usize,
        fetch: &mut Fetch<'_>,
        options: &LearnOptions,
    ) -> Result<Self> {
        let held = (vectors / HELD_OUT_SHARE).min(MAX_HELD_OUT);
        let mut order = SplitMix64::new(options.seed ^ SAMPLE_STREAM).shuffled(vectors);
        let tolerance = options.stop.tolerance().unwrap_or(0.0);
        let mut sample = Self { learn: Vec::new(), held_out: Vec::with_capacity(held * dim) };
        let (mut drawn, mut signals) = (0, Vec::new());
        loop {
            let batch: Vec<usize> = order.by_ref().take(BATCH).collect();
            if batch.is_empty() {
                return Ok(sample);
            }
            signals.clear();
            fetch(&batch, &mut signals)?;
            for signal in signals.chunks_exact(dim) {
                drawn += 1;
                if drawn <= held {
                    sample.held_out.extend_from_slice(signal);
                    continue;
                }
                let energy: f64 = signal.iter().map(|&x| f64::from(x) * f64::from(x)).sum();
                if energy.sqrt() > tolerance {
                    sample.learn.extend_from_slice(signal);
                    if sample.learn.len() >= options.sample * dim {
                        return Ok(sample);
                    }
                }
            }
        }
    }

    /// Returns the vectors to measure progress by: the held-out vectors, or the vectors to learn from if the scene is too
    /// small to hold any out.
    pub(super) fn validation(&self) -> &[f32] {
        if self.held_out.is_empty() { &self.learn } else { &self.held_out }
    }
}
