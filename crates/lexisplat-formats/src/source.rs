//! A file of another format than PLY or .lexi as a source of splats.

use std::ops::Range;

use lexisplat::ply::ReadOptions;
use lexisplat::{
    DroppedRows, Error, FormatError, Geometry, Limits, Result, SURE_OPACITY, SplatSource, Splats,
};
use serde_json::Value;

use crate::rows::{Described, RowsMut};
use crate::sog::Sizes;

/// Number of Gaussians that one task decodes.
const GAUSSIANS_PER_TASK: usize = 8192;
/// Number of Gaussians that are checked together when a file is opened.
const SCAN: usize = 8 * GAUSSIANS_PER_TASK;
/// Number of bytes of a Gaussian's position, base colour, opacity, scales and rotation.
const GEOMETRY_BYTES: usize = (3 + 3 + 1 + 3 + 4) * size_of::<f32>();
/// Names of the arrays in errors, in the order of a PLY. Each is the name of the first property of the array.
const PROPERTIES: [&str; 6] = ["x", "f_dc_0", "f_rest_0", "opacity", "scale_0", "rot_0"];

/// A file of another format than PLY or .lexi. Its Gaussians are read a part at a time.
#[derive(Debug)]
pub struct FormatSource<'a> {
    name: String,
    sizes: Sizes,
    limits: Limits,
    file: Described<'a>,
    dropped: DroppedRows,
}

impl<'a> FormatSource<'a> {
    /// Checks all values of `file` once. The file is called `name` and has these sizes.
    pub(crate) fn new(
        name: &str,
        sizes: Sizes,
        mut file: Described<'a>,
        options: &ReadOptions,
    ) -> Result<Self> {
        options.limits.check_gaussians(name, file.len as u64)?;
        if file.len == 0 {
            file.warnings.push("the scene holds no Gaussians".to_owned());
        }
        let limits = options.limits;
        let mut source = Self { name: name.to_owned(), sizes, limits, file, dropped: DroppedRows::default() };
        if !source.file.rows.is_finite() {
            source.look(options)?;
        }
        Ok(source)
    }

    /// Finds the Gaussians that hold NaN or infinite values.
    fn look(&mut self, options: &ReadOptions) -> Result<()> {
        let mut part = self.empty();
        let mut dropped = Vec::new();
        let mut property = None;
        for start in (0..self.file.len).step_by(SCAN) {
            let range = start..(start + SCAN).min(self.file.len);
            self.fill(range.clone(), &mut part)?;
            for i in 0..range.len() {
                if let Some(found) = not_finite(&part, i) {
                    property = property.or(Some(found));
                    dropped.push(start + i);
                }
            }
        }
        let Some(&first) = dropped.first() else { return Ok(()) };
        let count = dropped.len() as u64;
        if !options.drop_invalid {
            let property = property.unwrap_or_default().to_owned();
            let problem = FormatError::NotFinite { count, first: first as u64, property };
            return Err(Error::format(&*self.name, problem));
        }
        self.file.warnings.push(format!("{count} Gaussians with NaN or infinite values are left out"));
        self.dropped = DroppedRows::new(dropped);
        Ok(())
    }

    /// Returns the facts about the file for `lexisplat info`, in order: names of JSON members, and values.
    #[must_use]
    pub fn facts(&self) -> &[(&'static str, Value)] {
        &self.file.facts
    }

    /// Decodes Gaussians `rows` of the file into `part`, including Gaussians that are left out.
    fn fill(&self, rows: Range<usize>, part: &mut Splats) -> Result<()> {
        let (n, rest) = (rows.len(), self.file.degree.rest());
        let each = GEOMETRY_BYTES + rest * size_of::<f32>();
        self.limits.check_arrays(&self.name, self.sizes.counted, n, each)?;
        resize(part, n, rest);
        let Geometry { positions, dc, opacities, scales, rotations, .. } = &mut part.geometry;
        let mut left = RowsMut { positions, dc, opacities, scales, rotations, sh_rest: &mut part.sh_rest };
        let mut pieces = Vec::with_capacity(n.div_ceil(GAUSSIANS_PER_TASK));
        for start in rows.clone().step_by(GAUSSIANS_PER_TASK) {
            let n = GAUSSIANS_PER_TASK.min(rows.end - start);
            pieces.push((start..start + n, left.take(n, rest)));
        }
        let fill = |(range, mut out): (Range<usize>, RowsMut<'_>)| {
            self.file.rows.fill(range, out.reborrow());
            for opacity in out.opacities.iter_mut().filter(|v| v.is_infinite()) {
                *opacity = SURE_OPACITY.copysign(*opacity);
            }
        };
        #[cfg(feature = "parallel")]
        {
            use rayon::prelude::*;
            pieces.into_par_iter().for_each(fill);
        }
        #[cfg(not(feature = "parallel"))]
        pieces.into_iter().for_each(fill);
        Ok(())
    }
}

/// Resizes all arrays to `n` Gaussians. Their contents have no meaning afterwards.
fn resize(part: &mut Splats, n: usize, rest: usize) {
    /// New memory comes zeroed from the system, so that the threads that fill it are the first to touch it.
    fn sized<T: Copy>(values: &mut Vec<T>, len: usize, zero: T) {
        if values.is_empty() {
            *values = vec![zero; len];
        } else {
            values.resize(len, zero);
        }
    }
    let geometry = &mut part.geometry;
    sized(&mut geometry.positions, n, [0.0; 3]);
    sized(&mut geometry.dc, n, [0.0; 3]);
    sized(&mut geometry.opacities, n, 0.0);
    sized(&mut geometry.scales, n, [0.0; 3]);
    sized(&mut geometry.rotations, n, [0.0; 4]);
    sized(&mut part.sh_rest, n * rest, 0.0);
}

/// Returns the name of the property of Gaussian `i` of `part` with a value that is not finite.
fn not_finite(part: &Splats, i: usize) -> Option<&'static str> {
    let geometry = &part.geometry;
    let values: [&[f32]; 6] = [
        &geometry.positions[i],
        &geometry.dc[i],
        part.rest(i),
        &geometry.opacities[i..=i],
        &geometry.scales[i],
        &geometry.rotations[i],
    ];
    let bad = |values: &[f32]| values.iter().any(|v| !v.is_finite());
    values.into_iter().zip(PROPERTIES).find(|(values, _)| bad(values)).map(|(_, name)| name)
}

impl SplatSource for FormatSource<'_> {
    fn len(&self) -> usize {
        self.file.len - self.dropped.count()
    }

    fn empty(&self) -> Splats {
        Splats {
            geometry: Geometry::default(),
            degree: self.file.degree,
            sh_rest: Vec::new(),
            meta: self.file.meta.clone(),
        }
    }

    fn has_normals(&self) -> bool {
        false
    }

    fn row_bytes(&self) -> u64 {
        self.sizes.all / (self.file.len as u64).max(1)
    }

    fn source_bytes(&self) -> u64 {
        self.sizes.all
    }

    fn warnings(&self) -> &[String] {
        &self.file.warnings
    }

    fn read(&self, range: Range<usize>, part: &mut Splats) -> Result<()> {
        let rows = self.dropped.rows(&range, self.file.len)?;
        self.fill(rows.clone(), part)?;
        self.dropped.remove(rows, part);
        Ok(())
    }
}
