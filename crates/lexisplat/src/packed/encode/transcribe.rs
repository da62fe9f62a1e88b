//! Recoding of the ranges of a chunk with other tables.

use crate::packed::bitstream::chunk::{Form, LayerForm, lanes, sets};
use crate::packed::bitstream::geometry_syntax::{GeometrySyntax, Group};
use crate::packed::bitstream::interim::interim;
use crate::packed::bitstream::parameters::CHANGES;
use crate::packed::bitstream::refinement::refine;
use crate::packed::bitstream::sh_codes::{BLOCK, Rest};
use crate::packed::bitstream::streams::Slot;
use crate::packed::entropy::lanes::{LANES, Lanes};
use crate::packed::entropy::rans_decoder::SymbolDecoder;
use crate::packed::entropy::rans_encoder::SymbolRecorder;
use crate::packed::entropy::symbols::Symbols;
use crate::packed::entropy::tables::Lookup;

/// A decoder that records the symbols that it decodes.
struct Transcriber<'l> {
    from: SymbolDecoder<'l>,
    to: SymbolRecorder,
}

impl<'l> Transcriber<'l> {
    fn new(lookup: &'l Lookup, bytes: &'l [u8], lanes: usize) -> Option<Self> {
        Some(Self {
            from: SymbolDecoder::new(lookup, bytes, lanes, false).ok()?,
            to: SymbolRecorder::default(),
        })
    }
}

impl Symbols for Transcriber<'_> {
    fn symbols(
        &mut self,
        slot: Slot,
        context: Lanes<u32>,
        set: u32,
        value: impl Fn(usize) -> u32,
    ) -> Lanes<u32> {
        let out = self.from.symbols(slot, context, set, value);
        self.to.symbols(slot, context, set, |l| out[l])
    }

    fn bits(&mut self, slot: Slot, count: Lanes<u32>, set: u32, value: impl Fn(usize) -> u32) -> Lanes<u32> {
        let out = self.from.bits(slot, count, set, value);
        self.to.bits(slot, count, set, |l| out[l])
    }
}

impl Form {
    /// Decodes all ranges of a chunk of `gaussians` Gaussians, which are coded with the tables of `lookup`, and returns
    /// their symbols. `None` if the ranges are not the output of an encoder.
    pub(in crate::packed) fn transcribe(
        &self,
        layer: LayerForm,
        gaussians: usize,
        lookup: &Lookup,
        ranges: &[&[u8]],
    ) -> Option<Vec<SymbolRecorder>> {
        if ranges.len() != layer.ranges() || gaussians == 0 {
            return None;
        }
        let lanes = lanes(gaussians);
        let all = ranges.iter().map(|bytes| Transcriber::new(lookup, bytes, lanes));
        let mut all = all.collect::<Option<Vec<Transcriber<'_>>>>()?;
        let (base, finer) = all.split_first_mut()?;
        let (finer, sh_parts) = finer.split_at_mut_checked(layer.refinements)?;
        let (sh_parts, changed) = sh_parts.split_at_mut_checked(layer.sh_parts)?;
        let steps = gaussians.div_ceil(lanes);
        let (mut walk, mut rest) = (GeometrySyntax::new(&self.steering, layer.refinements), Rest::default());
        let mut group = Group::default();
        for (step, set) in sets(gaussians, lanes).enumerate() {
            walk.base(base, set, None, &mut group).ok()?;
            for (k, range) in finer.iter_mut().enumerate() {
                refine(range, set, &mut group, layer.refinements - k).ok()?;
            }
            if let Some(range) = changed.first_mut() {
                interim(range, set, &mut group, &[[0; LANES]; CHANGES]);
            }
            rest.push(set, group.colour);
            if rest.len() == BLOCK || step + 1 == steps {
                for (sh_part, range) in sh_parts.iter_mut().enumerate() {
                    rest.sh_part(range, None, &self.rest, sh_part).ok()?;
                }
                rest.clear();
            }
            // Symbols of damaged ranges may take no bytes. Without this check, recording them would not end.
            let good = |range: &Transcriber<'_>| range.from.check().is_ok();
            if !(good(base) && finer.iter().chain(&*sh_parts).chain(&*changed).all(good)) {
                return None;
            }
        }
        all.iter()
            .all(|range| range.from.check_end().is_ok())
            .then(|| all.into_iter().map(|range| range.to).collect())
    }
}
