//! `PlayCanvas`' SOG: values of 8 bits in pictures, and a `meta.json` with their meaning (specification: "The SOG
//! format", developer.playcanvas.com; splat-transform, `write-sog.ts`, `read-sog.ts` and `read-sog-v1.ts`).
//!
//! A pixel of each picture belongs to a Gaussian. Positions have 16 bits along each axis, in two pictures. They are
//! between ends that `meta.json` has as logarithms. Scales and colours are indices into lists of 256 values. Rotations
//! are their three smallest components. SH are indices into a palette, which is a picture too. Version 1 has equal steps
//! between two ends instead of lists. It can be read, but is not written.

mod archive;
mod bundle;
mod code;
mod codebook;
mod meta;
mod palette;
mod picture;
mod streamed;
mod tree;
mod vectors;
mod write;

use std::ops::Range;

use lexisplat::ply::ReadOptions;
use lexisplat::sh::CHANNELS;
use lexisplat::{Error, Limits, Result, SceneMeta, ShDegree};
use serde_json::{Value, json};

use self::archive::{Archive, Files};
use self::meta::{Meta, Table};
use self::picture::{Budget, Picture};
use crate::rows::{Described, Rows, RowsMut};
use crate::siblings::Siblings;

pub use self::bundle::bundle;
pub(crate) use self::write::write;

/// Name of the file that describes the others.
const META: &str = "meta.json";
/// Number of entries of the palette in a row of its picture.
const ENTRIES_PER_ROW: usize = 64;
/// Largest number of entries of a palette. Their indices have 16 bits.
const MOST_ENTRIES: usize = 1 << 16;
/// Largest number of SH coefficients of a channel in a palette. It has room for degree 4.
const MOST_REST: usize = 24;
/// Largest number of pixels of a picture for each Gaussian. A picture whose sides are equal powers of two needs up to 4.
/// A picture of up to [`SMALL`] pixels may have more.
const MOST_SPARE: usize = 4;
const SMALL: usize = 1 << 20;
/// First bytes of a zip archive.
const ZIP: &[u8] = b"PK";

/// Reads the SOG in `bytes`, which messages call `name`: an archive, a `meta.json` beside pictures, or a `lod-meta.json`
/// beside folders of SOGs. Other files come from `siblings`.
///
/// # Errors
/// [`Error::Format`] for files that are missing or damaged, [`Error::Limit`] for pictures that are too large, and errors
/// of `siblings`.
pub(crate) fn read<'a>(
    name: &'a str,
    bytes: &'a [u8],
    siblings: Siblings<'a>,
    options: &ReadOptions,
) -> Result<(Described<'a>, Sizes)> {
    if streamed::is_index(bytes) {
        return streamed::read(name, bytes, siblings, options);
    }
    let Unit { rows, len, degree, antialiased, warnings, facts, sizes } =
        unit(name, bytes, siblings, String::new(), &options.limits)?;
    let meta = SceneMeta { antialiased, ..SceneMeta::default() };
    Ok((Described { rows: Box::new(rows), len, degree, meta, warnings, facts }, sizes))
}

/// Numbers of bytes of the files of a SOG.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Sizes {
    /// Number of bytes of all files.
    pub(crate) all: u64,
    /// Number of bytes that count when limits are checked: those of files and members that are read, for each at most the
    /// bytes of its picture.
    pub(crate) counted: u64,
}

impl Sizes {
    /// Returns the sizes of a single file of `bytes` bytes.
    pub(crate) fn of(bytes: usize) -> Self {
        Self { all: bytes as u64, counted: bytes as u64 }
    }
}

