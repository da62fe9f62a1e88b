//! Names and numbers of the file format, each defined once.

/// Version of files in the layouts `f32`, `f16` and `paper`.
pub const VERSION: u64 = 1;
/// Version of files in the layout `packed`.
pub const PACKED_VERSION: u64 = 3;
/// Newest version of the format that can be read.
pub const MAX_VERSION: u64 = 3;

/// Divisor of the starts of header and data in bytes, as in the safetensors format.
pub(super) const HEADER_ALIGNMENT: usize = 8;
/// Number of bytes of the length that precedes the JSON header.
pub(super) const LENGTH_BYTES: usize = 8;

/// Value of [`key::FORMAT`] in a scene.
pub(super) const FORMAT: &str = "lexi";
/// Value of [`key::FORMAT`] in a file that holds only a dictionary.
pub(super) const DICTIONARY_FORMAT: &str = "lexi-dictionary";

/// Prefix of tensors that hold per-Gaussian properties that 3DGS does not define.
pub(super) const EXTRA_PREFIX: &str = "extra.";
/// Prefix of tensors that a reader may ignore.
pub(super) const IGNORED_PREFIX: &str = "x-";

/// Names and widths of the tensors of geometry, in the order of [`Geometry::floats`](crate::Geometry::floats). A file may
/// lack the last tensor, the normals.
pub(super) const GEOMETRY: [(&str, usize); 6] = [
    (tensor::POSITION, 3),
    (tensor::DC, 3),
    (tensor::OPACITY, 1),
    (tensor::SCALE, 3),
    (tensor::ROTATION, 4),
    (tensor::NORMAL, 3),
];

/// Names of the tensors of a packed file, in the order in which sizes are listed.
pub(super) const PACKED: [&str; 3] = [tensor::HEAD, tensor::DATA, tensor::ORDER];

/// Returns the shape of a tensor of the geometry of `n` Gaussians, with `width` values for each Gaussian.
pub(super) fn geometry_shape(n: usize, width: usize) -> Vec<usize> {
    if width == 1 { vec![n] } else { vec![n, width] }
}

/// Names of tensors.
pub(super) mod tensor {
    pub(crate) const POSITION: &str = "position";
    pub(crate) const NORMAL: &str = "normal";
    pub(crate) const DC: &str = "dc";
    pub(crate) const OPACITY: &str = "opacity";
    pub(crate) const SCALE: &str = "scale";
    pub(crate) const ROTATION: &str = "rotation";
    pub(crate) const DICTIONARY: &str = "dictionary";
    pub(crate) const COUNTS: &str = "codes.counts";
    pub(crate) const POINTERS: &str = "codes.pointers";
    pub(crate) const INDICES: &str = "codes.indices";
    pub(crate) const VALUES: &str = "codes.values";
    pub(crate) const ESCAPED: &str = "escapes.gaussians";
    pub(crate) const ESCAPE_ROWS: &str = "escapes.rows";
    pub(crate) const HEAD: &str = "packed.head";
    pub(crate) const DATA: &str = "packed.data";
    pub(crate) const ORDER: &str = "packed.order";
    pub(crate) const HEADER_CHECKSUM: &str = "checksum.header";
}

/// Keys of the metadata.
pub(super) mod key {
    pub(crate) const FORMAT: &str = "format";
    pub(crate) const VERSION: &str = "version";
    pub(crate) const GENERATOR: &str = "generator";
    pub(crate) const DEGREE: &str = "degree";
    pub(crate) const LAYOUT: &str = "layout";
    pub(crate) const PURSUIT: &str = "pursuit";
    pub(crate) const TOLERANCE: &str = "tolerance";
    pub(crate) const MAX_NONZEROS: &str = "max_nonzeros";
    pub(crate) const SEED: &str = "seed";
    pub(crate) const MAX_RESIDUAL: &str = "max_residual";
    pub(crate) const RMS_RESIDUAL: &str = "rms_residual";
    pub(crate) const OVER_TOLERANCE: &str = "over_tolerance";
    pub(crate) const ANTIALIASED: &str = "antialiased";
    pub(crate) const COMMENTS: &str = "comments";
    pub(crate) const OFFSET: &str = "offset";
    pub(crate) const VIEW: &str = "view";
    pub(crate) const GAUSSIANS: &str = "gaussians";
    pub(crate) const REMOVED: &str = "removed";
    pub(crate) const TARGET: &str = "target";
    pub(crate) const REACHED: &str = "reached";
    pub(crate) const DEVICE: &str = "device";
    pub(crate) const CHECKSUMS: &str = "checksums";
}
