//! Packing of scenes bucket by bucket, in one process.

use super::observer::Observer;
use super::order::{Ordered, begin_reading, survey};
use crate::formats::lexi::LexiWriter;
use crate::packed::tiles::{
    Assembly, BUCKET, Coded, Coding, Looked, PackedFile, Plan, Sample, Steps, Tables,
};
use crate::packed::{PackOptions, Packer, Refit, ToRefit};
use crate::scene::sensitivity::Sensitivity;
use crate::scene::source::SplatSource;
use crate::support::error::{Error, Result};
use crate::support::limits::{Limits, MAX_GAUSSIANS};
use crate::support::progress::{Progress, Stage};
use crate::support::sink::Sink;
use crate::support::spill::{SpillTo, Temporary};
use crate::support::stopwatch::Stopwatch;

/// Packs the scene of `source` so that its pictures have a PSNR of about `decibels` dB, and writes it to `sink`.
///
/// A scene is packed [bucket by bucket](crate::packed::tiles). `observer` draws each bucket, and steps, predictors and dictionary
/// are found from sums over all buckets. Without an observer, the sensitivity is guessed from each Gaussian alone. A scene of at
/// most [`BUCKET`] Gaussians is one bucket, and has the bytes that [`Packer`] gives it.
///
/// The bytes are the same on any number of threads. They are also those that other processes make of the same tiles, which
/// are the [parts](SplatSource::tiles) of `source`. Peak of anonymous memory is below 1.5 GiB at SH degree 3.
///
/// # Errors
/// [`Error::Parameter`] if options are out of range, if values are so large that sums of them leave f32, or if a
/// sensitivity does not fit its part or is not finite. [`Error::Io`] for `sink` and for temporary files.
/// [`Error::Cancelled`]. The errors of `observer`.
pub fn pack<'a, E: From<Error>>(
    source: &dyn SplatSource,
    observer: Option<&mut dyn Observer<E>>,
    options: &PackOptions,
    decibels: f64,
    sink: impl Into<Sink<'a>>,
    progress: &dyn Progress,
) -> Result<PackedFile, E> {
    run(source, observer, options, decibels, sink.into(), BUCKET, progress)
}

/// Packs as [`pack`] does, with buckets of about `bucket` Gaussians.
pub(crate) fn run<E: From<Error>>(
    source: &dyn SplatSource,
    mut observer: Option<&mut dyn Observer<E>>,
    options: &PackOptions,
    decibels: f64,
    sink: Sink<'_>,
    bucket: usize,
    progress: &dyn Progress,
) -> Result<PackedFile, E> {
    Limits::check("Gaussians", source.len() as u64, MAX_GAUSSIANS)?;
    options.check()?;
    if source.is_empty() {
        return Ok(without_gaussians(source, options, sink, progress)?);
    }
    let clock = Stopwatch::start();
    let folder = sink.spill_folder()?;
    let to = SpillTo::Folder(&folder);
    let tiles = match source.tiles() {
        [] => vec![source],
        tiles => tiles.to_vec(),
    };
    begin_reading(&tiles, progress);
    let surveys = survey(&tiles, options.seed, progress)?;
    let plan = Plan::with_bucket(&surveys, options, decibels, false, bucket)?;
    drop(surveys);
    let mut ordered = Ordered::new(&plan, &tiles, &folder, progress)?;
    progress.end();

    progress.begin(Stage::Look, plan.len() as u64);
    let (mut statistics, mut all_looked) = (Vec::new(), Messages::new(to)?);
    let groups: Vec<Vec<usize>> = (0..plan.groups()).map(|group| plan.group(group)).collect();
    let mut samples: Vec<Sample> = groups.iter().map(|_| Sample::new()).collect();
    for number in 0..plan.buckets() {
        progress.check()?;
        let bucket = ordered.bucket(&plan, number, false)?;
        let observed = observer.as_mut().map(|observer| observer.observe(bucket.splats())).transpose()?;
        let (own, looked) = bucket.look(&plan, observed)?;
        for (sample, _) in samples.iter_mut().zip(&groups).filter(|(_, group)| group.contains(&number)) {
            sample.add(&plan, &bucket, &looked)?;
        }
        all_looked.push(&looked.to_bytes())?;
        statistics.push(own);
        progress.advance(bucket.splats().len() as u64);
    }
    progress.end();
    let before = clock.seconds();
    let steps = Steps::new(&plan, &statistics)?;
    let sampled = samples.into_iter().map(|sample| sample.statistics(&plan, &steps));
    let coding = Coding::new(&plan, &steps, &sampled.collect::<Result<Vec<_>>>()?, progress)?;
    drop(statistics);
    let learn_seconds = clock.seconds() - before;

    progress.begin(Stage::Code, coding.kept() as u64);
    let (mut counts, mut all_coded) = (Vec::new(), Messages::new(to)?);
    for number in 0..plan.buckets() {
        progress.check()?;
        let bucket = ordered.bucket(&plan, number, true)?;
        let looked = Looked::from_bytes(&all_looked.read(number)?)?;
        let mut refit = observer.as_mut().map(|observer| |of: ToRefit<'_, '_>| observer.refit(of));
        let refit = refit.as_mut().map(|refit| refit as &mut Refit<'_, E>);
        let (own, coded) = coding.code(&plan, &bucket, &looked, refit, progress)?;
        counts.push(own);
        all_coded.push(&coded.to_bytes())?;
    }
    progress.end();
    drop((ordered, all_looked));
    let tables = Tables::new(&counts)?;
    let mut assembly = Assembly::new(&plan, &coding, &tables, 0, &folder)?;
    for number in 0..plan.buckets() {
        progress.check()?;
        let coded = Coded::from_bytes(&all_coded.read(number)?)?;
        assembly.push(coded.with_tables(&plan, &coding, &tables)?)?;
    }
    let device = observer.and_then(|observer| observer.device());
    let mut done = assembly.finish(&counts, device, sink, progress)?;
    done.report.learn_seconds = learn_seconds;
    done.report.code_seconds = clock.seconds() - before - learn_seconds;
    Ok(done)
}

/// Packs a scene without Gaussians, which has no buckets.
fn without_gaussians(
    source: &dyn SplatSource,
    options: &PackOptions,
    sink: Sink<'_>,
    progress: &dyn Progress,
) -> Result<PackedFile> {
    let packer = Packer::new(source.whole()?, &Sensitivity::default(), options)?;
    let (packed, report) = packer.pack(1.0, progress)?;
    let writer = LexiWriter::packed(&packed);
    let tensor_bytes = writer.tensor_bytes().to_vec();
    writer.write(sink, progress)?;
    Ok(PackedFile { head: packed.head().clone(), report, tensor_bytes })
}

/// One message of each bucket, in a temporary file.
struct Messages {
    file: Temporary,
    /// The start and the length of each message.
    spans: Vec<(u64, usize)>,
}

impl Messages {
    fn new(to: SpillTo<'_>) -> Result<Self> {
        Ok(Self { file: Temporary::new(to)?, spans: Vec::new() })
    }

    /// Adds the message of the next bucket.
    fn push(&mut self, message: &[u8]) -> Result<()> {
        self.spans.push((self.file.append(message)?, message.len()));
        Ok(())
    }

    /// Returns the message of bucket `number`; empty if there is none.
    fn read(&mut self, number: usize) -> Result<Vec<u8>> {
        let (start, length) = self.spans.get(number).copied().unwrap_or_default();
        let mut message = vec![0; length];
        self.file.read_at(start, &mut message)?;
        Ok(message)
    }
}

#[cfg(test)]
mod tests;
