//! Parts of scenes. They are made without a GPU, and passed from thread to thread as bytes.

use std::ops::Range;

use crate::error::{Error, Result};
use crate::parallel::*;
use crate::scene::Scene;

use super::columns::{Columns, escapes_in};
use super::part_layout::{HEADER_WORDS, Outline, Section, ShKind};
use super::sh_data::{ShData, body, dense_row, exact_row, shape};
use crate::sh_path::ShPath;

/// A run of consecutive Gaussians with their arrays in the layout that kernels read, in one piece of memory.
///
/// A worker makes a part from decoded Gaussians and passes on [`Self::as_bytes`]. The thread that draws borrows the bytes
/// with [`Self::from_bytes`], and uploads the part with [`GpuScene::put_async`](super::GpuScene::put_async). The bytes
/// are only valid for one version of this crate on one kind of machine. They must not be stored in files.
#[derive(Debug, Clone)]
pub struct ScenePart<'a> {
    words: Words<'a>,
    pub(super) outline: Outline,
    bounds: Option<[[f32; 3]; 2]>,
}

/// The memory of a part.
#[derive(Debug, Clone)]
enum Words<'a> {
    Own(Vec<u32>),
    /// Bytes at any address.
    Borrowed(&'a [u8]),
}

impl ScenePart<'static> {
    /// Lays out all of `scene` for the path [`ShPath::of`] the scene.
    ///
    /// # Errors
    /// [`Error::Codec`] if the lengths of the scene's arrays do not match; [`Error::GpuLimit`] for more than 2^32 - 2
    /// Gaussians or 2^32 - 1 words of codes, or for more than this machine can address.
    pub fn new(scene: &Scene<'_>) -> Result<Self> {
        scene.validate()?;
        let data = ShData::new(scene, ShPath::of(scene))?;
        Self::of(&data, scene, 0..scene.len(), 0)
    }

    /// Lays out the Gaussians in `range`, whose codes begin at nonzero `first`.
    pub(super) fn of(
        data: &ShData<'_>,
        scene: &Scene<'_>,
        range: Range<usize>,
        first: usize,
    ) -> Result<Self> {
        let limit = |what: &str, found: usize, limit: u32| {
            let number = u32::try_from(found).ok().filter(|&n| n <= limit);
            number.ok_or_else(|| Error::gpu_limit(what, found as u64, limit.into()))
        };
        let len = limit("Gaussians of a part of a scene", range.len(), u32::MAX - 1)?;
        let columns = match data {
            ShData::Dense { .. } => Columns::default(),
            ShData::Codes(model) => Columns::new(model.codes(), range.clone(), first),
        };
        let words = limit("words of nonzeros of a part of a scene", columns.nonzeros.len(), u32::MAX)?;
        let escapes = limit("escapes of a part of a scene", columns.escaped.len(), u32::MAX)?;
        let outline = Outline { layout: data.layout(), len, escapes, words };
        let bytes = outline.bytes();
        let size = usize::try_from(bytes).map_err(|_| Error::gpu_limit("bytes", bytes, usize::MAX as u64))?;
        let mut words = vec![0_u32; size / 4];
        words[..HEADER_WORDS].copy_from_slice(&outline.to_words());
        let geometry = scene.geometry();
        array(&mut words, &outline, Section::Bodies).par_chunks_mut(4).zip(range.clone()).for_each(
            |(out, i)| {
                out.copy_from_slice(&body(geometry, data.finite(i), i).map(f32::to_bits));
            },
        );
        array(&mut words, &outline, Section::Shapes).par_chunks_mut(8).zip(range.clone()).for_each(
            |(out, i)| {
                out.copy_from_slice(&shape(geometry, i).map(f32::to_bits));
            },
        );
        let colours = array(&mut words, &outline, Section::Colours);
        match data {
            ShData::Dense { scene, half } => {
                let row = usize::try_from(outline.layout.colour_bytes() / 4).unwrap_or(usize::MAX);
                let rows = colours.par_chunks_mut(row).zip(range);
                rows.for_each(|(out, i)| dense_row(scene, i, *half, out));
            }
            ShData::Codes(model) => {
                let dc: &[u32] = bytemuck::cast_slice(&geometry.dc[range.clone()]);
                colours.copy_from_slice(dc);
                array(&mut words, &outline, Section::Columns).copy_from_slice(&columns.columns);
                array(&mut words, &outline, Section::Escaped).copy_from_slice(&columns.escaped);
                array(&mut words, &outline, Section::Nonzeros).copy_from_slice(&columns.nonzeros);
                let dim = model.degree().rest();
                let escapes = escapes_in(model.codes(), &range);
                let rows = &model.codes().escapes().rows[escapes.start * dim..escapes.end * dim];
                let exact = array(&mut words, &outline, Section::Exact).chunks_exact_mut(dim.max(1));
                for (row, out) in rows.chunks_exact(dim.max(1)).zip(exact) {
                    exact_row(row, out);
                }
            }
        }
        let mut this = Self { words: Words::Own(words), outline, bounds: None };
        this.bounds = this.find_bounds().map_err(|problem| Error::parameter("scene", problem, "numbers"))?;
        Ok(this)
    }
}

