//! A PLY whose header is read and whose values are not read yet.

use super::found::Found;
use super::header::Header;
use super::layout::{Layout, POSITIONS};
use super::marks::marks;
use super::names::NORMAL;
use super::options::ReadOptions;
use super::position_facts::PositionFacts;
use super::rows::Rows;
use super::summary::PlySummary;
use crate::formats::kind::without_byte_order_mark;
use crate::scene::splats::{SURE_OPACITY, SceneMeta, flat_note};
use crate::support::error::{Error, FormatError, Result};
use crate::support::limits::Limits;
use crate::support::memory_budget::{GEOMETRY_BYTES, MemoryBudget};

/// A PLY with a valid header and all its rows.
#[derive(Debug)]
pub(super) struct PlyFile<'a> {
    /// The file's name in messages.
    pub(super) name: &'a str,
    pub(super) rows: Rows<'a>,
    pub(super) layout: Layout,
    /// Number of rows of the vertex element.
    pub(super) count: usize,
    pub(super) meta: SceneMeta,
    pub(super) warnings: Vec<String>,
    pub(super) summary: PlySummary,
    /// Whether positions are finer than f32 and the offset is not decided yet.
    pub(super) looks_at_positions: bool,
    limits: Limits,
}

impl<'a> PlyFile<'a> {
    /// Reads the header of `bytes`. Messages call the file `name`.
    pub(super) fn open(name: &'a str, bytes: &'a [u8], options: &ReadOptions) -> Result<Self> {
        let file_bytes = bytes.len() as u64;
        let bytes = without_byte_order_mark(bytes);
        let header = Header::parse(name, bytes, &options.limits)?;
        let layout =
            Layout::new(&header, options.drop_extras).map_err(|problem| Error::format(name, problem))?;
        let summary = PlySummary::new(&header, &layout, file_bytes);
        options.limits.check_gaussians(name, summary.vertices)?;
        let marks = marks(&header.comments);
        let mut warnings = layout.warnings.clone();
        if marks.contradict {
            let said = "comments contradict each other about anti-aliasing; taken as anti-aliased";
            warnings.push(said.to_owned());
        }
        let rows = Rows::locate(name, &header, &layout, &bytes[header.bytes..], &mut warnings)?;
        let count = usize::try_from(summary.vertices).map_err(|_| {
            Error::malformed(name, format!("{} vertices do not fit in memory", summary.vertices))
        })?;
        if count == 0 {
            warnings.push("the scene holds no Gaussians".to_owned());
        }
        let meta =
            SceneMeta { comments: header.comments, antialiased: marks.antialiased, ..SceneMeta::default() };
        let looks_at_positions = layout.groups[POSITIONS].is_finer_than_f32();
        let limits = options.limits;
        Ok(Self { name, rows, layout, count, meta, warnings, summary, looks_at_positions, limits })
    }

    /// Returns an error if the limits do not allow `rows` rows in memory, with normals or without.
    pub(super) fn check_memory(&self, rows: usize, normals: bool) -> Result<()> {
        let extras = self.layout.extras.iter().map(|(_, field)| field.ty.bytes()).sum::<usize>();
        let floats = self.layout.degree.rest() + if normals { NORMAL.len() } else { 0 };
        let budget = MemoryBudget::new(&self.limits, self.name, self.summary.file_bytes);
        budget.take(rows, GEOMETRY_BYTES + floats * size_of::<f32>() + extras)
    }

    /// Decides on an offset, after all rows were read.
    pub(super) fn settle(&mut self, position_facts: PositionFacts) {
        if std::mem::take(&mut self.looks_at_positions) {
            let settled = position_facts.settle();
            self.meta.offset = settled.offset;
            self.warnings.extend(settled.warnings);
        }
    }

    /// Returns an error if bad rows were `found`, or adds a warning that they are dropped. Also adds warnings about
    /// infinite opacities and about flat Gaussians.
    pub(super) fn report(&mut self, found: &Found, options: &ReadOptions) -> Result<()> {
        if found.sure > 0 {
            self.warnings.push(format!(
                "{} opacities are infinite, taken as {SURE_OPACITY} (opaque) or -{SURE_OPACITY} (invisible)",
                found.sure
            ));
        }
        if found.flat > 0 {
            self.warnings.push(flat_note(found.flat));
        }
        let (Some(&row), Some(property)) = (found.bad.first(), &found.bad_property) else { return Ok(()) };
        let (count, first) = (found.bad.len() as u64, row as u64);
        if !options.drop_invalid {
            let problem = FormatError::NotFinite { count, first, property: property.clone() };
            return Err(Error::format(self.name, problem));
        }
        self.summary.dropped = count;
        self.warnings.push(format!(
            "dropped {count} of {} Gaussians with NaN or infinite values, the first is number {first} \
             (property '{property}')",
            self.count
        ));
        Ok(())
    }
}
