//! Options of writing, for all formats.

/// Options of writing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct WriteOptions {
    /// Version of SPZ: 2, 3 or 4. The default is 4.
    pub spz_version: u8,
    /// Number of bits of SPZ's SH coefficients of degree 1, and of the higher degrees, 1 to 8 each. The default is 5 and
    /// 4, as in SPZ's own library.
    pub sh_bits: [u8; 2],
    /// Largest number of entries of SOG's palette of SH, up to 65,536, which is the default; 0 leaves SH out. The palette
    /// also has no more entries than the largest power of two that does not exceed the number of Gaussians.
    pub sog_palette: u32,
    /// Whether the splats of a glb are an SPZ (`KHR_gaussian_splatting_compression_spz_2`, a draft) instead of floats.
    /// The default is false.
    pub glb_spz: bool,
}

impl Default for WriteOptions {
    fn default() -> Self {
        Self { spz_version: 4, sh_bits: [5, 4], sog_palette: 1 << 16, glb_spz: false }
    }
}
