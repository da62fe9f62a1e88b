//! Packed scenes.

use serde::{Deserialize, Serialize};

use crate::scene::extra::Extra;
use crate::scene::sh::ShDegree;
use crate::scene::splats::SceneMeta;
use crate::sparse::model::Record;
use crate::support::limits::Limits;
use crate::support::spill::{Spilled, Woven};

/// What errors call a packed scene that was not read from a file.
pub(super) const UNNAMED: &str = "the packed scene";

/// Everything of a packed scene that is not as long as the scene.
#[derive(Debug, Clone)]
pub struct PackedHead {
    /// The file, as the caller named it.
    pub(crate) file: String,
    /// SH degree.
    pub degree: ShDegree,
    /// Number of Gaussians.
    pub gaussians: usize,
    /// Number of Gaussians of the source that were left out.
    pub removed: u64,
    /// Number of atoms; 0 for degree 0.
    pub atoms: usize,
    /// How it was made and what it promises.
    pub record: Record,
    /// Comments and marks of the source.
    pub meta: SceneMeta,
    /// What a search for a quality or a size asked for and reached, if there was one.
    pub target: Option<TargetRecord>,
    /// What views showed of the file, if views judged it.
    pub reached: Option<ReachedRecord>,
    /// The GPU that measured the sensitivity; `None` for the CPU renderer, whose results are the same
    /// everywhere.
    pub device: Option<String>,
    /// What it is decoded with, and where its chunks are, as a file holds it; see `bitstream/head.rs`.
    pub(crate) bytes: Vec<u8>,
    /// What may be made of it: the limits of the reader, or the default ones.
    pub(crate) limits: Limits,
}

impl PartialEq for PackedHead {
    /// Compares what is written to a file, and neither the name of the file nor the limits of its reader.
    fn eq(&self, other: &Self) -> bool {
        (self.degree, self.gaussians, self.removed, self.atoms)
            == (other.degree, other.gaussians, other.removed, other.atoms)
            && (&self.record, &self.meta, &self.target, &self.reached, &self.device)
                == (&other.record, &other.meta, &other.target, &other.reached, &other.device)
            && self.bytes == other.bytes
    }
}

/// A packed scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Packed {
    head: PackedHead,
    extras: Vec<Extra>,
    order: Option<Vec<u32>>,
    data: Vec<u8>,
}

impl Packed {
    /// `extras` are in the order of the file, and `order` holds the place of each Gaussian in the source.
    pub(crate) fn new(head: PackedHead, extras: Vec<Extra>, order: Option<Vec<u32>>, data: Vec<u8>) -> Self {
        Self { head, extras, order, data }
    }

    /// Everything that is not as long as the scene.
    #[must_use]
    pub fn head(&self) -> &PackedHead {
        &self.head
    }

    /// Number of Gaussians.
    #[must_use]
    pub fn len(&self) -> usize {
        self.head.gaussians
    }

    /// Whether there are no Gaussians.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.head.gaussians == 0
    }

    /// Properties that 3DGS does not define, in the order of the file.
    #[must_use]
    pub fn extras(&self) -> &[Extra] {
        &self.extras
    }

    /// For each Gaussian its place in the source, if the order was kept.
    #[must_use]
    pub fn order(&self) -> Option<&[u32]> {
        self.order.as_deref()
    }

    /// The entropy-coded dictionary and chunks.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        &self.data
    }

    /// The same with what a search asked for and reached.
    #[must_use]
    pub fn with_target(mut self, target: impl Into<Option<TargetRecord>>) -> Self {
        self.head.target = target.into();
        self
    }

    /// The same with what views showed of it.
    #[must_use]
    pub fn with_reached(mut self, reached: impl Into<Option<ReachedRecord>>) -> Self {
        self.head.reached = reached.into();
        self
    }

    /// The same with the number of Gaussians that were left out in all; see [`PackedHead::removed`].
    #[must_use]
    pub fn with_removed(mut self, removed: u64) -> Self {
        self.head.removed = removed;
        self
    }

    /// The same with the GPU that measured the sensitivity; see [`PackedHead::device`].
    #[must_use]
    pub fn with_device(mut self, device: Option<String>) -> Self {
        self.head.device = device;
        self
    }

    /// The same with other limits on what may be made of it.
    #[must_use]
    pub fn with_limits(mut self, limits: Limits) -> Self {
        self.head.limits = limits;
        self
    }
}

/// What of a packed scene is as long as the scene, spilled.
#[cfg(feature = "encode")]
#[derive(Debug)]
pub(crate) struct SpilledPacked {
    pub(crate) data: Woven,
    /// Of each layer the number of Gaussians, and the values.
    pub(crate) order: Option<Vec<(usize, Spilled)>>,
    /// Names and types, and the same of each.
    pub(crate) extras: Vec<(Extra, Vec<(usize, Spilled)>)>,
}

/// What a search for a quality or a size asked for and reached.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct TargetRecord {
    /// `psnr`, `min-psnr` or `size`.
    pub kind: String,
    /// Decibels or bytes asked for.
    pub asked: f64,
    /// Mean PSNR over the views searched with, in decibels.
    pub mean_psnr: f64,
    /// Least PSNR of a view, in decibels.
    pub min_psnr: f64,
    /// Number of views.
    pub views: u32,
    /// Whether the views were given. Otherwise they were generated.
    pub cameras: bool,
}

impl TargetRecord {
    /// Puts a record together. `reached` is the mean and the least PSNR.
    #[must_use]
    pub fn new(kind: &str, asked: f64, reached: [f64; 2], views: u32, cameras: bool) -> Self {
        let [mean_psnr, min_psnr] = reached;
        Self { kind: kind.to_owned(), asked, mean_psnr, min_psnr, views, cameras }
    }
}

/// What a packed file shows of its scene over the views that judged it.
///
/// Serialized, it is the member `reached` of reports.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ReachedRecord {
    /// PSNR that photographs are expected to show on average, in decibels.
    pub judged_psnr: f64,
    /// Mean PSNR of all views, in decibels.
    pub mean_psnr: f64,
    /// Least PSNR of a view, in decibels.
    pub min_psnr: f64,
    /// Number of views.
    pub views: u32,
    /// Whether the views were given. Otherwise they were found.
    pub cameras: bool,
}

impl ReachedRecord {
    /// Puts a record together. `psnr` is the judged, the mean and the least one.
    #[must_use]
    pub fn new(psnr: [f64; 3], views: u32, cameras: bool) -> Self {
        let [judged_psnr, mean_psnr, min_psnr] = psnr;
        Self { judged_psnr, mean_psnr, min_psnr, views, cameras }
    }
}
