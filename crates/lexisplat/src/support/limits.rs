//! Limits on files, which are checked before anything is allocated.

use crate::scene::sh::MAX_REST;
use crate::support::builder::builder_methods;
use crate::support::error::{Error, Result};

/// Largest number of atoms of a dictionary. Indices fit in 10 bits, and the Gram matrix in 4 MiB.
pub const MAX_ATOMS: usize = 1024;
/// Largest number of Gaussians of a scene. Gaussians are numbered by u32, and their count is stored as u32 too.
pub(crate) const MAX_GAUSSIANS: u64 = u32::MAX as u64 - 1;
/// Most bytes of arrays for each byte of a file. A valid file without extra properties has at most 172: a byte of a packed
/// file stands for at most 3 Gaussians of 57 bytes each, and an offset is stored for every 64 Gaussians. An extra property
/// of equal values takes next to no bytes in a packed file. It adds up to 24 if the Gaussians take the fewest bits.
const EXPANSION: u64 = 256;
/// Most bytes of a header. The header of a packed scene of 2^32 Gaussians takes some kilobytes.
const HEADER_BYTES: u64 = 4 << 20;
/// Most properties of an element. INRIA's layout of SH degree 4 has 89.
const PROPERTIES: u64 = 4096;

/// Limits on a file.
///
/// A reader allocates at most a constant times the file's own size, because it first compares the counts of the header
/// with the bytes present. The constant is small except for packed files, where a byte may stand for 3 Gaussians of some
/// hundred bytes. These limits hold in addition. By default every valid file is within them. For files of unknown origin,
/// lower [`Self::gaussians`] or [`Self::bytes`]:
///
/// ```
/// use lexisplat::{Error, Limits, lexi};
///
/// let small = Limits::default().with_gaussians(1000).with_bytes(64 << 20);
/// # let splats = lexisplat_sample::scene(&lexisplat_sample::SampleOptions::new(2000, 0));
/// # let (model, _) = lexisplat::compress(splats, &Default::default(), &lexisplat::Silent)?;
/// # let mut file = Vec::new();
/// # lexi::write(&mut file, &model)?;
/// let refused = lexi::read_bytes("scene.lexi", &file, &small); // a scene of 2000
/// assert!(matches!(refused, Err(Error::Limit { found: 2000, limit: 1000, .. })));
/// # Ok::<(), Error>(())
/// ```
///
/// A reader refuses a file that exceeds a limit with an [`Error::Limit`] that names the file and the limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Limits {
    /// Most Gaussians in a scene. Default `u32::MAX - 1`, since indices are stored as u32. Raising it further has no
    /// effect.
    pub gaussians: u64,
    /// Most atoms in a dictionary. Default [`MAX_ATOMS`]. Raising it further has no effect.
    pub atoms: u64,
    /// Most nonzeros of one Gaussian. Default 72, the dimension at SH degree 4. Raising it further has no effect.
    pub nonzeros: u64,
    /// Most bytes in memory at once of the arrays made from one file: geometry, SH or codes, extra properties, and
    /// the parts of a packed file that are kept. The dictionary is not counted, since `atoms` bounds it. A reader of
    /// whole scenes holds the whole scene. A reader of parts ([`ply::PlySource`](crate::formats::ply::PlySource),
    /// [`lexi::LexiReader`](crate::formats::lexi::LexiReader)) holds one part. A reader's own working memory may be
    /// twice as much again. This is also the most bytes of a file that has to be held because it cannot be mapped,
    /// such as a pipe. Default `u64::MAX`, no limit.
    pub bytes: u64,
    /// Most bytes of these arrays for each byte of the file. Default 256; a valid file has at most
    /// 172, and in packed files up to 24 more for each extra property.
    pub expansion: u64,
    /// Most bytes of a text header (PLY) or JSON header (.lexi). Default 4 MiB.
    pub header_bytes: u64,
    /// Most properties of one PLY element. Default 4096.
    pub properties: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            gaussians: MAX_GAUSSIANS,
            atoms: MAX_ATOMS as u64,
            nonzeros: MAX_REST as u64,
            bytes: u64::MAX,
            expansion: EXPANSION,
            header_bytes: HEADER_BYTES,
            properties: PROPERTIES,
        }
    }
}

