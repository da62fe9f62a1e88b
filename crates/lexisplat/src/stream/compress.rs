//! The exact layouts: sample and learn first, then code and set aside, then write.

use std::io::Write;
use std::path::Path;

use super::counted::Counted;
use crate::formats::lexi::SpilledModel;
use crate::formats::ply::PlyChunks;
use crate::sparse::compress::{AT_ONCE, CompressOptions, CompressReport, Encoder};
use crate::sparse::dictionary::Dictionary;
use crate::sparse::model::{Layout, Record};
use crate::support::error::{Error, Result};
use crate::support::limits::{Limits, MAX_GAUSSIANS};
use crate::support::output::{Output, write_whole};
use crate::support::parallel::GAUSSIANS_PER_TASK as CHUNK;
use crate::support::progress::{Progress, Stage};
use crate::support::stopwatch::Stopwatch;

/// What [`compress_file`] did.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Compressed {
    /// Number of Gaussians.
    pub gaussians: usize,
    /// The atoms.
    pub dictionary: Dictionary,
    /// What the file says of itself.
    pub record: Record,
    /// How learning and coding went.
    pub report: CompressReport,
    /// Bytes of each tensor, and of the header under `header`, as [`lexi::attribute_bytes`](crate::formats::lexi::attribute_bytes).
    pub attribute_bytes: Vec<(String, u64)>,
    /// Seconds spent writing the file, all else done.
    pub write_seconds: f64,
}

impl Compressed {
    /// Size of the file.
    #[must_use]
    pub fn file_bytes(&self) -> u64 {
        self.attribute_bytes.iter().map(|a| a.1).sum()
    }

    /// Bytes that stand for SH-rest, as [`lexi::sh_bytes`](crate::formats::lexi::sh_bytes).
    #[must_use]
    pub fn sh_bytes(&self) -> u64 {
        self.attribute_bytes.iter().filter(|a| crate::formats::lexi::is_sh(&a.0)).map(|a| a.1).sum()
    }
}

/// Compresses `ply` to the file `output`, whole or not at all: the bytes that
/// [`compress()`](crate::compress()) and [`lexi::write`](crate::formats::lexi::write()) would make.
///
/// # Errors
/// As those two, [`Error::Io`] also for temporary files beside `output`.
pub fn compress_file<'a>(
    ply: &PlyChunks<'_>,
    options: &CompressOptions,
    output: impl Into<Output<'a>>,
    progress: &dyn Progress,
) -> Result<Compressed> {
    let output = output.into();
    run(ply, options, &output.spill_folder()?, AT_ONCE, progress, |fill, bytes| {
        write_whole(output.of_bytes(bytes), |writer| fill(writer).map_err(|e| Error::io(output.path(), e)))
    })
}

/// [`compress_file`] to a writer; temporary files are where the system wants them.
///
/// # Errors
/// As [`compress_file`]; [`Error::Writer`] if the writer fails.
pub fn compress_to(
    ply: &PlyChunks<'_>,
    options: &CompressOptions,
    writer: &mut impl Write,
    progress: &dyn Progress,
) -> Result<Compressed> {
    run(ply, options, &std::env::temp_dir(), AT_ONCE, progress, |fill, _| fill(writer).map_err(Error::writer))
}

/// Writes a file, whose size is told too, to a writer.
type Fill<'a> = dyn FnMut(&mut dyn Write) -> std::io::Result<()> + 'a;