/// One SOG of a scene.
#[derive(Debug)]
struct Unit {
    rows: SogRows,
    len: usize,
    degree: ShDegree,
    antialiased: bool,
    warnings: Vec<String>,
    facts: Vec<(&'static str, Value)>,
    sizes: Sizes,
}

/// Reads the SOG in `bytes`: an archive, or the `meta.json` of `folder`. The name of a folder ends with `/`; an empty
/// name is the folder of `siblings`.
fn unit(name: &str, bytes: &[u8], siblings: Siblings<'_>, folder: String, limits: &Limits) -> Result<Unit> {
    let is_archive = bytes.starts_with(ZIP);
    let (files, meta, stored) = if is_archive {
        let archive = Archive::open(name, bytes)?;
        archive.expect(META)?;
        let files = Files::Archive(archive);
        let content = files.get(META, limits)?;
        limits.check_header(name, content.len() as u64)?;
        let meta = Meta::parse(name, &content)?;
        (files, meta, content.stored())
    } else {
        limits.check_header(name, bytes.len() as u64)?;
        (Files::Beside(name, siblings, folder), Meta::parse(name, bytes)?, bytes.len() as u64)
    };
    limits.check_gaussians(name, meta.count)?;
    let len = usize::try_from(meta.count).unwrap_or(usize::MAX);
    let mut loader = Loader {
        files,
        len,
        lossy: Vec::new(),
        all_bytes: bytes.len() as u64,
        budget: Budget { name, limits, file_bytes: stored, taken: 0 },
    };
    let [low, high] = &meta.means_files;
    let [low, high] = [loader.load(low)?, loader.load(high)?];
    let quats = loader.load(&meta.quats_file)?;
    let scales = loader.load(&meta.scales_file)?;
    let colours = loader.load(&meta.sh0_file)?;
    let palette = meta.sh.as_ref().map(|sh| loader.palette(sh)).transpose()?;
    let mut warnings = meta.warnings;
    let odd = (0..len).filter(|&i| quats.pixel(i)[3] < code::FIRST_MODE).count();
    if odd > 0 {
        warnings.push(format!("{odd} rotations have no mode from 252 to 255, and are taken as none"));
    }
    for file in &loader.lossy {
        warnings.push(format!("the picture '{file}' was written with loss: its values are not exact"));
    }
    let all = if is_archive { bytes.len() as u64 } else { loader.all_bytes };
    let sizes = Sizes { all, counted: loader.budget.file_bytes };
    let mut facts = vec![("version", json!(meta.version)), ("archive", json!(is_archive))];
    facts.extend(meta.generator.map(|generator| ("generator", json!(generator))));
    facts.push(("width", json!(low.width)));
    facts.push(("height", json!(low.height)));
    facts.extend(palette.as_ref().map(|palette| ("palette", json!(palette.entries))));
    let degree = palette.as_ref().map_or(ShDegree::ZERO, |palette| palette.degree);
    let rows = SogRows {
        ends: meta.ends,
        means: [low, high],
        quats,
        scales,
        scale_values: meta.scales,
        colours,
        colour_values: meta.colours,
        opacity_values: meta.opacities,
        palette,
    };
    Ok(Unit { rows, len, degree, antialiased: meta.antialiased, warnings, facts, sizes })
}

/// Decodes the pictures of a scene.
struct Loader<'a> {
    files: Files<'a>,
    /// Number of Gaussians.
    len: usize,
    /// Names of files that were written with loss.
    lossy: Vec<String>,
    /// Number of bytes of all files.
    all_bytes: u64,
    budget: Budget<'a>,
}