impl<'a> ScenePart<'a> {
    /// Borrows a part from `bytes`, which must come from [`Self::as_bytes`], at any address. Nothing is copied.
    ///
    /// # Errors
    /// [`Error::Codec`] for bytes with which a kernel would read outside of its arrays, or from which no picture can be
    /// drawn: sizes that do not match the length of `bytes`, counts that do not match the nonzeros, numbers of atoms or
    /// escapes that are too large, and positions that are not finite.
    pub fn from_bytes(bytes: &'a [u8]) -> Result<Self> {
        let refused = |problem| Error::format("part of a scene", problem);
        Self::read(bytes).map_err(refused)
    }

    fn read(bytes: &'a [u8]) -> Result<Self, String> {
        let header = bytes.first_chunk::<{ 4 * HEADER_WORDS }>();
        let header = header.ok_or_else(|| format!("{} bytes, without a header", bytes.len()))?;
        let outline =
            Outline::from_words(std::array::from_fn(|k| word(&header[4 * k..]).unwrap_or(u32::MAX)))?;
        if outline.bytes() != bytes.len() as u64 {
            return Err(format!("{} bytes, expected {}", bytes.len(), outline.bytes()));
        }
        let mut this = Self { words: Words::Borrowed(bytes), outline, bounds: None };
        this.bounds = this.find_bounds()?;
        if let ShKind::Codes { .. } = outline.layout.kind {
            this.check_codes()?;
        }
        Ok(this)
    }

    /// Returns the whole part as bytes, for [`Self::from_bytes`]. Nothing is copied.
    #[must_use]
    pub fn as_bytes(&self) -> &[u8] {
        match &self.words {
            Words::Own(words) => bytemuck::cast_slice(words),
            Words::Borrowed(bytes) => bytes,
        }
    }

    /// Returns a copy of [`Self::as_bytes`].
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        self.as_bytes().to_vec()
    }

    /// Returns the number of Gaussians.
    #[must_use]
    pub fn len(&self) -> u32 {
        self.outline.len
    }

    /// Returns whether there are no Gaussians.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.outline.len == 0
    }

    /// Returns the corners of a box around all positions that can be drawn; `None` if there are none.
    #[must_use]
    pub fn bounds(&self) -> Option<[[f32; 3]; 2]> {
        self.bounds
    }

    /// Returns the bytes of an array.
    pub(super) fn section(&self, section: Section) -> &[u8] {
        self.as_bytes().get(self.outline.section(section)).unwrap_or_default()
    }

    /// Returns the corners of a box around all positions that can be drawn. The error tells what is wrong with a body.
    fn find_bounds(&self) -> Result<Option<[[f32; 3]; 2]>, String> {
        let mut bounds: Option<[[f32; 3]; 2]> = None;
        for (i, body) in self.section(Section::Bodies).chunks_exact(16).enumerate() {
            let [x, y, z, largest] =
                std::array::from_fn(|k| f32::from_bits(word(&body[4 * k..]).unwrap_or(u32::MAX)));
            // A Gaussian that is never drawn may lie anywhere.
            if largest.is_nan() || largest < 0.0 {
                continue;
            }
            let at = [x, y, z];
            if !(largest.is_finite() && at.iter().all(|v| v.is_finite())) {
                return Err(format!("Gaussian {i} lies at {at:?} with a deviation of {largest}"));
            }
            let [low, high] = bounds.get_or_insert([at, at]);
            for k in 0..3 {
                low[k] = low[k].min(at[k]);
                high[k] = high[k].max(at[k]);
            }
        }
        Ok(bounds)
    }
}

/// Returns the words of one array.
fn array<'w>(words: &'w mut [u32], outline: &Outline, section: Section) -> &'w mut [u32] {
    let bytes = outline.section(section);
    &mut words[bytes.start / 4..bytes.end / 4]
}

/// Returns the word at the start of `bytes`.
pub(super) fn word(bytes: &[u8]) -> Option<u32> {
    bytes.first_chunk().map(|bytes| u32::from_le_bytes(*bytes))
}

/// Returns the words in `bytes`.
pub(super) fn words(bytes: &[u8]) -> impl ExactSizeIterator<Item = u32> + DoubleEndedIterator + '_ {
    bytes.chunks_exact(4).map(|bytes| u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
}
