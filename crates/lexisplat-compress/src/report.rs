//! The report of a compression: the facts that programs print as text and as JSON.

use lexisplat::packed::{PackedHead, ReachedRecord, TargetRecord};
use lexisplat::stream::{Compressed, PackedFile};
use lexisplat::{CompressReport, Dictionary, Layout, Record, ShDegree};
use serde::{Deserialize, Serialize, Serializer};

use crate::facts::{ByteCount, ROUNDING, RecordReport, attribute_bytes, sh_bytes};
use crate::target::MIN_PSNR;

/// Largest usual difference of the judged quality and the worst view, in dB. A larger difference is a sign of views unlike
/// photographs. Ten models had at most 4.2 at the default preset (docs/results/promise.md), and a courtyard whose views
/// stood outside its walls 11.
const WIDE_SPREAD: f64 = 8.0;
/// Largest usual difference of the mean of all views and the worst view, in dB. With a larger difference the file is much
/// larger than one of the same mean PSNR. At `--min-psnr 38` six models without cameras have 1.1 to 5.5, with cameras 0.4
/// to 2.6. Without cameras flowers has 6.6 and fruit-drops 8.2.
const MUCH_ABOVE: f64 = 6.0;

/// The result of a compression, apart from the file.
///
/// Serialised, it is the JSON report of `lexisplat compress`. The keys are the names of the fields, except for renamed
/// fields.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CompressionReport {
    /// Number of Gaussians in the file.
    pub gaussians: usize,
    /// SH degree, 0 to 4.
    pub sh_degree: u8,
    /// Number of atoms.
    pub atoms: usize,
    /// Layout of the file.
    #[serde(serialize_with = "name")]
    pub layout: Layout,
    /// How the file was made, and its errors. The keys are the fields of [`RecordReport`].
    #[serde(flatten, serialize_with = "record")]
    pub record: Record,
    /// Mean number of nonzeros of a Gaussian. An escape counts as a vector without zeros.
    pub mean_nonzeros: f64,
    /// The paper's ratio: number of SH-rest coefficients over the mean number of nonzeros. `None` if there are no nonzeros.
    pub coefficient_ratio: Option<f64>,
    /// Number of Gaussians for each number of nonzeros, from 0 to the dimension, without escapes.
    pub nonzero_histogram: Vec<u64>,
    /// Number of Gaussians whose SH are stored exactly.
    pub escapes: u64,
    /// Size of the source, in bytes.
    #[serde(rename = "ply_bytes")]
    pub source_bytes: u64,
    /// Size of the file, in bytes.
    pub file_bytes: u64,
    /// Bytes of the file that hold SH-rest.
    #[serde(serialize_with = "eighths")]
    pub sh_bytes: f64,
    /// Bytes of the same SH-rest as dense `f32` values.
    pub dense_sh_bytes: u64,
    /// Bytes of each attribute of the file by name, as returned by [`attribute_bytes()`].
    #[serde(serialize_with = "map")]
    pub attribute_bytes: Vec<(String, f64)>,
    /// The target asked for and the values reached, if the quality was a target.
    pub target: Option<TargetRecord>,
    /// The PSNR that the file reaches, if views judged it.
    pub reached: Option<ReachedRecord>,
    /// Origin of the sensitivity. `None` if the geometry is exact, because no sensitivity is needed then.
    pub sensitivity: Option<SensitivitySource>,
    /// The GPU that measured the sensitivity, or `cpu`. `None` if the geometry is exact.
    pub device: Option<String>,
    /// Number of Gaussians of the source that were left out or merged with others.
    pub removed: u64,
    /// The result of refining, if the scene was refined.
    pub refined: Option<RefineReport>,
    /// Whether a packed scene was measured and packed part by part.
    pub in_parts: bool,
    /// Number of rounds of learning. `None` if the dictionary was given or the file is packed. So are the next two fields.
    pub learn_rounds: Option<usize>,
    /// Number of Gaussians that the dictionary was learned from.
    pub learn_sample: Option<usize>,
    /// Mean number of nonzeros of Gaussians from which the dictionary was not learned.
    pub held_out_nonzeros: Option<f64>,
    /// Seconds spent reading the source.
    pub read_seconds: f64,
    /// Seconds spent measuring the sensitivity.
    pub look_seconds: f64,
    /// Seconds spent learning the dictionary.
    pub learn_seconds: f64,
    /// Seconds spent coding and verifying.
    pub code_seconds: f64,
    /// Seconds spent on all steps that make a file of a scene, learning and coding among them.
    pub pack_seconds: f64,
    /// Seconds spent writing the file.
    pub write_seconds: f64,
    /// Seconds spent in all.
    pub total_seconds: f64,
    /// Oddities of the source, one sentence each.
    pub warnings: Vec<String>,
    /// The dictionary of a file with exact geometry.
    #[serde(skip)]
    pub dictionary: Option<Dictionary>,
}

