//! Compression to the exact layouts, a part of the scene at a time.

use crate::formats::lexi::{CodeLayout, LexiWriter, SpilledModel};
use crate::scene::source::SplatSource;
use crate::sparse::compress::{CompressOptions, Encoded, encode};
use crate::sparse::dictionary::Dictionary;
use crate::sparse::model::Record;
use crate::sparse::tally::CompressReport;
use crate::support::error::Result;
use crate::support::parallel::AT_ONCE;
use crate::support::progress::Progress;
use crate::support::sink::Sink;
use crate::support::spill::SpillTo;
use crate::support::stopwatch::Stopwatch;

/// The results of [`compress`].
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Compressed {
    /// Number of Gaussians.
    pub gaussians: usize,
    /// The atoms of the file.
    pub dictionary: Dictionary,
    /// The parameters and the errors of the file.
    pub record: Record,
    /// A report of learning and coding.
    pub report: CompressReport,
    /// Number of bytes of each tensor, and of the header under the name `header`; see [`LexiWriter::tensor_bytes`].
    pub tensor_bytes: Vec<(String, u64)>,
    /// Seconds spent on writing the file, after everything was coded.
    pub write_seconds: f64,
}

impl Compressed {
    /// Returns the number of bytes of the file.
    #[must_use]
    pub fn file_bytes(&self) -> u64 {
        self.tensor_bytes.iter().map(|a| a.1).sum()
    }
}

/// Compresses the scene of `source` and writes it to `sink`. The bytes are those of [`compress()`](crate::compress()) and
/// [`LexiWriter::exact`].
///
/// # Errors
/// Errors of these two functions, and [`crate::Error::Io`] for temporary files.
pub fn compress<'a>(
    source: &dyn SplatSource,
    options: &CompressOptions,
    codes: CodeLayout,
    sink: impl Into<Sink<'a>>,
    progress: &dyn Progress,
) -> Result<Compressed> {
    run(source, options, codes, sink.into(), AT_ONCE, progress)
}

