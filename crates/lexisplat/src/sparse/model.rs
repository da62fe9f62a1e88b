//! Compressed scenes.

use crate::scene::offset::{Offset, shift};
use crate::scene::sh::ShDegree;
use crate::scene::splats::{Geometry, SceneMeta, Splats};
use crate::sparse::codes::SparseCodes;
use crate::sparse::dictionary::Dictionary;
use crate::support::error::{Error, Result};
use crate::support::parallel::{GAUSSIANS_PER_TASK, for_each_chunk_mut};

/// A scene whose SH-rest is a dictionary and sparse codes. All of its arrays fit one another.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    geometry: Geometry,
    meta: SceneMeta,
    dictionary: Dictionary,
    codes: SparseCodes,
    record: Record,
}

/// The greedy pursuit that chose the atoms of codes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Pursuit {
    /// Orthogonal matching pursuit: takes the atom most correlated with the residual (the paper's).
    Omp,
    /// Orthogonal least squares: takes the atom that lowers the residual most.
    Ols,
}

/// The parameters with which a [`Model`] was made, and its errors.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Record {
    /// Un-squared L2 norm that no SH-rest error exceeds. `None` if only `max_nonzeros` ended the pursuit.
    pub tolerance: Option<f64>,
    /// Largest number of nonzeros of a Gaussian. With it, `tolerance` is no promise.
    pub max_nonzeros: Option<u8>,
    /// The pursuit; `None` for packed scenes, whose atoms are chosen by the bits they cost.
    pub pursuit: Option<Pursuit>,
    /// Seed of the learning sample.
    pub seed: u64,
    /// Largest error over all Gaussians, computed in f64 from the values that `decompress` writes.
    pub max_residual: f64,
    /// Root of the mean squared error over all Gaussians.
    pub rms_residual: f64,
    /// Number of Gaussians whose error is over `tolerance`; 0 unless `max_nonzeros` is set.
    pub over_tolerance: u64,
}

/// Number of digits after the first one of errors in packed files. Half a unit of the last digit, as a share of a number
/// with the first digit 1.
const ERROR_DIGITS: usize = 4;
const HALF_STEP: f64 = 0.5e-4;

impl Record {
    /// Rounds the errors to few digits. The largest error is not below the exact one. It is within the tolerance if the
    /// exact one is.
    pub(crate) fn shortened(self) -> Self {
        let near = |x: f64| format!("{x:.ERROR_DIGITS$e}").parse().unwrap_or(x);
        let exact = self.max_residual;
        let mut most = near(exact);
        if most < exact {
            // The next larger number with as many digits.
            most = near(exact * (1.0 + HALF_STEP));
        }
        if most < exact {
            most = exact;
        }
        if let Some(tolerance) = self.tolerance.filter(|&tolerance| exact <= tolerance) {
            most = most.min(tolerance);
        }
        Self { max_residual: most, rms_residual: near(self.rms_residual), ..self }
    }
}

macro_rules! named {
    ($type:ident, $what:literal, $($variant:ident => $name:literal),+) => {
        impl $type {
            /// Returns the name of the value on the command line and in files.
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
                    _ => {
                        let names = format!("one of {}", [$($name),+].join(", "));
                        Err(crate::support::error::Error::parameter($what, text, names))
                    }
                }
            }
        }
    };
}
pub(crate) use named;

named!(Pursuit, "pursuit", Omp => "omp", Ols => "ols");

impl Model {
    /// Creates a model from its fields.
    ///
    /// # Errors
    /// [`Error::Parameter`] if the arrays of `geometry` differ in length, if there is not one column of codes for
    /// each Gaussian, or if the codes were not made for a dictionary of this size.
    pub fn new(
        geometry: Geometry,
        meta: SceneMeta,
        dictionary: Dictionary,
        codes: SparseCodes,
        record: Record,
    ) -> Result<Self> {
        geometry.validate()?;
        if codes.len() != geometry.len() {
            let expected = format!("{} columns, one a Gaussian", geometry.len());
            return Err(Error::parameter("codes", codes.len(), expected));
        }
        if !codes.fit(&dictionary) {
            let expected = "a dictionary as large as that of the codes";
            return Err(Error::parameter("dictionary", format!("{} atoms", dictionary.len()), expected));
        }
        Ok(Self { geometry, meta, dictionary, codes, record })
    }