/// Returns by how much the worst view falls short of the judged quality, in dB, if this exceeds 8 dB: photographs may then
/// be as hard as that view. Returns `None` for a smaller difference, and for given views, which are the views that count.
#[must_use]
pub fn uncertain_by(reached: &ReachedRecord) -> Option<f64> {
    let below = reached.judged_psnr - reached.min_psnr;
    (!reached.cameras && below > WIDE_SPREAD).then_some(below)
}

/// Returns by how much the mean of all views exceeds the worst view, in dB, if the target is a least PSNR of each view and
/// this exceeds 6 dB: the file then spends much on few views. Returns `None` otherwise.
#[must_use]
pub fn overshoot(target: &TargetRecord) -> Option<f64> {
    let above = target.mean_psnr - target.min_psnr;
    (target.kind == MIN_PSNR && above > MUCH_ABOVE).then_some(above)
}

/// The result of refining, before quantisation. Of a scene in parts, numbers are sums over the parts, and decibels are means over
/// the Gaussians.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct RefineReport {
    /// Number of steps of the fit of all values.
    pub steps: usize,
    /// Number of Gaussians that were fitted.
    pub gaussians: usize,
    /// Judged PSNR of their pictures before the fit, in dB.
    pub before_psnr: f64,
    /// Judged PSNR of their pictures after the fit, in dB.
    pub after_psnr: f64,
}

impl RefineReport {
    /// Returns the result of all `parts`, in their order; `None` if there are none.
    #[must_use]
    pub fn of_parts(parts: impl IntoIterator<Item = Self>) -> Option<Self> {
        parts.into_iter().reduce(Self::with_part)
    }

    fn with_part(self, next: Self) -> Self {
        let gaussians = self.gaussians + next.gaussians;
        let share = next.gaussians as f64 / gaussians.max(1) as f64;
        let mean = |before: f64, own: f64| before + share * (own - before);
        Self {
            steps: self.steps + next.steps,
            gaussians,
            before_psnr: mean(self.before_psnr, next.before_psnr),
            after_psnr: mean(self.after_psnr, next.after_psnr),
        }
    }
}

/// Origin of the sensitivity of a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum SensitivitySource {
    /// Measured in drawn views of the scene.
    Views,
    /// Guessed from each Gaussian alone.
    Guess,
}

impl CompressionReport {
    /// Returns the fields of a report that all layouts have in common.
    fn new(
        layout: Layout,
        gaussians: usize,
        degree: ShDegree,
        record: &Record,
        report: &CompressReport,
        tensors: &[(String, u64)],
    ) -> Self {
        let attributes = attribute_bytes(tensors, &report.stream_bits);
        Self {
            gaussians,
            sh_degree: degree.get(),
            layout,
            record: record.clone(),
            mean_nonzeros: report.mean_nonzeros,
            coefficient_ratio: report.coefficient_ratio(),
            nonzero_histogram: report.nonzero_histogram.clone(),
            escapes: report.escapes,
            file_bytes: tensors.iter().map(|t| t.1).sum(),
            sh_bytes: sh_bytes(&attributes),
            dense_sh_bytes: (gaussians * degree.rest() * size_of::<f32>()) as u64,
            attribute_bytes: attributes,
            learn_rounds: report.learned.as_ref().map(|l| l.rounds),
            learn_sample: report.learned.as_ref().map(|l| l.sample),
            held_out_nonzeros: report.learned.as_ref().map(|l| l.held_out_nonzeros),
            learn_seconds: report.learn_seconds,
            code_seconds: report.code_seconds,
            pack_seconds: report.learn_seconds + report.code_seconds,
            ..Self::default()
        }
    }

