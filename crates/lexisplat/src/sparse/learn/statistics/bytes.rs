//! Statistics as bytes, which machines send each other.

use super::{Statistics, triangle};
use crate::sparse::atoms::check_dim;
use crate::support::error::{Error, Result};
use crate::support::limits::MAX_ATOMS;

/// First bytes of the layout. The version follows them.
const MAGIC: [u8; 4] = *b"LXST";
/// Version of the layout.
const VERSION: u32 = 1;
/// Number of bytes of the magic, the version, the two sizes and the three scalars.
const HEAD: usize = 4 + 3 * 4 + 3 * 8;

impl Statistics {
    /// Returns the statistics as bytes. All numbers are little-endian. The parts are, in this order:
    ///
    /// - `LXST`;
    /// - as u32, the version (1), the length of an atom and the number of atoms;
    /// - as f64, the number of rows, the nonzeros and the squared error;
    /// - as f64, the lower triangle of the sum of `g g^T`, row by row, and the sum of `g x^T`, atom by atom.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(HEAD + size_of::<f64>() * (self.pairs.len() + self.products.len()));
        out.extend(MAGIC);
        #[expect(clippy::cast_possible_truncation, reason = "both sizes are at most 1024")]
        for number in [VERSION, self.dim as u32, self.atoms as u32] {
            out.extend(number.to_le_bytes());
        }
        let scalars = [self.rows, self.nonzeros, self.squared_error];
        for number in scalars.iter().chain(&self.pairs).chain(&self.products) {
            out.extend(number.to_le_bytes());
        }
        out
    }

    /// Reads statistics from the bytes of [`Self::to_bytes`]. Sizes are checked before anything is allocated.
    ///
    /// # Errors
    /// [`Error::Parameter`] if the bytes have another layout or version, if a size is out of range, or if the length does
    /// not fit the sizes. Also for numbers that no rows have: NaN, infinities, and negative counts, errors or energies.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let refused = |value: String, expected: &str| Err(Error::parameter("statistics", value, expected));
        let Some((head, rest)) = bytes.split_at_checked(HEAD) else {
            return refused(format!("{} bytes", bytes.len()), "at least a head of 40 bytes");
        };
        let Some(sizes) = head.strip_prefix(&MAGIC) else {
            return refused("other bytes".to_owned(), "bytes that begin with LXST");
        };
        let (sizes, scalars) = sizes.split_at(3 * size_of::<u32>());
        let mut sizes = sizes.as_chunks::<4>().0.iter().map(|&b| u32::from_le_bytes(b) as usize);
        let mut next = || sizes.next().unwrap_or_default();
        let (version, dim, atoms) = (next(), next(), next());
        if version != VERSION as usize {
            return refused(format!("version {version}"), "version 1; update lexisplat");
        }
        check_dim(dim)?;
        if !(1..=MAX_ATOMS).contains(&atoms) {
            return refused(format!("{atoms} atoms"), &format!("1 to {MAX_ATOMS} atoms"));
        }
        let expected = size_of::<f64>() * (triangle(atoms) + atoms * dim);
        if rest.len() != expected {
            let text = format!("{} bytes, {HEAD} and 8 for each sum", HEAD + expected);
            return refused(format!("{} bytes", bytes.len()), &text);
        }
        let numbers = |bytes: &[u8]| -> Vec<f64> {
            bytes.as_chunks::<8>().0.iter().map(|&b| f64::from_le_bytes(b)).collect()
        };
        let (pairs, products) = rest.split_at(size_of::<f64>() * triangle(atoms));
        let (scalars, pairs, products) = (numbers(scalars), numbers(pairs), numbers(products));
        if scalars.iter().chain(&pairs).chain(&products).any(|v| !v.is_finite()) {
            return refused("NaN or infinity".to_owned(), "finite sums");
        }
        let energies = (0..atoms).map(|j| pairs[triangle(j) + j]);
        if scalars.iter().copied().chain(energies).any(|v| v < 0.0) {
            return refused("a negative count or energy".to_owned(), "counts and energies of at least 0");
        }
        let [rows, nonzeros, squared_error] = scalars[..] else {
            return refused("other bytes".to_owned(), "three scalars");
        };
        Ok(Self { dim, atoms, rows, nonzeros, squared_error, pairs, products })
    }
}
