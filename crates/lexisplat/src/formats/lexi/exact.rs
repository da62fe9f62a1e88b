//! Reading the layouts `f32`, `f16` and `paper`, whole or a part at a time.

use std::ops::Range;

use half::f16;
use safetensors::Dtype;

use super::checked::Checked;
use super::fields::{degree, dictionary, extras, layout, meta, record};
use super::layout::Layout;
use super::schema::{EXTRA_PREFIX, GEOMETRY, geometry_shape, tensor};
use crate::scene::sh::ShDegree;
use crate::scene::splats::{Geometry, SceneMeta};
use crate::sparse::codes::ValueType;
use crate::sparse::codes::{Escapes, Indices, SparseCodes, Values};
use crate::sparse::dictionary::Dictionary;
use crate::sparse::model::{Model, Record};
use crate::support::error::{Error, FormatError, Result};
use crate::support::limits::Limits;
use crate::support::memory_budget::{COUNT_BYTES, GEOMETRY_BYTES, MemoryBudget};

/// Number of Gaussians between two offsets into the codes that are kept. Opening a file reads as many Gaussians at a time.
const BLOCK: usize = 65_536;

/// An exact file in which everything is checked except the codes themselves.
#[derive(Debug)]
pub(super) struct Exact<'a> {
    pub(super) checked: Checked<'a>,
    /// Number of Gaussians.
    pub(super) gaussians: usize,
    layout: Layout,
    pub(super) record: Record,
    pub(super) meta: SceneMeta,
    pub(super) dictionary: Dictionary,
    /// Whether the file holds normals.
    pub(super) normals: bool,
    nonzeros: usize,
    escapes: usize,
    /// Number of nonzeros before each [`BLOCK`] of Gaussians.
    offsets: Vec<usize>,
    limits: Limits,
}

impl<'a> Exact<'a> {
    /// Checks everything in `checked` except the codes themselves.
    pub(super) fn open(checked: Checked<'a>, limits: &Limits) -> Result<Self> {
        let n = match checked.tensor(tensor::POSITION)?.shape {
            [n, 3] => *n,
            shape => {
                return Err(checked.malformed(format!("tensor 'position' has shape {shape:?}, not [N, 3]")));
            }
        };
        limits.check_gaussians(&checked.file, n as u64)?;
        let (degree, layout, record) = (degree(&checked)?, layout(&checked)?, record(&checked)?);
        refuse_unknown(&checked, layout, degree)?;
        let normals = checked.has(tensor::NORMAL);
        all_finite(&checked, n, normals)?;
        extras(&checked, n, &(0..0))?;
        let mut exact = Self {
            dictionary: Dictionary::empty(),
            gaussians: n,
            meta: meta(&checked)?,
            normals,
            nonzeros: 0,
            escapes: 0,
            offsets: Vec::new(),
            limits: *limits,
            layout,
            record,
            checked,
        };
        if degree != ShDegree::ZERO {
            exact.validate_codes(degree)?;
        }
        Ok(exact)
    }

    /// Reads the dictionary, and checks everything that says where codes are.
    fn validate_codes(&mut self, degree: ShDegree) -> Result<()> {
        let n = self.gaussians;
        let checked = &self.checked;
        self.dictionary = dictionary(checked, degree, &self.limits)?;
        self.nonzeros = checked.list_len(tensor::VALUES)?;
        let paper = self.layout == Layout::Paper;
        if paper && checked.rows::<i32>(tensor::POINTERS, Dtype::I32, &[n + 1], &(0..1))? != [0] {
            return Err(checked.malformed("tensor 'codes.pointers' does not begin with 0"));
        }
        let mut total = 0_usize;
        let mut offsets = Vec::with_capacity(n.div_ceil(BLOCK));
        for start in (0..n).step_by(BLOCK) {
            offsets.push(total);
            let counts = self.counts(start..n.min(start + BLOCK))?;
            if let Some(k) = counts.iter().position(|&c| u64::from(c) > self.limits.nonzeros) {
                self.limits.check_nonzeros(&checked.file, start + k, counts[k].into())?;
            }
            total = counts.iter().fold(total, |sum, &c| sum.saturating_add(usize::from(c)));
        }
        self.offsets = offsets;
        // Types and shapes must be right even if there is nothing to read.
        self.counts(0..0)?;
        self.read_codes(0..0)?;
        let checked = &self.checked;
        if total != self.nonzeros {
            let expected = format!("{total} entries, the sum of codes.counts");
            let error = Error::parameter("codes.values", self.nonzeros, expected);
            return Err(checked.malformed(error.to_string()));
        }
        if !checked.has(tensor::ESCAPED) {
            return Ok(());
        }
        self.escapes = checked.list_len(tensor::ESCAPED)?;
        self.escaped(0..0)?;
        checked.data(tensor::ESCAPE_ROWS, Dtype::F32, &[self.escapes, self.dictionary.dim()])?;
        let mut last = None;
        for start in (0..self.escapes).step_by(BLOCK) {
            for gaussian in self.escaped(start..self.escapes.min(start + BLOCK))? {
                if last.is_some_and(|last| last >= gaussian) || gaussian as usize >= n {
                    let expected = "strictly ascending Gaussians without nonzeros";
                    let error = Error::parameter("escapes.gaussians", gaussian, expected);
                    return Err(self.checked.malformed(error.to_string()));
                }
                last = Some(gaussian);
            }
        }
        Ok(())
    }