impl Limits {
    /// The names of all limits. [`Self::with`] takes them, and [`Error::Limit`] states one.
    pub const NAMES: [&'static str; 7] =
        ["gaussians", "atoms", "nonzeros", "bytes", "expansion", "header_bytes", "properties"];

    builder_methods!(
        with_gaussians(gaussians: u64),
        with_atoms(atoms: u64),
        with_nonzeros(nonzeros: u64),
        with_bytes(bytes: u64),
        with_expansion(expansion: u64),
        with_header_bytes(header_bytes: u64),
        with_properties(properties: u64),
    );

    /// Sets the limit called `name`, one of [`Self::NAMES`].
    ///
    /// # Errors
    /// [`Error::Parameter`] for any other name.
    pub fn with(self, name: &str, value: u64) -> Result<Self> {
        Ok(match name {
            "gaussians" => self.with_gaussians(value),
            "atoms" => self.with_atoms(value),
            "nonzeros" => self.with_nonzeros(value),
            "bytes" => self.with_bytes(value),
            "expansion" => self.with_expansion(value),
            "header_bytes" => self.with_header_bytes(value),
            "properties" => self.with_properties(value),
            _ => return Err(Error::parameter("limit", name, format!("one of {}", Self::NAMES.join(", ")))),
        })
    }

    /// Refuses `found` of `what` if they are over `limit`, which cannot be raised.
    pub(crate) fn check(what: &str, found: u64, limit: u64) -> Result<()> {
        if found <= limit { Ok(()) } else { Err(Error::limit(what, found, limit, None)) }
    }

    /// Refuses a file with too many Gaussians. No file may have `u32::MAX` or more. It is for readers of further formats.
    ///
    /// # Errors
    /// [`Error::Limit`].
    pub fn check_gaussians(&self, file: &str, found: u64) -> Result<()> {
        Self::check(&format!("Gaussians in {file}"), found, MAX_GAUSSIANS)?;
        raisable("Gaussians in", file, found, self.gaussians, "gaussians")
    }

    /// Refuses a file with too many atoms. More than [`MAX_ATOMS`] pass, because the file is then damaged, and its
    /// reader has an error for that.
    pub(crate) fn check_atoms(&self, file: &str, found: u64) -> Result<()> {
        let found = if found > MAX_ATOMS as u64 { 0 } else { found };
        raisable("atoms in the dictionary of", file, found, self.atoms, "atoms")
    }

    /// Refuses a file whose Gaussian number `gaussian` has too many nonzeros. More than any dimension pass, because the
    /// file is then damaged, and its reader has an error for that.
    pub(crate) fn check_nonzeros(&self, file: &str, gaussian: usize, found: u64) -> Result<()> {
        let found = if found > MAX_REST as u64 { 0 } else { found };
        let what = format!("nonzeros of Gaussian {gaussian} in");
        raisable(&what, file, found, self.nonzeros, "nonzeros")
    }

    /// Refuses a file with too many bytes that must be in memory.
    pub(crate) fn check_file(&self, file: &str, found: u64) -> Result<()> {
        raisable("bytes of", file, found, self.bytes, "bytes")
    }

    /// Refuses a file whose header has too many bytes. It is for readers of further formats.
    ///
    /// # Errors
    /// [`Error::Limit`].
    pub fn check_header(&self, file: &str, found: u64) -> Result<()> {
        raisable("bytes in the header of", file, found, self.header_bytes, "header_bytes")
    }

    /// Refuses a file with too many properties in an element.
    pub(crate) fn check_properties(&self, file: &str, found: u64) -> Result<()> {
        raisable("properties of an element of", file, found, self.properties, "properties")
    }
}

/// Refuses `found` of `what` in `file` if they are over the `limit` called `name`.
fn raisable(what: &str, file: &str, found: u64, limit: u64, name: &'static str) -> Result<()> {
    if found <= limit {
        Ok(())
    } else {
        Err(Error::limit(format!("{what} {file}"), found, limit, Some(name)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_sets_its_own_limit() {
        let fields = |l: Limits| {
            [l.gaussians, l.atoms, l.nonzeros, l.bytes, l.expansion, l.header_bytes, l.properties]
        };
        let before = fields(Limits::default());
        for (k, name) in Limits::NAMES.into_iter().enumerate() {
            let mut expected = before;
            expected[k] = 77;
            assert_eq!(fields(Limits::default().with(name, 77).unwrap()), expected, "{name}");
        }
        let error = Limits::default().with("gaussian", 1).unwrap_err().to_string();
        assert!(error.contains("limit = gaussian") && error.contains("header_bytes"), "{error}");
    }

    #[test]
    fn errors_name_the_limit_that_can_be_raised() {
        let limits = Limits::default().with_gaussians(5);
        assert!(limits.check_gaussians("a.ply", 5).is_ok());
        let error = limits.check_gaussians("a.ply", 6).unwrap_err();
        assert_eq!(error.to_string(), "Gaussians in a.ply: 6 is over the limit of 5");
        assert!(matches!(error, Error::Limit { name: Some("gaussians"), .. }), "{error:?}");
        let error = Limits::check("pies", 6, 5).unwrap_err();
        assert_eq!(error.to_string(), "pies: 6 is over the limit of 5");
        assert!(matches!(error, Error::Limit { name: None, .. }), "{error:?}");
    }
}
