//! Scenes that are read a part at a time.

use std::borrow::Cow;
use std::ops::Range;

use crate::scene::splats::{Geometry, Splats, all_finite};
use crate::support::error::{Error, Result};

/// Number of Gaussians in a block. Rows in one block are read together. A packed file decodes as many Gaussians together.
const BLOCK: usize = 32_768;

/// A scene whose Gaussians are read a part at a time. A reader of any format implements this trait, and so does a scene in
/// memory.
///
/// All values that [`Self::read`] gives are finite, except the values of extras.
pub trait SplatSource {
    /// Returns the number of Gaussians.
    fn len(&self) -> usize;

    /// Returns whether there are no Gaussians.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns a scene without Gaussians that has the degree, the comments and marks, and the names and types of extras of
    /// the source. [`Self::read`] fills it.
    fn empty(&self) -> Splats;

    /// Returns whether [`Self::read`] gives normals.
    fn has_normals(&self) -> bool;

    /// Returns the number of bytes of one Gaussian in the source. Progress counts these bytes.
    fn row_bytes(&self) -> u64;

    /// Returns the size of the source in bytes. By default, it is the size of all Gaussians.
    fn source_bytes(&self) -> u64 {
        (self.len() as u64).saturating_mul(self.row_bytes())
    }

    /// Returns the tiles of the scene, one after the other. The list is empty if the scene is one tile.
    fn tiles(&self) -> &[&dyn SplatSource] {
        &[]
    }

    /// Returns the warnings about the source, one sentence each.
    fn warnings(&self) -> &[String] {
        &[]
    }

    /// Reads the Gaussians of `range` into `part`, which must come from [`Self::empty`] and may have been filled before.
    ///
    /// # Errors
    /// [`Error::Parameter`] if the range ends after the last Gaussian, [`Error::Format`] for damage that is found only now,
    /// [`Error::Limit`] for a range too long to be held in memory.
    fn read(&self, range: Range<usize>, part: &mut Splats) -> Result<()>;

    /// Returns the whole scene. A scene in memory is borrowed.
    ///
    /// # Errors
    /// As [`Self::read`].
    fn whole(&self) -> Result<Cow<'_, Splats>> {
        let mut splats = self.empty();
        self.read(0..self.len(), &mut splats)?;
        Ok(Cow::Owned(splats))
    }

    /// Appends the SH-rest of each of `gaussians`, which may be in any order, to `out`.
    ///
    /// # Errors
    /// As [`Self::read`].
    fn read_rest(&self, gaussians: &[usize], out: &mut Vec<f32>) -> Result<()> {
        let mut part = self.empty();
        let dim = part.degree.rest();
        let start = out.len();
        out.resize(start + gaussians.len() * dim, 0.0);
        if dim == 0 {
            return Ok(());
        }
        let mut order: Vec<(usize, &mut [f32])> =
            gaussians.iter().copied().zip(out[start..].chunks_exact_mut(dim)).collect();
        order.sort_unstable_by_key(|o| o.0);
        for group in order.chunk_by_mut(|a, b| a.0 / BLOCK == b.0 / BLOCK) {
            let (first, last) = (group[0].0, group[group.len() - 1].0);
            self.read(first..last.saturating_add(1), &mut part)?;
            group.iter_mut().for_each(|(i, row)| row.copy_from_slice(part.rest(*i - first)));
        }
        Ok(())
    }
}

/// Refuses a range that ends after the last of `len` Gaussians.
pub(crate) fn check_range(range: &Range<usize>, len: usize) -> Result<()> {
    if range.start <= range.end && range.end <= len {
        return Ok(());
    }
    Err(Error::parameter("range", format!("{range:?}"), format!("at most {len} Gaussians")))
}

impl SplatSource for Splats {
    fn len(&self) -> usize {
        self.geometry.len()
    }

    fn empty(&self) -> Splats {
        let mut geometry = Geometry::default();
        geometry.extras.extend(self.geometry.extras.iter().map(|extra| extra.slice(0..0)));
        Splats { geometry, degree: self.degree, sh_rest: Vec::new(), meta: self.meta.clone() }
    }

    fn has_normals(&self) -> bool {
        !self.geometry.normals.is_empty()
    }

    fn row_bytes(&self) -> u64 {
        let extras = self.geometry.extras.iter().map(|e| e.values.width()).sum::<usize>();
        let normals = if self.has_normals() { 3 } else { 0 };
        ((3 + normals + 3 + self.degree.rest() + 1 + 3 + 4) * size_of::<f32>() + extras) as u64
    }

    fn read(&self, range: Range<usize>, part: &mut Splats) -> Result<()> {
        fn copy<T: Copy>(to: &mut Vec<T>, from: &[T]) {
            to.clear();
            to.extend_from_slice(from);
        }
        self.validate()?;
        check_range(&range, SplatSource::len(self))?;
        let (from, to) = (&self.geometry, &mut part.geometry);
        copy(&mut to.positions, &from.positions[range.clone()]);
        copy(&mut to.normals, if self.has_normals() { &from.normals[range.clone()] } else { &[] });
        copy(&mut to.dc, &from.dc[range.clone()]);
        copy(&mut to.opacities, &from.opacities[range.clone()]);
        copy(&mut to.scales, &from.scales[range.clone()]);
        copy(&mut to.rotations, &from.rotations[range.clone()]);
        to.extras = from.extras.iter().map(|extra| extra.slice(range.clone())).collect();
        let dim = self.degree.rest();
        copy(&mut part.sh_rest, &self.sh_rest[range.start * dim..range.end * dim]);
        part.geometry.validate_values()?;
        all_finite([("sh_rest", part.sh_rest.as_slice())])
    }

    fn whole(&self) -> Result<Cow<'_, Splats>> {
        Ok(Cow::Borrowed(self))
    }

    fn read_rest(&self, gaussians: &[usize], out: &mut Vec<f32>) -> Result<()> {
        self.validate()?;
        for &i in gaussians {
            check_range(&(i..i + 1), SplatSource::len(self))?;
            out.extend_from_slice(self.rest(i));
        }
        Ok(())
    }
}
