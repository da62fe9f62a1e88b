//! The bits that streams of symbols take.

use serde::{Deserialize, Serialize};

use crate::packed::bitstream::Stream;

/// Size of one stream.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct StreamBits {
    /// The stream's name.
    pub name: String,
    /// The attribute it belongs to.
    pub attribute: &'static str,
    /// Bits in all.
    pub bits: f64,
}

/// Bits each stream took; empty if they were not counted.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct BitCounts(pub(in crate::packed) Vec<f64>);

impl BitCounts {
    /// No bits yet.
    pub(in crate::packed) fn zeros() -> Self {
        Self(vec![0.0; Stream::ALL.len()])
    }

    pub(crate) fn add(&mut self, more: &Self) {
        self.0.resize(self.0.len().max(more.0.len()), 0.0);
        for (a, b) in self.0.iter_mut().zip(&more.0) {
            *a += b;
        }
    }

    /// With the names and attributes of the streams.
    pub(crate) fn named(&self) -> Vec<StreamBits> {
        let counts = self.0.iter().copied().chain(std::iter::repeat(0.0));
        Stream::names()
            .zip(counts)
            .map(|((name, attribute), bits)| StreamBits { name, attribute, bits })
            .collect()
    }
}
