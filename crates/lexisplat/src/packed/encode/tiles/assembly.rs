//! Assembly of a file from coded buckets.

use std::path::Path;

use super::coding::{Coded, Coding, Counts, Tables};
use super::plan::Plan;
use crate::formats::lexi::LexiWriter;
use crate::packed::encode::encoding::{Finished, Ranges};
use crate::packed::scene::{PackedHead, SpilledPacked};
use crate::scene::extra::Extra;
use crate::scene::spilled::SpilledExtras;
use crate::sparse::tally::CompressReport;
use crate::support::error::{Error, Result};
use crate::support::progress::Progress;
use crate::support::sink::Sink;
use crate::support::spill::{Spill, SpillTo, Spilled};

/// A packed file that was written.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct PackedFile {
    /// The head of the file.
    pub head: PackedHead,
    /// A report of the packing.
    pub report: CompressReport,
    /// Number of bytes of each tensor and of the header; see [`LexiWriter::tensor_bytes`].
    pub tensor_bytes: Vec<(String, u64)>,
}

impl PackedFile {
    /// Returns the number of bytes of the file.
    #[must_use]
    pub fn file_bytes(&self) -> u64 {
        self.tensor_bytes.iter().map(|t| t.1).sum()
    }
}

/// A file under construction, to which coded buckets are added in order.
#[derive(Debug)]
pub struct Assembly<'a> {
    plan: &'a Plan,
    coding: &'a Coding,
    tables: &'a Tables,
    /// Number of the file among [`Plan::files`].
    file: usize,
    /// Number of the bucket that [`Self::push`] expects.
    next: usize,
    ranges: Ranges,
    layers: Vec<Layer>,
}

/// The parts of a layer that are not in its ranges.
#[derive(Debug)]
struct Layer {
    gaussians: usize,
    order: Option<Spill>,
    extras: SpilledExtras,
}

impl<'a> Assembly<'a> {
    /// Begins file `file` of [`Plan::files`]. Until the file is written, its buckets are in temporary files in `folder`.
    ///
    /// # Errors
    /// [`Error::Parameter`] if there is no such file; [`Error::Io`] if temporary files cannot be made.
    pub fn new(
        plan: &'a Plan,
        coding: &'a Coding,
        tables: &'a Tables,
        file: usize,
        folder: impl AsRef<Path>,
    ) -> Result<Self> {
        let files = plan.files();
        let own = files
            .get(file)
            .ok_or_else(|| Error::parameter("file", file, format!("below {}", files.len())))?;
        let to = SpillTo::Folder(folder.as_ref());
        let layer = |_| {
            Ok(Layer {
                gaussians: 0,
                order: if plan.options.keep_order { Some(Spill::new(to)?) } else { None },
                extras: SpilledExtras::new(to, plan.empty().geometry)?,
            })
        };
        let layers = (0..coding.steps.begun.layering.layers()).map(layer).collect::<Result<_>>()?;
        Ok(Self { plan, coding, tables, file, next: own.start, ranges: Ranges::new(to)?, layers })
    }

    /// Adds the next bucket of the file.
    ///
    /// # Errors
    /// [`Error::Parameter`] if `coded` is not the next bucket or has other tables than the file; [`Error::Io`].
    pub fn push(&mut self, coded: Coded) -> Result<()> {
        if coded.bucket != self.next {
            return Err(Error::parameter("coded bucket", coded.bucket, format!("{}, the next", self.next)));
        }
        let (chunks, layers) = coded.into_chunks(self.plan, self.tables, self.layers.len())?;
        chunks.into_iter().try_for_each(|chunk| self.ranges.push(chunk))?;
        for (layer, own) in self.layers.iter_mut().zip(layers) {
            layer.gaussians += own.gaussians;
            if let (Some(order), Some(own)) = (&mut layer.order, own.order) {
                order.push(&own)?;
            }
            layer.extras.push(&own.extras)?;
        }
        self.next += 1;
        Ok(())
    }

    /// Writes the file to `sink`. All of its buckets must have been added. `counts` holds the counts of these buckets, in
    /// order. `device` is the GPU that measured them, if one did.
    ///
    /// # Errors
    /// [`Error::Parameter`] if buckets are missing; [`Error::Io`], [`Error::Writer`] and [`Error::Cancelled`].
    pub fn finish<'s>(
        self,
        counts: &[Counts],
        device: Option<String>,
        sink: impl Into<Sink<'s>>,
        progress: &dyn Progress,
    ) -> Result<PackedFile> {
        let Self { plan, coding, tables, file, next, ranges, layers } = self;
        let own = plan.files()[file].clone();
        let all = Counts::sum(counts).filter(|_| next == own.end && counts.len() == own.len());
        let missing = || Error::parameter("buckets", counts.len(), format!("all {} of the file", own.len()));
        let mut encoding = coding.encoding(plan)?;
        encoding.counts.add(&all.ok_or_else(missing)?.counts);
        let gaussians: usize = layers.iter().map(|layer| layer.gaussians).sum();
        let meta = plan.kind.meta.clone();
        let Finished { mut head, data, report } =
            encoding.assemble(gaussians, &plan.options, meta, &tables.read(plan)?, ranges)?;
        head.device = device;
        head.removed = plan.gaussians_of_file(file).saturating_sub(gaussians as u64);
        let (mut orders, mut extras) = (Vec::new(), Vec::new());
        for layer in layers {
            orders.extend(layer.order.map(|order| Ok((layer.gaussians, order.finish()?))));
            extras.push((layer.gaussians, layer.extras.finish()?));
        }
        let orders = orders.into_iter().collect::<Result<Vec<_>>>()?;
        let order = (!orders.is_empty()).then_some(orders);
        let spilled = SpilledPacked { data, order, extras: by_column(extras) };
        let writer = LexiWriter::spilled_packed(&head, spilled)?;
        let tensor_bytes = writer.tensor_bytes().to_vec();
        writer.write(sink, progress)?;
        Ok(PackedFile { head, report, tensor_bytes })
    }
}

/// Regroups the columns of each layer by column: returns for each column its values in all layers.
fn by_column(layers: Vec<(usize, Vec<(Extra, Spilled)>)>) -> Vec<(Extra, Vec<(usize, Spilled)>)> {
    let mut columns: Vec<(Extra, Vec<(usize, Spilled)>)> = Vec::new();
    for (count, layer) in layers {
        for (k, (extra, values)) in layer.into_iter().enumerate() {
            match columns.get_mut(k) {
                Some((_, parts)) => parts.push((count, values)),
                None => columns.push((extra, vec![(count, values)])),
            }
        }
    }
    columns
}