/// Compresses as [`compress`] does, with `at_once` Gaussians in memory at a time.
fn run(
    source: &dyn SplatSource,
    options: &CompressOptions,
    codes: CodeLayout,
    sink: Sink<'_>,
    at_once: usize,
    progress: &dyn Progress,
) -> Result<Compressed> {
    let folder = sink.spill_folder()?;
    let mut spilled = SpilledModel::new(SpillTo::Folder(&folder), source, codes, options.values)?;
    let mut splats = source.empty();
    let Encoded { dictionary, record, report, .. } =
        encode(source, options, at_once, progress, &mut |encoder, range, coded| {
            source.read(range.clone(), &mut splats)?;
            encoder.code(&splats.sh_rest, range, coded, progress)?;
            spilled.push(&splats.geometry, coded)?;
            encoder.clear(coded);
            Ok(())
        })?;
    let clock = Stopwatch::start();
    let writer = LexiWriter::spilled(spilled, &dictionary, &record, &splats.meta)?;
    let tensor_bytes = writer.tensor_bytes().to_vec();
    writer.write(sink, progress)?;
    let (gaussians, write_seconds) = (source.len(), clock.seconds());
    Ok(Compressed { gaussians, dictionary, record, report, tensor_bytes, write_seconds })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::support::parallel::GAUSSIANS_PER_TASK;
    use crate::{Error, Extra, ExtraValues, Layout, Silent, Splats, ply};

    /// A scene of more than two chunks, with normals, extra properties of several widths, and rows that no code reaches.
    fn scene() -> Splats {
        let mut splats = crate::support::testing::scene(2 * GAUSSIANS_PER_TASK + 77, 3);
        let n = splats.len();
        splats.geometry.normals = vec![[0.0; 3]; n];
        splats.geometry.normals[n - 1] = [0.0, 1.0, 0.0];
        let numbers = || (0..n).map(|i| i as f64);
        splats.geometry.extras = vec![
            Extra { name: "a".into(), values: ExtraValues::U8(vec![7; n]) },
            Extra { name: "b".into(), values: ExtraValues::F64(numbers().collect()) },
        ];
        for i in [5, GAUSSIANS_PER_TASK, n - 1] {
            splats.sh_rest[45 * i] = 1e20;
        }
        splats
    }

    fn streamed(bytes: &[u8], (options, codes): &Options, drop_invalid: bool, at_once: usize) -> Vec<u8> {
        let read = ply::ReadOptions { drop_invalid, ..ply::ReadOptions::default() };
        let chunks = ply::PlySource::open("t.ply", bytes, &read, &Silent).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("out.lexi");
        let done = run(&chunks, options, *codes, Sink::from(&output), at_once, &Silent).unwrap();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        let out = std::fs::read(output).unwrap();
        assert_eq!(done.file_bytes(), out.len() as u64);
        out
    }

    fn in_memory(bytes: &[u8], (options, codes): &Options, drop_invalid: bool) -> Vec<u8> {
        let read = ply::ReadOptions { drop_invalid, ..ply::ReadOptions::default() };
        let splats = ply::read_bytes("t.ply", bytes, &read).unwrap().splats;
        let mut out = Vec::new();
        let (model, _) = crate::compress(splats, options, &Silent).unwrap();
        LexiWriter::exact(&model, *codes).unwrap().write(&mut out, &Silent).unwrap();
        out
    }

    type Options = (CompressOptions, CodeLayout);

    /// Options with few atoms and a small sample, since learning is not under test.
    fn quick(layout: Layout) -> Options {
        let options = CompressOptions::default().with_values(layout.values()).with_atoms(20).with_sample(500);
        (options, layout.codes())
    }

    #[test]
    fn the_bytes_are_those_of_the_whole_scene_in_every_layout() {
        let mut bytes = Vec::new();
        ply::write(&mut bytes, &scene()).unwrap();
        for layout in [Layout::F16, Layout::F32, Layout::Paper] {
            let options = quick(layout);
            let expected = in_memory(&bytes, &options, false);
            for at_once in [GAUSSIANS_PER_TASK, 2 * GAUSSIANS_PER_TASK, AT_ONCE] {
                assert!(streamed(&bytes, &options, false, at_once) == expected, "{layout} {at_once}");
            }
        }
    }

    #[test]
    fn rows_left_out_move_the_borders_of_chunks() {
        let mut splats = scene();
        let n = splats.len();
        for i in (0..n).step_by(97).chain([n - 1]) {
            splats.geometry.scales[i][1] = f32::NAN;
        }
        let mut bytes = Vec::new();
        ply::write(&mut bytes, &splats).unwrap();
        let (options, codes) = quick(Layout::F16);
        let options = (options.with_max_nonzeros(3), codes);
        // The only Gaussian with a normal is left out.
        assert!(streamed(&bytes, &options, true, GAUSSIANS_PER_TASK) == in_memory(&bytes, &options, true));
    }

    #[test]
    fn scenes_without_sh_and_without_gaussians() {
        for (count, degree) in [(3000, 0), (0, 0), (0, 3), (1, 3), (GAUSSIANS_PER_TASK, 1)] {
            let full = crate::support::testing::scene(count, 1);
            let splats = full.with_degree_cut(crate::ShDegree::new(degree).unwrap());
            let mut bytes = Vec::new();
            ply::write(&mut bytes, &splats).unwrap();
            let options = quick(Layout::F16);
            let expected = in_memory(&bytes, &options, false);
            assert!(streamed(&bytes, &options, false, GAUSSIANS_PER_TASK) == expected, "{count} {degree}");
        }
    }

    #[test]
    fn no_temporary_file_stays_after_an_error() {
        let mut bytes = Vec::new();
        ply::write(&mut bytes, &scene()).unwrap();
        let chunks = ply::PlySource::open("t.ply", &bytes, &ply::ReadOptions::default(), &Silent).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("out.lexi");
        std::fs::create_dir(&output).unwrap();
        let (options, codes) = quick(Layout::F16);
        let error = compress(&chunks, &options, codes, &output, &Silent).unwrap_err();
        assert!(matches!(&error, Error::Io { file, .. } if file.ends_with("out.lexi")), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