    /// Returns the report of a file with exact geometry.
    pub(crate) fn exact(done: Compressed, layout: Layout) -> Self {
        let Compressed { gaussians, dictionary, record, report, tensor_bytes, write_seconds, .. } = done;
        let shared = Self::new(layout, gaussians, dictionary.degree(), &record, &report, &tensor_bytes);
        Self { atoms: dictionary.len(), write_seconds, dictionary: Some(dictionary), ..shared }
    }

    /// Returns the report of a packed file. `tensors` has the bytes of each tensor.
    pub(crate) fn packed(
        head: &PackedHead,
        report: &CompressReport,
        tensors: &[(String, u64)],
        source: SensitivitySource,
    ) -> Self {
        let (gaussians, degree, record) = (head.gaussians, head.degree, &head.record);
        Self {
            atoms: head.atoms,
            removed: head.removed,
            target: head.target.clone(),
            reached: head.reached,
            sensitivity: Some(source),
            device: Some(head.device.as_deref().unwrap_or("cpu").to_owned()),
            ..Self::new(Layout::Packed, gaussians, degree, record, report, tensors)
        }
    }

    /// Returns the report of a file that was packed part by part. `guessed` tells whether the sensitivity was guessed.
    #[must_use]
    pub fn in_parts(done: &PackedFile, guessed: bool) -> Self {
        let origin = if guessed { SensitivitySource::Guess } else { SensitivitySource::Views };
        let report = Self::packed(&done.head, &done.report, &done.tensor_bytes, origin);
        Self { in_parts: true, ..report }
    }
}

fn name<S: Serializer>(layout: &Layout, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(layout.name())
}

fn record<S: Serializer>(record: &Record, serializer: S) -> Result<S::Ok, S::Error> {
    RecordReport::from(record).serialize(serializer)
}

/// Rounds bytes to an eighth. Streams need not be whole bytes; the sums of their bits are exact to an eighth of a byte.
fn to_bits(bytes: f64) -> f64 {
    (bytes * 8.0).round() / 8.0
}

/// Rounds bytes to bits. The entry `rounding` takes the difference, so that the sum stays the same.
fn rounded(attributes: &[(String, f64)]) -> Vec<(&str, ByteCount)> {
    let mut left = to_bits(attributes.iter().map(|a| a.1).sum());
    left -= attributes.iter().filter(|a| a.0 != ROUNDING).map(|a| to_bits(a.1)).sum::<f64>();
    let own = |(name, bytes): &'_ (String, f64)| if name == ROUNDING { left } else { to_bits(*bytes) };
    attributes.iter().map(|named| (named.0.as_str(), ByteCount::from(own(named)))).collect()
}

fn eighths<S: Serializer>(bytes: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    ByteCount::from(to_bits(*bytes)).serialize(serializer)
}

fn map<S: Serializer>(attributes: &[(String, f64)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(rounded(attributes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounded_parts_add_up() {
        let thirds = |name: &str, bytes: f64| (name.to_owned(), bytes / 3.0);
        let attributes =
            [thirds("scale", 10.0), thirds("dc", 10.0), thirds("position", 10.0), thirds(ROUNDING, 30.0)];
        let found = rounded(&attributes);
        let bytes = |count: &ByteCount| match count {
            ByteCount::Whole(bytes) => *bytes as f64,
            ByteCount::Fraction(bytes) => *bytes,
        };
        assert_eq!(found.iter().map(|a| bytes(&a.1)).sum::<f64>(), 20.0);
        assert_eq!(found.iter().map(|a| a.0).collect::<Vec<_>>(), ["scale", "dc", "position", ROUNDING]);
    }

    #[test]
    fn views_that_differ_much_make_a_result_uncertain() {
        let reached =
            |min_psnr, cameras| uncertain_by(&ReachedRecord::new([40.0, 42.0, min_psnr], 12, cameras));
        assert_eq!(reached(33.0, false), None);
        assert_eq!(reached(28.0, false), Some(12.0));
        assert_eq!(reached(28.0, true), None);
    }

    #[test]
    fn one_hard_view_makes_a_file_overshoot() {
        let overshoot =
            |target: &str, mean, least| overshoot(&TargetRecord::new(target, 38.0, [mean, least], 24, false));
        assert_eq!(overshoot("min-psnr", 48.5, 38.5), Some(10.0));
        assert_eq!(overshoot("min-psnr", 42.5, 38.5), None);
        assert_eq!(overshoot("psnr", 48.5, 38.5), None);
    }
}