    /// Returns the Gaussians of `range`. Escapes are numbered from the start of the range.
    pub(super) fn part(&self, range: Range<usize>) -> Result<Model> {
        let (checked, n) = (&self.checked, self.gaussians);
        let budget = self.budget_for_geometry(range.len())?;
        let geometry = Geometry {
            positions: checked.rows(tensor::POSITION, Dtype::F32, &[n, 3], &range)?,
            normals: match self.normals {
                true => checked.rows(tensor::NORMAL, Dtype::F32, &[n, 3], &range)?,
                false => Vec::new(),
            },
            dc: checked.rows(tensor::DC, Dtype::F32, &[n, 3], &range)?,
            opacities: checked.rows(tensor::OPACITY, Dtype::F32, &[n], &range)?,
            scales: checked.rows(tensor::SCALE, Dtype::F32, &[n, 3], &range)?,
            rotations: checked.rows(tensor::ROTATION, Dtype::F32, &[n, 4], &range)?,
            extras: extras(checked, n, &range)?,
        };
        let none = Values::empty(self.layout.values());
        if self.dictionary.is_empty() {
            let (counts, indices) = (vec![0; range.len()], Indices::for_atoms(0));
            let codes = SparseCodes::new(&self.dictionary, counts, indices, none, Escapes::default())?;
            return self.model(geometry, codes);
        }
        let block = range.start / BLOCK;
        let before = self.counts(block * BLOCK..range.start)?;
        let counts = self.counts(range.clone())?;
        let sum = |counts: &[u8]| counts.iter().map(|&c| usize::from(c)).sum::<usize>();
        let start = self.offsets.get(block).copied().unwrap_or(self.nonzeros) + sum(&before);
        let escaped = self.escaped_of(&range)?;
        let width = Indices::for_atoms(self.dictionary.len()).width() + none.width();
        budget.take(sum(&counts), width)?;
        budget.take(escaped.len(), size_of::<u32>() + self.dictionary.dim() * size_of::<f32>())?;
        let (indices, values) = self.read_codes(start..start + sum(&counts))?;
        let escapes = self.escapes(&range, &escaped)?;
        let codes = SparseCodes::part(&self.dictionary, range.start, counts, indices, values, escapes)
            .map_err(|e| checked.malformed(e.to_string()))?;
        self.model(geometry, codes)
    }

    fn model(&self, geometry: Geometry, codes: SparseCodes) -> Result<Model> {
        Model::new(geometry, self.meta.clone(), self.dictionary.clone(), codes, self.record.clone())
    }