    /// Returns everything but SH-rest. It is exactly that of the source in models that a reader of the exact layouts or
    /// [`compress()`](crate::compress()) made.
    #[must_use]
    pub fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// Returns the comments and marks of the source.
    #[must_use]
    pub fn meta(&self) -> &SceneMeta {
        &self.meta
    }

    /// Makes positions relative to `offset`, as [`Splats::rebase`] does.
    pub fn rebase(&mut self, offset: Option<Offset>) {
        shift(&mut self.geometry.positions, self.meta.offset, offset);
        self.meta.view = self.meta.view.take().filter(|_| self.meta.offset == offset);
        self.meta.offset = offset;
    }

    /// Returns the dictionary.
    #[must_use]
    pub fn dictionary(&self) -> &Dictionary {
        &self.dictionary
    }

    /// Returns the codes, one column a Gaussian.
    #[must_use]
    pub fn codes(&self) -> &SparseCodes {
        &self.codes
    }

    /// Returns the parameters with which the model was made, and its errors.
    #[must_use]
    pub fn record(&self) -> &Record {
        &self.record
    }

    /// Replaces the first view; see [`SceneMeta::view`].
    #[must_use]
    pub fn with_view(mut self, view: Option<String>) -> Self {
        self.meta.view = view;
        self
    }

    /// Returns the fields that [`Self::new`] takes, in its order.
    #[must_use]
    pub fn into_parts(self) -> (Geometry, SceneMeta, Dictionary, SparseCodes, Record) {
        (self.geometry, self.meta, self.dictionary, self.codes, self.record)
    }

    /// Returns the number of Gaussians.
    #[must_use]
    pub fn len(&self) -> usize {
        self.geometry.len()
    }

    /// Returns whether there are no Gaussians.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.geometry.is_empty()
    }

    /// Returns the SH degree.
    #[must_use]
    pub fn degree(&self) -> ShDegree {
        self.dictionary.degree()
    }

    /// Returns the number of bytes that all SH take in memory while drawing: codes, base colours and dictionary. A dense
    /// scene of degree 3 takes 192 bytes a Gaussian.
    #[must_use]
    pub fn resident_sh_bytes(&self) -> usize {
        let dictionary = self.dictionary.len() * self.dictionary.dim() * size_of::<f32>();
        self.codes.resident_bytes() + size_of_val(self.geometry.dc.as_slice()) + dictionary
    }

    /// Returns the dense SH-rest of every Gaussian, channel-major: the values that `decompress` writes.
    #[must_use]
    pub fn dense_rest(&self) -> Vec<f32> {
        let dim = self.dictionary.dim();
        let mut rest = vec![0.0; self.len() * dim];
        if dim > 0 {
            for_each_chunk_mut(&mut rest, dim * GAUSSIANS_PER_TASK, |chunk, rows| {
                for (i, row) in (chunk * GAUSSIANS_PER_TASK..).zip(rows.chunks_exact_mut(dim)) {
                    self.codes.reconstruct(&self.dictionary, i, row);
                }
            });
        }
        rest
    }

    /// Returns the dense scene.
    #[must_use]
    pub fn into_splats(self) -> Splats {
        let sh_rest = self.dense_rest();
        Splats { degree: self.degree(), geometry: self.geometry, sh_rest, meta: self.meta }
    }
}

#[cfg(test)]
mod error_tests {
    use super::*;

    #[test]
    fn errors_of_few_digits_keep_promises() {
        let short = |max_residual: f64, tolerance| {
            let record = Record { max_residual, rms_residual: max_residual, tolerance, ..Record::default() };
            record.shortened()
        };
        for exact in [0.0, 1.0, 0.123_451, 0.123_449_9, 1.0 / 3.0, 99_999.9, 1.5e-17, 0.999_999] {
            let most = short(exact, None).max_residual;
            assert!(exact <= most && most <= exact * 1.0002, "{exact} {most}");
            assert!((short(exact, None).rms_residual - exact).abs() <= exact * 1e-4);
            assert_eq!(short(exact, Some(exact)).max_residual, exact);
        }
        assert_eq!(short(0.123_451, None).max_residual.to_string(), "0.12346");
        assert_eq!(short(0.2, Some(0.1)).max_residual, 0.2);
    }
}
