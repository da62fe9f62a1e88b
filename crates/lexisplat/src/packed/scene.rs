//! Packed scenes.

use serde::{Deserialize, Serialize};

use crate::scene::extra::Extra;
use crate::scene::sh::ShDegree;
use crate::scene::splats::SceneMeta;
use crate::sparse::model::Record;
use crate::support::limits::Limits;
use crate::support::spill::{Spilled, Woven};

/// The file name in errors about a packed scene that was not read from a file.
pub(super) const UNNAMED: &str = "the packed scene";

/// The head of a packed scene: everything whose size does not depend on the number of Gaussians.
#[derive(Debug, Clone)]
pub struct PackedHead {
    /// The file name, as the caller gave it. It is used in errors.
    pub(crate) file: String,
    /// SH degree.
    pub degree: ShDegree,
    /// Number of Gaussians.
    pub gaussians: usize,
    /// Number of Gaussians of the source that were left out.
    pub removed: u64,
    /// Number of atoms; 0 for degree 0.
    pub atoms: usize,
    /// How the file was made, and which error it promises.
    pub record: Record,
    /// Comments and marks of the source.
    pub meta: SceneMeta,
    /// The target of a search and its result. `None` without a search.
    pub target: Option<TargetRecord>,
    /// The quality of the file in the views that judged it. `None` if no view did.
    pub reached: Option<ReachedRecord>,
    /// The GPU that measured the sensitivity. `None` for the CPU renderer, whose results are the same everywhere.
    pub device: Option<String>,
    /// The tensor `packed.head`: the parameters of the decoder and the index of chunks; see `bitstream/head.rs`.
    pub(crate) bytes: Vec<u8>,
    /// The limits of the reader of the scene, or the default limits.
    pub(crate) limits: Limits,
}

impl PartialEq for PackedHead {
    /// Compares everything that is written to a file. The name of the file and the limits of its reader do not count.
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
    /// Creates a packed scene. `extras` are in the order of the file. `order` holds the index in the source of each
    /// Gaussian of the file.
    pub(crate) fn new(head: PackedHead, extras: Vec<Extra>, order: Option<Vec<u32>>, data: Vec<u8>) -> Self {
        Self { head, extras, order, data }
    }

    /// Returns the head.
    #[must_use]
    pub fn head(&self) -> &PackedHead {
        &self.head
    }

    /// Returns the number of Gaussians.
    #[must_use]
    pub fn len(&self) -> usize {
        self.head.gaussians
    }

    /// Returns whether there are no Gaussians.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.head.gaussians == 0
    }

    /// Returns the properties that 3DGS does not define, in the order of the file.
    #[must_use]
    pub fn extras(&self) -> &[Extra] {
        &self.extras
    }

    /// Returns the index in the source of each Gaussian of the file. `None` if the order was not kept.
    #[must_use]
    pub fn order(&self) -> Option<&[u32]> {
        self.order.as_deref()
    }

    /// Returns the entropy-coded ranges of all chunks.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        &self.data
    }

    /// Replaces the record of a search: its target and its result.
    #[must_use]
    pub fn with_target(mut self, target: impl Into<Option<TargetRecord>>) -> Self {
        self.head.target = target.into();
        self
    }

    /// Replaces the record of the quality in the views that judged the file.
    #[must_use]
    pub fn with_reached(mut self, reached: impl Into<Option<ReachedRecord>>) -> Self {
        self.head.reached = reached.into();
        self
    }

    /// Replaces the number of Gaussians that were left out in all; see [`PackedHead::removed`].
    #[must_use]
    pub fn with_removed(mut self, removed: u64) -> Self {
        self.head.removed = removed;
        self
    }

    /// Replaces the name of the GPU that measured the sensitivity; see [`PackedHead::device`].
    #[must_use]
    pub fn with_device(mut self, device: Option<String>) -> Self {
        self.head.device = device;
        self
    }

    /// Replaces the view from which viewers show the scene first; see [`SceneMeta::view`](crate::SceneMeta::view).
    #[must_use]
    pub fn with_view(mut self, view: Option<String>) -> Self {
        self.head.meta.view = view;
        self
    }

    /// Replaces the limits on the decoded scene.
    #[must_use]
    pub fn with_limits(mut self, limits: Limits) -> Self {
        self.head.limits = limits;
        self
    }
}

/// The ranges, the order and the extras of a packed scene, in spill files. Their size grows with the number of Gaussians.
#[cfg(feature = "encode")]
#[derive(Debug)]
pub(crate) struct SpilledPacked {
    pub(crate) data: Woven,
    /// For each layer, its number of Gaussians, and their indices in the source.
    pub(crate) order: Option<Vec<(usize, Spilled)>>,
    /// For each property that 3DGS does not define, its name and type, and for each layer the number of Gaussians and their
    /// values.
    pub(crate) extras: Vec<(Extra, Vec<(usize, Spilled)>)>,
}

/// The target of a search, a quality or a size, and its result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct TargetRecord {
    /// The kind of the search: `psnr`, `min-psnr` or `size`.
    pub kind: String,
    /// The target of the search: decibels for `psnr` and `min-psnr`, bytes for `size`.
    pub asked: f64,
    /// Mean PSNR over the views of the search, in decibels.
    pub mean_psnr: f64,
    /// Least PSNR of any of these views, in decibels.
    pub min_psnr: f64,
    /// Number of views.
    pub views: u32,
    /// Whether the caller gave the views. Otherwise they were generated.
    pub cameras: bool,
}

impl TargetRecord {
    /// Creates a record. `reached` is the mean PSNR and the least PSNR, in decibels.
    #[must_use]
    pub fn new(kind: &str, asked: f64, reached: [f64; 2], views: u32, cameras: bool) -> Self {
        let [mean_psnr, min_psnr] = reached;
        Self { kind: kind.to_owned(), asked, mean_psnr, min_psnr, views, cameras }
    }
}

/// The quality of a packed file in the views that judged it.
///
/// It is serialized as the member `reached` of reports.
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
    /// Whether the caller gave the views. Otherwise they were found.
    pub cameras: bool,
}

impl ReachedRecord {
    /// Creates a record. `psnr` is the judged, the mean and the least PSNR, in decibels.
    #[must_use]
    pub fn new(psnr: [f64; 3], views: u32, cameras: bool) -> Self {
        let [judged_psnr, mean_psnr, min_psnr] = psnr;
        Self { judged_psnr, mean_psnr, min_psnr, views, cameras }
    }
}