/// `at_once` Gaussians, a multiple of [`CHUNK`], are in memory at a time.
fn run(
    ply: &PlyChunks<'_>,
    options: &CompressOptions,
    folder: &Path,
    at_once: usize,
    progress: &dyn Progress,
    write: impl FnOnce(&mut Fill<'_>, u64) -> Result<()>,
) -> Result<Compressed> {
    debug_assert!(at_once.is_multiple_of(CHUNK), "sums would be added in another order");
    let n = ply.len();
    Limits::check("Gaussians", n as u64, MAX_GAUSSIANS)?;
    if options.layout == Layout::Packed {
        let expected = "f32, f16 or paper: layout packed is what `pack_file` writes";
        return Err(Error::parameter("layout", options.layout, expected));
    }
    let clock = Stopwatch::start();
    let mut fetch = |numbers: &[usize], out: &mut Vec<f32>| ply.read_rest(numbers, out);
    let (encoder, learned) = Encoder::new(ply.degree(), n, &mut fetch, options, progress)?;
    let learn_seconds = clock.seconds();
    let clock = Stopwatch::start();
    let mut splats = ply.empty();
    let mut set_aside = SpilledModel::new(folder, &splats, ply.has_normals(), options.layout)?;
    let mut coded = encoder.nothing();
    progress.begin(Stage::Code, n as u64);
    for start in (0..n).step_by(at_once) {
        let range = start..n.min(start + at_once);
        ply.read(range.clone(), &mut splats)?;
        encoder.code(&splats.sh_rest, range, &mut coded, progress);
        set_aside.push(&splats.geometry, &coded)?;
        coded.clear();
    }
    progress.end();
    let (record, report) = coded.tally.into_report(options, n, learned, [learn_seconds, clock.seconds()]);
    let clock = Stopwatch::start();
    let attribute_bytes = set_aside.finish(&encoder.dictionary, &record, ply.meta(), |fill, bytes| {
        progress.begin(Stage::Write, bytes);
        write(&mut |writer| fill(&mut Counted { writer, progress }), bytes)?;
        progress.end();
        Ok(())
    })?;
    let write_seconds = clock.seconds();
    let dictionary = encoder.dictionary;
    Ok(Compressed { gaussians: n, dictionary, record, report, attribute_bytes, write_seconds })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Extra, ExtraValues, Silent, Splats, compress, lexi, ply};

    /// More than two chunks, with normals, extras of several widths, and rows that no code reaches.
    fn scene() -> Splats {
        let mut splats = crate::support::testing::scene(2 * CHUNK + 77, 3);
        let n = splats.len();
        splats.geometry.normals = vec![[0.0; 3]; n];
        splats.geometry.normals[n - 1] = [0.0, 1.0, 0.0];
        let numbers = || (0..n).map(|i| i as f64);
        splats.geometry.extras = vec![
            Extra { name: "a".into(), values: ExtraValues::U8(vec![7; n]) },
            Extra { name: "b".into(), values: ExtraValues::F64(numbers().collect()) },
        ];
        for i in [5, CHUNK, n - 1] {
            splats.sh_rest[45 * i] = 1e20;
        }
        splats
    }

    fn streamed(bytes: &[u8], options: &CompressOptions, drop_invalid: bool, at_once: usize) -> Vec<u8> {
        let read = ply::ReadOptions { drop_invalid, ..ply::ReadOptions::default() };
        let chunks = PlyChunks::open("t.ply", bytes, &read, &Silent).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let mut out = Vec::new();
        let done = run(&chunks, options, folder.path(), at_once, &Silent, |fill, _| {
            fill(&mut out).map_err(|e| Error::io("out", e))
        })
        .unwrap();
        assert_eq!(done.file_bytes(), out.len() as u64);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        out
    }

    fn in_memory(bytes: &[u8], options: &CompressOptions, drop_invalid: bool) -> Vec<u8> {
        let read = ply::ReadOptions { drop_invalid, ..ply::ReadOptions::default() };
        let splats = ply::read_bytes("t.ply", bytes, &read).unwrap().splats;
        let mut out = Vec::new();
        lexi::write_to(&mut out, &compress(splats, options, &Silent).unwrap().0).unwrap();
        out
    }

    fn quick(layout: Layout) -> CompressOptions {
        // Few atoms and a small sample: learning is not what is tested.
        CompressOptions { layout, atoms: Some(20), sample: 500, ..CompressOptions::default() }
    }

    #[test]
    fn the_bytes_are_those_of_the_whole_scene_in_every_layout() {
        let mut bytes = Vec::new();
        ply::write_to(&mut bytes, &scene()).unwrap();
        for layout in [Layout::F16, Layout::F32, Layout::Paper] {
            let options = quick(layout);
            let expected = in_memory(&bytes, &options, false);
            for at_once in [CHUNK, 2 * CHUNK, AT_ONCE] {
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
        ply::write_to(&mut bytes, &splats).unwrap();
        let options = CompressOptions { max_nonzeros: Some(3), ..quick(Layout::F16) };
        // The only Gaussian with a normal is among those left out.
        assert!(streamed(&bytes, &options, true, CHUNK) == in_memory(&bytes, &options, true));
    }

    #[test]
    fn scenes_without_sh_and_without_gaussians() {
        for (count, degree) in [(3000, 0), (0, 0), (0, 3), (1, 3), (CHUNK, 1)] {
            let full = crate::support::testing::scene(count, 1);
            let splats = full.with_degree_cut(crate::ShDegree::new(degree).unwrap());
            let mut bytes = Vec::new();
            ply::write_to(&mut bytes, &splats).unwrap();
            let options = quick(Layout::F16);
            let expected = in_memory(&bytes, &options, false);
            assert!(streamed(&bytes, &options, false, CHUNK) == expected, "{count} {degree}");
        }
    }

    #[test]
    fn no_temporary_file_stays_after_an_error() {
        let mut bytes = Vec::new();
        ply::write_to(&mut bytes, &scene()).unwrap();
        let chunks = PlyChunks::open("t.ply", &bytes, &ply::ReadOptions::default(), &Silent).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("out.lexi");
        std::fs::create_dir(&output).unwrap();
        let error = compress_file(&chunks, &quick(Layout::F16), &output, &Silent).unwrap_err();
        assert!(matches!(&error, Error::Io { file, .. } if file.ends_with("out.lexi")), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