    /// Returns the budget that the limits leave for codes after everything else of `count` Gaussians.
    fn budget_for_geometry(&self, count: usize) -> Result<MemoryBudget<'_>> {
        let normals = if self.normals { 3 * size_of::<f32>() } else { 0 };
        let extras = extras(&self.checked, self.gaussians, &(0..0))?;
        let extras = extras.iter().map(|e| e.values.width()).sum::<usize>();
        let budget = MemoryBudget::new(&self.limits, &self.checked.file, self.checked.bytes().len() as u64);
        budget.take(count, GEOMETRY_BYTES + COUNT_BYTES + normals + extras)?;
        Ok(budget)
    }

    /// Returns the number of nonzeros of each Gaussian of `range`.
    fn counts(&self, range: Range<usize>) -> Result<Vec<u8>> {
        let (checked, n) = (&self.checked, self.gaussians);
        if self.layout != Layout::Paper {
            return checked.rows(tensor::COUNTS, Dtype::U8, &[n], &range);
        }
        let ends = range.start..range.end + 1;
        let pointers: Vec<i32> = checked.rows(tensor::POINTERS, Dtype::I32, &[n + 1], &ends)?;
        let count = |pair: &[i32]| u8::try_from(i64::from(pair[1]) - i64::from(pair[0])).ok();
        pointers.windows(2).map(count).collect::<Option<Vec<u8>>>().ok_or_else(|| {
            checked.malformed("tensor 'codes.pointers' is not monotonic with steps of at most 255")
        })
    }

    /// Returns the indices and values of nonzeros `range`, counted over all Gaussians.
    fn read_codes(&self, range: Range<usize>) -> Result<(Indices, Values)> {
        let (checked, all) = (&self.checked, [self.nonzeros]);
        let values = if self.layout.values() == ValueType::F16 {
            let bits: Vec<u16> = checked.rows(tensor::VALUES, Dtype::F16, &all, &range)?;
            Values::F16(bits.into_iter().map(f16::from_bits).collect())
        } else {
            Values::F32(checked.rows(tensor::VALUES, Dtype::F32, &all, &range)?)
        };
        let small = matches!(Indices::for_atoms(self.dictionary.len()), Indices::U8(_));
        let bad = |i: i32| checked.malformed(format!("tensor 'codes.indices' holds {i}"));
        let indices = match (self.layout, small) {
            (Layout::Paper, _) => {
                let wide: Vec<i32> = checked.rows(tensor::INDICES, Dtype::I32, &all, &range)?;
                let wide = wide.into_iter();
                if small {
                    Indices::U8(wide.map(|i| u8::try_from(i).map_err(|_| bad(i))).collect::<Result<_>>()?)
                } else {
                    Indices::U16(wide.map(|i| u16::try_from(i).map_err(|_| bad(i))).collect::<Result<_>>()?)
                }
            }
            (_, true) => Indices::U8(checked.rows(tensor::INDICES, Dtype::U8, &all, &range)?),
            (_, false) => Indices::U16(checked.rows(tensor::INDICES, Dtype::U16, &all, &range)?),
        };
        Ok((indices, values))
    }

    /// Returns the numbers of the Gaussians of escapes `range`.
    fn escaped(&self, range: Range<usize>) -> Result<Vec<u32>> {
        self.checked.rows(tensor::ESCAPED, Dtype::U32, &[self.escapes], &range)
    }

    /// Returns the range of the escapes that are of Gaussians `range`.
    fn escaped_of(&self, range: &Range<usize>) -> Result<Range<usize>> {
        if self.escapes == 0 {
            return Ok(0..0);
        }
        let (mut low, mut high) = (0, self.escapes);
        while low < high {
            let middle = low.midpoint(high);
            match self.escaped(middle..middle + 1)?.first() {
                Some(&gaussian) if (gaussian as usize) < range.start => low = middle + 1,
                _ => high = middle,
            }
        }
        let gaussians = self.escaped(low..self.escapes.min(low + range.len()))?;
        Ok(low..low + gaussians.partition_point(|&g| (g as usize) < range.end))
    }

    /// Returns the escapes `escaped`, which must be those of Gaussians `range`.
    fn escapes(&self, range: &Range<usize>, escaped: &Range<usize>) -> Result<Escapes> {
        if escaped.is_empty() {
            return Ok(Escapes::default());
        }
        let mut gaussians = self.escaped(escaped.clone())?;
        let start = u32::try_from(range.start).unwrap_or(u32::MAX);
        gaussians.iter_mut().for_each(|g| *g -= start);
        let shape = [self.escapes, self.dictionary.dim()];
        Ok(Escapes { gaussians, rows: self.checked.rows(tensor::ESCAPE_ROWS, Dtype::F32, &shape, escaped)? })
    }
}

const CODES: [&str; 3] = [tensor::DICTIONARY, tensor::INDICES, tensor::VALUES];
const ESCAPES: [&str; 2] = [tensor::ESCAPED, tensor::ESCAPE_ROWS];

/// Refuses tensors that `layout` does not define and that a reader must not ignore.
pub(super) fn refuse_unknown(checked: &Checked<'_>, layout: Layout, degree: ShDegree) -> Result<()> {
    let counts = if layout == Layout::Paper { tensor::POINTERS } else { tensor::COUNTS };
    let coded = degree != ShDegree::ZERO;
    let known = |name: &str| {
        GEOMETRY.iter().any(|g| g.0 == name)
            || (coded && (name == counts || CODES.contains(&name)))
            || (coded && checked.has(tensor::ESCAPED) && ESCAPES.contains(&name))
            || name.starts_with(EXTRA_PREFIX)
    };
    checked.refuse_unknown(known, &format!("for layout '{layout}' and degree {degree}"))
}

/// Refuses NaN and infinity in geometry. Extras may hold anything.
fn all_finite(checked: &Checked<'_>, n: usize, normals: bool) -> Result<()> {
    let arrays = GEOMETRY.into_iter().filter(|&(name, _)| normals || name != tensor::NORMAL);
    let arrays = arrays.map(|(name, width)| (name, width, geometry_shape(n, width)));
    for (name, _, shape) in arrays.clone() {
        checked.data(name, Dtype::F32, &shape)?;
    }
    for (name, width, shape) in arrays {
        let (mut count, mut first) = (0_u64, None);
        for start in (0..n).step_by(BLOCK) {
            let values: Vec<f32> = checked.rows(name, Dtype::F32, &shape, &(start..n.min(start + BLOCK)))?;
            let bad = values.chunks_exact(width).enumerate();
            for (i, _) in bad.filter(|(_, row)| row.iter().any(|v| !v.is_finite())) {
                count += 1;
                first.get_or_insert((start + i) as u64);
            }
        }
        if let Some(first) = first {
            let problem = FormatError::NotFinite { count, first, property: name.to_owned() };
            return Err(Error::format(&checked.file, problem));
        }
    }
    Ok(())
}
