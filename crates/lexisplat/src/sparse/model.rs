//! A compressed scene: what a .lexi file holds.

use crate::scene::sh::ShDegree;
use crate::scene::splats::{Geometry, SceneMeta, Splats};
use crate::sparse::codes::SparseCodes;
use crate::sparse::dictionary::Dictionary;

/// A scene whose SH-rest is a dictionary and sparse codes.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// Everything but SH-rest, exactly as in the source.
    pub geometry: Geometry,
    /// Comments and marks of the source.
    pub meta: SceneMeta,
    /// The atoms.
    pub dictionary: Dictionary,
    /// The codes, one column a Gaussian.
    pub codes: SparseCodes,
    /// How it was made and what it promises.
    pub record: Record,
}

/// How the codes of a [`Model`] are laid out on disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Layout {
    /// u8 counts, u8 or u16 indices, f32 values.
    F32,
    /// u8 counts, u8 or u16 indices, f16 values.
    F16,
    /// The paper's own count: i32 pointers, i32 indices, f32 values.
    Paper,
    /// Everything quantised and entropy-coded, geometry included ([`crate::packed`]).
    Packed,
}

/// Which greedy pursuit chose the atoms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Pursuit {
    /// Orthogonal matching pursuit: the atom most correlated with the residual (the paper's).
    Omp,
    /// Orthogonal least squares: the atom that lowers the residual most.
    Ols,
}

/// How a [`Model`] was made and what it promises. Written to the file as it stands here.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// Tolerance: un-squared L2 norm of the SH-rest error. `None` when only `max_nonzeros` stopped.
    pub tolerance: Option<f64>,
    /// Cap on nonzeros a Gaussian. With it the tolerance is no promise.
    pub max_nonzeros: Option<u8>,
    /// The pursuit.
    pub pursuit: Pursuit,
    /// Seed of the learning sample.
    pub seed: u64,
    /// Layout of the codes.
    pub layout: Layout,
    /// Largest error over all Gaussians, in f64 on the values `decompress` writes.
    pub max_residual: f64,
    /// Root of the mean squared error over all Gaussians.
    pub rms_residual: f64,
    /// Gaussians whose error is over `tolerance`; 0 unless `max_nonzeros` is set.
    pub over_tolerance: u64,
}

macro_rules! named {
    ($type:ident, $what:literal, $($variant:ident => $name:literal),+) => {
        impl $type {
            /// Its name on the command line and in files.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name),+ }
            }
        }
        impl std::fmt::Display for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(self.name())
            }
        }
        impl std::str::FromStr for $type {
            type Err = crate::support::error::Error;
            fn from_str(text: &str) -> Result<Self, Self::Err> {
                match text {
                    $($name => Ok(Self::$variant),)+
                    _ => Err(crate::support::error::Error::parameter($what, text, concat!("one of", $(" ", $name),+))),
                }
            }
        }
    };
}
named!(Layout, "layout", F32 => "f32", F16 => "f16", Paper => "paper", Packed => "packed");
named!(Pursuit, "pursuit", Omp => "omp", Ols => "ols");

impl Model {
    /// Number of Gaussians.
    #[must_use]
    pub fn len(&self) -> usize {
        self.geometry.len()
    }

    /// Whether there are no Gaussians.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.geometry.is_empty()
    }

    /// SH degree.
    #[must_use]
    pub fn degree(&self) -> ShDegree {
        self.dictionary.degree()
    }

    /// Bytes that all SH take in memory while drawing: codes, base colours, dictionary. A dense degree-3
    /// scene takes 192 a Gaussian.
    #[must_use]
    pub fn resident_sh_bytes(&self) -> usize {
        let dictionary = self.dictionary.len() * self.dictionary.dim() * size_of::<f32>();
        self.codes.resident_bytes() + size_of_val(self.geometry.dc.as_slice()) + dictionary
    }

    /// Dense SH-rest of every Gaussian, channel-major: the values `decompress` writes.
    #[must_use]
    pub fn dense_rest(&self) -> Vec<f32> {
        let dim = self.dictionary.dim();
        let mut rest = vec![0.0; self.len() * dim];
        if dim > 0 {
            crate::support::parallel::for_each_chunk_mut(
                &mut rest,
                dim * crate::support::parallel::GAUSSIANS_PER_TASK,
                |chunk, rows| {
                    for (k, row) in rows.chunks_exact_mut(dim).enumerate() {
                        self.codes.reconstruct(
                            &self.dictionary,
                            chunk * crate::support::parallel::GAUSSIANS_PER_TASK + k,
                            row,
                        );
                    }
                },
            );
        }
        rest
    }

    /// The dense scene, sharing nothing with `self`.
    #[must_use]
    pub fn to_splats(&self) -> Splats {
        Splats {
            geometry: self.geometry.clone(),
            degree: self.degree(),
            sh_rest: self.dense_rest(),
            meta: self.meta.clone(),
        }
    }

    /// The dense scene.
    #[must_use]
    pub fn into_splats(self) -> Splats {
        let sh_rest = self.dense_rest();
        Splats { degree: self.degree(), geometry: self.geometry, sh_rest, meta: self.meta }
    }
}
