//! The layout of a .ksplat. It is checked when the headers are read, so that every row and every centre is within the
//! file.

use lexisplat::{Error, FormatError, Result, ShDegree};

use super::values::{f32_at, u16_at};

/// Number of bytes of the file's header (`SplatBuffer.HeaderSizeBytes`).
pub(super) const HEADER: usize = 4096;
/// Number of bytes of a section's header (`SplatBuffer.SectionHeaderSizeBytes`).
pub(super) const SECTION_HEADER: usize = 1024;
/// Number of bytes of a bucket's centre, three f32 (`SplatBuffer.BucketStorageSizeBytes`).
pub(super) const CENTRE: usize = 12;
/// Half of the number of steps of a position within its bucket, if a section states 0
/// (`SplatBuffer.CompressionLevels[1].ScaleRange`).
const DEFAULT_RANGE: u32 = 32_767;
/// Largest absolute SH value of a byte, if the header states 0 (`DefaultSphericalHarmonics8BitCompressionHalfRange`).
const DEFAULT_SH: f32 = 1.5;
/// Highest SH degree that fits in a row.
const MAX_DEGREE: u16 = 3;

/// Compression level: the types of values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Level {
    /// Level 0: f32.
    Whole,
    /// Level 1: f16.
    Half,
    /// Level 2: f16, and SH in bytes.
    Bytes,
}

impl Level {
    fn of(number: u16) -> Option<Self> {
        [Self::Whole, Self::Half, Self::Bytes].get(usize::from(number)).copied()
    }

    pub(super) fn number(self) -> u8 {
        self as u8
    }

    fn is_whole(self) -> bool {
        self == Self::Whole
    }

    /// Returns the byte of a row at which its scales begin. The position is before them.
    pub(super) fn scales(self) -> usize {
        if self.is_whole() { 12 } else { 6 }
    }

    pub(super) fn rotation(self) -> usize {
        2 * self.scales()
    }

    /// Returns the byte of a row at which its colour and opacity begin.
    pub(super) fn colour(self) -> usize {
        self.rotation() + if self.is_whole() { 16 } else { 8 }
    }

    pub(super) fn harmonics(self) -> usize {
        self.colour() + 4
    }

    pub(super) fn harmonic_bytes(self) -> usize {
        match self {
            Self::Whole => 4,
            Self::Half => 2,
            Self::Bytes => 1,
        }
    }

    fn row_bytes(self, degree: ShDegree) -> usize {
        self.harmonics() + degree.rest() * self.harmonic_bytes()
    }
}

/// A section of the file, which has Gaussians.
#[derive(Debug)]
pub(super) struct Section<'a> {
    /// Number of the section's first Gaussian in the scene.
    pub(super) first: usize,
    len: usize,
    pub(super) degree: ShDegree,
    row_bytes: usize,
    rows: &'a [u8],
    /// Side of a bucket, in world units.
    pub(super) block: f32,
    /// Half of the number of steps of a position.
    pub(super) range: u32,
    centres: &'a [[u8; CENTRE]],
    /// Number of Gaussians of a full bucket, and number of full buckets. Full buckets come first.
    capacity: usize,
    full: usize,
    /// For each bucket that is not full: the number of the Gaussian after its last one.
    ends: Vec<usize>,
}

impl Section<'_> {
    pub(super) fn end(&self) -> usize {
        self.first + self.len
    }

    /// Returns the bytes of Gaussian `i` of the section.
    pub(super) fn row(&self, i: usize) -> &[u8] {
        &self.rows[i * self.row_bytes..(i + 1) * self.row_bytes]
    }

    /// Returns the centre of the bucket of Gaussian `i` of the section.
    pub(super) fn centre(&self, i: usize) -> [f32; 3] {
        let bucket = if i < self.full.saturating_mul(self.capacity) {
            i / self.capacity
        } else {
            self.full + self.ends.partition_point(|&end| end <= i)
        };
        let centre = &self.centres[bucket];
        [0, 4, 8].map(|at| f32_at(centre, at))
    }
}

/// The contents of the headers.
#[derive(Debug)]
pub(super) struct Layout<'a> {
    pub(super) version: String,
    pub(super) level: Level,
    pub(super) gaussians: usize,
    /// Highest SH degree of the sections.
    pub(super) degree: ShDegree,
    /// SH values of bytes 0 and 255.
    pub(super) sh_bounds: [f32; 2],
    pub(super) sections: Vec<Section<'a>>,
}