impl Loader<'_> {
    fn malformed(&self, text: String) -> Error {
        Error::malformed(self.budget.name, text)
    }

    /// Returns the picture in the file `called`, of at most `most` pixels.
    fn picture(&mut self, called: &str, most: usize) -> Result<Picture> {
        let content = self.files.get(called, self.budget.limits)?;
        let stored = content.stored();
        self.all_bytes = self.all_bytes.saturating_add(stored);
        let picture = Picture::read(called, (&content, stored), most, &mut self.budget)?;
        if picture.is_lossy {
            self.lossy.push(called.escape_debug().to_string());
        }
        Ok(picture)
    }

    /// Returns the picture in the file `called`, which has a pixel for each Gaussian.
    fn load(&mut self, called: &str) -> Result<Picture> {
        let picture = self.picture(called, self.len.saturating_mul(MOST_SPARE).max(SMALL))?;
        if picture.len() < self.len {
            let (width, height, len) = (picture.width, picture.height, self.len);
            let text = format!("the picture '{called}' has {width} x {height} pixels for {len} Gaussians");
            return Err(self.malformed(text));
        }
        Ok(picture)
    }

    fn palette(&mut self, sh: &meta::ShMeta) -> Result<Palette> {
        let [palette, labels] = &sh.files;
        let picture = self.picture(palette, MOST_ENTRIES * MOST_REST)?;
        let (width, height) = (picture.width, picture.height);
        let odd = |expected: String| format!("the picture '{palette}' is {width} x {height}, not {expected}");
        let of_width = |degree: &ShDegree| ENTRIES_PER_ROW * degree.rest_per_channel() == width;
        let (degree, entries) = match sh.palette {
            Some((degree, entries)) if of_width(&degree) && entries <= ENTRIES_PER_ROW * height => {
                (degree, entries)
            }
            Some((degree, entries)) => {
                let rows = entries.div_ceil(ENTRIES_PER_ROW);
                let expected = ENTRIES_PER_ROW * degree.rest_per_channel();
                return Err(self.malformed(odd(format!("{expected} x {rows} for {entries} entries"))));
            }
            None => {
                let degrees = [9, 24, 45].into_iter().filter_map(ShDegree::from_rest);
                let degree = degrees.into_iter().find(of_width);
                let degree = degree.ok_or_else(|| self.malformed(odd("192, 512 or 960 wide".to_owned())))?;
                (degree, ENTRIES_PER_ROW * height)
            }
        };
        if entries > MOST_ENTRIES {
            return Err(
                self.malformed(format!("{entries} entries of the palette, and {MOST_ENTRIES} are most"))
            );
        }
        let labels = self.load(labels)?;
        let palette = Palette { degree, entries, picture, labels, values: sh.values };
        if let Some(i) = (0..self.len).find(|&i| palette.label(i) >= entries) {
            let label = palette.label(i);
            let text = format!("Gaussian {i} has entry {label} of the palette, which has {entries}");
            return Err(self.malformed(text));
        }
        Ok(palette)
    }
}

/// SH entries that Gaussians share.
#[derive(Debug)]
struct Palette {
    degree: ShDegree,
    entries: usize,
    /// Picture with a pixel for each coefficient of each entry.
    picture: Picture,
    /// Picture with the index of each Gaussian's entry.
    labels: Picture,
    values: Table,
}

impl Palette {
    /// Returns the index of the entry of Gaussian `i`.
    fn label(&self, i: usize) -> usize {
        let [low, high, ..] = self.labels.pixel(i);
        u16::from_le_bytes([low, high]).into()
    }

    /// Decodes the SH of Gaussian `i`, channel by channel.
    fn fill(&self, i: usize, rest: &mut [f32]) {
        let per = self.degree.rest_per_channel();
        // The entries follow each other without gaps, because a row of the picture ends with an entry.
        let at = self.label(i) * per;
        for k in 0..per {
            let pixel = self.picture.pixel(at + k);
            for c in 0..CHANNELS {
                rest[c * per + k] = self.values[usize::from(pixel[c])];
            }
        }
    }
}

#[derive(Debug)]
struct SogRows {
    ends: [[f64; 2]; 3],
    /// Low and high bytes of positions.
    means: [Picture; 2],
    quats: Picture,
    scales: Picture,
    scale_values: [Table; 3],
    /// Colours and opacities.
    colours: Picture,
    colour_values: [Table; 3],
    opacity_values: Table,
    palette: Option<Palette>,
}

impl Rows for SogRows {
    fn fill(&self, range: Range<usize>, out: RowsMut<'_>) {
        let per = self.palette.as_ref().map_or(0, |palette| palette.degree.rest());
        for (j, i) in range.enumerate() {
            let [low, high] = [self.means[0].pixel(i), self.means[1].pixel(i)];
            out.positions[j] =
                [0, 1, 2].map(|k| code::position(u16::from_le_bytes([low[k], high[k]]), self.ends[k]));
            out.rotations[j] = code::rotation(self.quats.pixel(i));
            let scales = self.scales.pixel(i);
            out.scales[j] = [0, 1, 2].map(|k| self.scale_values[k][usize::from(scales[k])]);
            let colours = self.colours.pixel(i);
            out.dc[j] = [0, 1, 2].map(|k| self.colour_values[k][usize::from(colours[k])]);
            out.opacities[j] = self.opacity_values[usize::from(colours[3])];
            if let Some(palette) = &self.palette {
                palette.fill(i, &mut out.sh_rest[j * per..(j + 1) * per]);
            }
        }
    }

    fn is_finite(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests;
