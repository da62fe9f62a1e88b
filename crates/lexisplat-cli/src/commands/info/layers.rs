//! The output of `info` for the layers of a packed file.

use std::fmt::Write as _;

use anyhow::Result;
use lexisplat::packed::{LayerOutline, Outline, RangeKind};
use lexisplat_eval::format;
use serde::Serialize;

/// The facts about the layers of a packed file.
#[derive(Serialize)]
pub(super) struct LayersFacts {
    layers: Vec<LayerFacts>,
    first_layer: FirstLayer,
}

/// The facts about one layer.
#[derive(Serialize)]
struct LayerFacts {
    gaussians: u64,
    chunks: usize,
    bytes: LayerBytes,
}

/// Numbers of bytes of a layer, by contents.
#[derive(Default, Serialize)]
struct LayerBytes {
    base: u64,
    refinements: u64,
    /// Number of bytes of each part of SH.
    sh_parts: Vec<u64>,
    interim: u64,
}

/// The first bytes of the file. They hold all of the first layer but SH; some of it is coarse.
#[derive(Serialize)]
struct FirstLayer {
    bytes: u64,
    share: f64,
}

impl LayersFacts {
    pub(super) fn new(outline: &Outline, file_bytes: u64) -> Self {
        let facts = |layer: &LayerOutline| LayerFacts {
            gaussians: layer.gaussians,
            chunks: layer.chunks.len(),
            bytes: LayerBytes { sh_parts: vec![0; layer.sh_parts], ..LayerBytes::default() },
        };
        let mut layers: Vec<LayerFacts> = outline.layers.iter().map(facts).collect();
        for range in &outline.ranges {
            let layer = outline.chunks.get(range.chunk).and_then(|chunk| layers.get_mut(chunk.layer));
            let Some(LayerFacts { bytes, .. }) = layer else { continue };
            let sum = match range.kind {
                RangeKind::Base => Some(&mut bytes.base),
                RangeKind::Refinement(_) => Some(&mut bytes.refinements),
                RangeKind::Sh(part) => bytes.sh_parts.get_mut(part),
                RangeKind::Interim => Some(&mut bytes.interim),
                _ => None,
            };
            if let Some(sum) = sum {
                *sum += range.bytes.end - range.bytes.start;
            }
        }
        let bytes = outline.first_layer_end();
        let first_layer = FirstLayer { bytes, share: bytes as f64 / file_bytes.max(1) as f64 };
        Self { layers, first_layer }
    }

    /// Writes a line for each layer, and a line for the bytes that the first layer needs.
    pub(super) fn text(&self, out: &mut String) -> Result<()> {
        let parts = self.layers.iter().map(|layer| layer.bytes.sh_parts.len()).max().unwrap_or(0);
        write!(out, "\n{:<6} {:>12} {:>8} {:>11} {:>11}", "layer", "Gaussians", "chunks", "base", "finer")?;
        for part in 1..=parts {
            write!(out, " {:>11}", format!("SH part {part}"))?;
        }
        writeln!(out, " {:>11}", "interim")?;
        for (i, layer) in self.layers.iter().enumerate() {
            let LayerFacts { gaussians, chunks, bytes } = layer;
            write!(out, "{:<6} {:>12} {chunks:>8}", i + 1, format::count(*gaussians))?;
            let all = [bytes.base, bytes.refinements].into_iter().chain(bytes.sh_parts.iter().copied());
            for bytes in all.chain([bytes.interim]) {
                write!(out, " {:>11}", format::bytes(bytes))?;
            }
            writeln!(out)?;
        }
        let FirstLayer { bytes, share } = self.first_layer;
        let (bytes, share) = (format::bytes(bytes), 100.0 * share);
        writeln!(out, "the first layer is complete, without SH, after {bytes}, {share:.1} % of the file")?;
        Ok(())
    }
}
