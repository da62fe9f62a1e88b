//! Numbers of bits of the streams of symbols.

use serde::{Deserialize, Serialize};

use crate::packed::bitstream::Stream;

/// The size of one stream.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct StreamBits {
    /// Name of the stream.
    pub name: String,
    /// Name of the attribute that the stream belongs to.
    pub attribute: &'static str,
    /// Number of bits of the stream.
    pub bits: f64,
}

/// Number of bits of each stream. Empty if bits were not counted.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct BitCounts(pub(in crate::packed) Vec<f64>);

impl BitCounts {
    /// Returns counts of 0 for all streams.
    pub(in crate::packed) fn zeros() -> Self {
        Self(vec![0.0; Stream::ALL.len()])
    }

    pub(crate) fn add(&mut self, more: &Self) {
        self.0.resize(self.0.len().max(more.0.len()), 0.0);
        for (a, b) in self.0.iter_mut().zip(&more.0) {
            *a += b;
        }
    }

    /// Returns the counts with the names and the attributes of the streams.
    pub(crate) fn named(&self) -> Vec<StreamBits> {
        let counts = self.0.iter().copied().chain(std::iter::repeat(0.0));
        Stream::names()
            .zip(counts)
            .map(|((name, attribute), bits)| StreamBits { name, attribute, bits })
            .collect()
    }
}