impl<'a> Layout<'a> {
    /// Reads and checks the headers of the file `bytes`, which messages call `name`.
    pub(super) fn of(name: &str, bytes: &'a [u8]) -> Result<Self> {
        let bad = |text: String| Error::malformed(name, text);
        let mut rest = bytes;
        let header = take(name, "the header", bytes, &mut rest, HEADER)?;
        let (major, minor) = (header[0], header[1]);
        if major != 0 || minor == 0 {
            return Err(bad(format!("version {major}.{minor} of .ksplat is not known")));
        }
        let number = u16_at(header, 20);
        let level =
            Level::of(number).ok_or_else(|| bad(format!("compression level {number} is not 0, 1 or 2")))?;
        let headers = size(u32_at(header, 4)).saturating_mul(SECTION_HEADER);
        let headers = take(name, "the headers of sections", bytes, &mut rest, headers)?;
        let or = |value: f32, default: f32| if value == 0.0 { default } else { value };
        let sh_bounds = [or(f32_at(header, 36), -DEFAULT_SH), or(f32_at(header, 40), DEFAULT_SH)];
        let mut sections = Vec::new();
        let mut gaussians = 0_usize;
        for (s, header) in headers.as_chunks::<SECTION_HEADER>().0.iter().enumerate() {
            let section = section(name, s, level, header, bytes, &mut rest, gaussians)?;
            gaussians = gaussians.saturating_add(section.len);
            if section.len > 0 {
                sections.push(section);
            }
        }
        let claimed = u32_at(header, 16);
        if size(claimed) != gaussians || gaussians == 0 {
            return Err(bad(format!("the header counts {claimed} Gaussians, its sections {gaussians}")));
        }
        let degree = sections.iter().map(|section| section.degree).max().unwrap_or(ShDegree::ZERO);
        let version = format!("{major}.{minor}");
        Ok(Self { version, level, gaussians, degree, sh_bounds, sections })
    }
}

/// Reads section `s`. Its data are at the start of `rest`. `first` is the number of its first Gaussian.
fn section<'a>(
    name: &str,
    s: usize,
    level: Level,
    header: &[u8; SECTION_HEADER],
    bytes: &'a [u8],
    rest: &mut &'a [u8],
    first: usize,
) -> Result<Section<'a>> {
    let bad = |text: String| Error::malformed(name, format!("section {s}: {text}"));
    let [len, most, capacity, buckets] = [0, 4, 8, 12].map(|at| size(u32_at(header, at)));
    let [full, partial] = [32, 36].map(|at| size(u32_at(header, at)));
    let bucket_bytes = usize::from(u16_at(header, 20));
    let degree = u16_at(header, 40);
    let degree = u8::try_from(degree)
        .ok()
        .filter(|_| degree <= MAX_DEGREE)
        .and_then(|degree| ShDegree::new(degree).ok())
        .ok_or_else(|| bad(format!("SH degree {degree} is above {MAX_DEGREE}")))?;
    if len > most {
        return Err(bad(format!("it holds {len} Gaussians and has room for {most}")));
    }
    let has_centres = len > 0 && level != Level::Whole;
    if has_centres && bucket_bytes != CENTRE {
        return Err(bad(format!("buckets take {bucket_bytes} bytes instead of {CENTRE}")));
    }
    let what = |part: &str| format!("{part} of section {s}");
    let sizes = take(name, &what("sizes of buckets"), bytes, rest, partial.saturating_mul(4))?;
    let centres = take(name, &what("centres"), bytes, rest, buckets.saturating_mul(bucket_bytes))?;
    let row_bytes = level.row_bytes(degree);
    let rows = take(name, &what("the Gaussians"), bytes, rest, most.saturating_mul(row_bytes))?;
    let block = f32_at(header, 16);
    let range = match u32_at(header, 24) {
        0 => DEFAULT_RANGE,
        range => range,
    };
    let mut section = Section {
        first,
        len,
        degree,
        row_bytes,
        rows,
        block,
        range,
        centres: &[],
        capacity,
        full,
        ends: Vec::new(),
    };
    if !has_centres {
        return Ok(section);
    }
    section.centres = centres.as_chunks().0;
    if full.saturating_add(partial) > buckets {
        return Err(bad(format!(
            "{full} full buckets and {partial} others are more than the {buckets} in all"
        )));
    }
    let mut end = full.saturating_mul(capacity);
    for size_of in sizes.as_chunks().0 {
        end = end.saturating_add(size(u32::from_le_bytes(*size_of)));
        section.ends.push(end);
    }
    if end < len {
        return Err(bad(format!("its buckets hold {end} of {len} Gaussians")));
    }
    Ok(section)
}

/// Cuts `len` bytes off the start of `rest`, which is the end of the file `bytes`.
fn take<'a>(name: &str, what: &str, bytes: &[u8], rest: &mut &'a [u8], len: usize) -> Result<&'a [u8]> {
    let Some((taken, after)) = rest.split_at_checked(len) else {
        let start = (bytes.len() - rest.len()) as u64;
        let problem = FormatError::Truncated {
            what: what.to_owned(),
            expected: start.saturating_add(len as u64),
            found: bytes.len() as u64,
        };
        return Err(Error::format(name, problem));
    };
    *rest = after;
    Ok(taken)
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

/// Converts a number. It saturates if a number of the file does not fit into memory anyway.
fn size(number: u32) -> usize {
    usize::try_from(number).unwrap_or(usize::MAX)
}
