//! The properties that all parts of a scene share.

use lexisplat::{Dictionary, ShDegree};

use crate::error::{Error, Result};
use crate::scene::Scene;

use super::constants::vectors;
use super::part::{word, words};
use super::part_layout::{ShKind, ShLayout};
use super::sh_data::{ShData, exact_row};
use crate::sh_path::ShPath;

/// First word of a form's bytes: `LXFM`.
const MAGIC: u32 = u32::from_le_bytes(*b"LXFM");
/// Second word of a form's bytes. A program reads only the version that it writes.
const VERSION: u32 = 1;
/// Number of words before the atoms.
const HEADER_WORDS: usize = 8;

/// The properties that all parts of a scene share: the SH degree, the rules of drawing, the layout of SH, and the
/// dictionary of sparse codes. It is made without a GPU.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneForm {
    pub(super) layout: ShLayout,
    pub(super) antialiased: bool,
    /// The dictionary. It is empty if rows are dense.
    pub(super) dictionary: Dictionary,
}

impl SceneForm {
    /// Returns the form of `scene` and of every part of it, for the path [`ShPath::of`] the scene.
    #[must_use]
    pub fn of(scene: &Scene<'_>) -> Self {
        let data = match scene {
            Scene::Dense(_) => ShData::Dense { scene, half: false },
            Scene::Sparse(model) => ShData::Codes(model),
        };
        Self::of_data(&data, scene)
    }

    /// Returns the form of `scene` with its SH as `data`.
    pub(super) fn of_data(data: &ShData<'_>, scene: &Scene<'_>) -> Self {
        let dictionary = match data {
            ShData::Dense { .. } => Dictionary::empty(),
            ShData::Codes(model) => model.dictionary().clone(),
        };
        Self { layout: data.layout(), antialiased: scene.meta().antialiased, dictionary }
    }

    /// Returns the path by which a scene of this form is drawn.
    pub(super) fn path(&self) -> ShPath {
        match self.layout.kind {
            ShKind::Dense { half: false } => ShPath::DenseF32,
            ShKind::Dense { half: true } => ShPath::DenseF16,
            ShKind::Codes { .. } => ShPath::SparseOrdered,
        }
    }

    /// Returns the SH degree.
    pub(crate) fn degree(&self) -> ShDegree {
        self.layout.degree
    }

    /// Returns whether the rules for anti-aliasing apply.
    pub(crate) fn antialiased(&self) -> bool {
        self.antialiased
    }

    /// Returns the dictionary. It is empty if rows are dense.
    pub(crate) fn dictionary(&self) -> &Dictionary {
        &self.dictionary
    }

    /// Returns the form as bytes, for [`Self::from_bytes`] of the same version of this crate.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let [kind, degree, index, value, atoms] = self.layout.to_words();
        let header: [u32; HEADER_WORDS] =
            [MAGIC, VERSION, self.antialiased.into(), kind, degree, index, value, atoms];
        let atoms = self.dictionary.as_slice().iter().map(|v| v.to_bits());
        header.into_iter().chain(atoms).flat_map(u32::to_le_bytes).collect()
    }

    /// Reads the bytes of [`Self::to_bytes`].
    ///
    /// # Errors
    /// [`Error::Codec`] for any other bytes.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let refused = |problem: String| Error::format("form of a scene", problem);
        let Some((header, rest)) = bytes.split_first_chunk::<{ 4 * HEADER_WORDS }>() else {
            return Err(refused(format!("{} bytes, without a header", bytes.len())));
        };
        let [magic, version, antialiased, kind, degree, index, value, atoms]: [u32; HEADER_WORDS] =
            std::array::from_fn(|k| word(&header[4 * k..]).unwrap_or(u32::MAX));
        if magic != MAGIC || version != VERSION || antialiased > 1 {
            return Err(refused(format!("magic {magic:#x}, version {version}, mark {antialiased}")));
        }
        let layout = ShLayout::from_words([kind, degree, index, value, atoms]).map_err(refused)?;
        let dictionary = match layout.kind {
            ShKind::Dense { .. } => Dictionary::empty(),
            ShKind::Codes { .. } => {
                Dictionary::new(layout.degree, words(rest).map(f32::from_bits).collect())?
            }
        };
        if rest.len() != size_of_val(dictionary.as_slice()) || dictionary.len() != atoms as usize {
            return Err(refused(format!("{atoms} atoms in {} bytes", rest.len())));
        }
        Ok(Self { layout, antialiased: antialiased == 1, dictionary })
    }

    /// Returns the atoms in the layout that kernels read. Each atom is padded to whole vectors.
    pub(super) fn atoms(&self) -> Vec<u32> {
        let (dim, row) = (self.dictionary.dim(), 4 * vectors(self.layout.degree.rest_per_channel()));
        let mut out = vec![0; self.dictionary.len() * row];
        if dim > 0 {
            for (atom, out) in self.dictionary.as_slice().chunks_exact(dim).zip(out.chunks_exact_mut(row)) {
                exact_row(atom, &mut out[..dim]);
            }
        }
        out
    }
}
