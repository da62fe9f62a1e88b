//! Numbers in buffers (glTF 2.0 specification, "Accessors").

use std::ops::Range;

use lexisplat::{Error, Result};

use super::buffers::{Buffers, Span, missing};
use super::document::{Document, Shape};

/// Type of a stored number, from `componentType`, and whether the number is normalised: a share of the largest value of
/// its type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Component {
    I8,
    I8Share,
    U8,
    U8Share,
    I16,
    I16Share,
    U16,
    U16Share,
    F32,
}

impl Component {
    fn of(number: u32, is_share: bool) -> Option<Self> {
        Some(match (number, is_share) {
            (5120, false) => Self::I8,
            (5120, true) => Self::I8Share,
            (5121, false) => Self::U8,
            (5121, true) => Self::U8Share,
            (5122, false) => Self::I16,
            (5122, true) => Self::I16Share,
            (5123, false) => Self::U16,
            (5123, true) => Self::U16Share,
            // Floats are never normalised.
            (5126, _) => Self::F32,
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::I8Share | Self::U8 | Self::U8Share => 1,
            Self::I16 | Self::I16Share | Self::U16 | Self::U16Share => 2,
            Self::F32 => 4,
        }
    }

    /// Returns half of the smallest number above 0.
    pub(super) fn half_step(self) -> f64 {
        match self {
            Self::I8 | Self::U8 | Self::I16 | Self::U16 => 0.5,
            Self::I8Share => 0.5 / f64::from(i8::MAX),
            Self::U8Share => 0.5 / f64::from(u8::MAX),
            Self::I16Share => 0.5 / f64::from(i16::MAX),
            Self::U16Share => 0.5 / f64::from(u16::MAX),
            Self::F32 => 0.5 * f64::from(f32::from_bits(1)),
        }
    }
}

/// An accessor whose numbers are all in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Accessor {
    span: Span,
    /// Distance of consecutive elements, in bytes.
    stride: usize,
    pub(super) component: Component,
    /// Number of elements.
    pub(super) count: usize,
}

impl Accessor {
    /// Returns accessor `index`, which belongs to `attribute`. Its elements must have the `shape`, and its numbers one of
    /// `components`.
    ///
    /// # Errors
    /// [`Error::Format`] for other numbers, and for elements that are not all in the file.
    pub(super) fn check(
        name: &str,
        document: &Document<'_>,
        buffers: &Buffers<'_>,
        (attribute, index): (&str, usize),
        shape: Shape,
        components: &[Component],
    ) -> Result<Self> {
        let malformed =
            |text: String| Error::malformed(name, format!("accessor {index}, {attribute}, {text}"));
        let entry = document.accessors.get(index).ok_or_else(|| missing(name, "accessor", index))?;
        let component = Component::of(entry.component_type, entry.normalized);
        let Some(component) = component.filter(|component| components.contains(component)) else {
            let normalized = if entry.normalized { " and normalized" } else { "" };
            let text = format!(
                "has componentType {}{normalized}, which the extension does not have there",
                entry.component_type
            );
            return Err(malformed(text));
        };
        if entry.shape != shape {
            return Err(malformed(format!("is not of type {shape:?}")));
        }
        if entry.sparse.is_some() {
            return Err(malformed("is sparse, which is not read".to_owned()));
        }
        let Some(buffer_view) = entry.buffer_view else {
            return Err(malformed("has no bufferView".to_owned()));
        };
        let (span, stride) = buffers.buffer_view(name, document, buffer_view)?;
        let element = shape.numbers() * component.bytes();
        let stride = stride.unwrap_or(element as u64);
        if stride < element as u64 {
            return Err(malformed(format!("has elements of {element} bytes, and a stride of {stride}")));
        }
        let before_last = entry.count.saturating_sub(1).saturating_mul(stride);
        let last = if entry.count == 0 { 0 } else { element as u64 };
        let end = entry.byte_offset.saturating_add(before_last).saturating_add(last);
        if end > span.length as u64 {
            let text = format!("ends at byte {end} of bufferView {buffer_view}, which has {}", span.length);
            return Err(malformed(text));
        }
        // All three values are at most the length of the span.
        let [offset, stride, count] =
            [entry.byte_offset, stride, entry.count].map(|v| usize::try_from(v).unwrap_or(usize::MAX));
        let span = Span { start: span.start + offset, length: span.length - offset, ..span };
        Ok(Self { span, stride, component, count })
    }

    /// Calls `put` for each element of `range`, with its index in `range` and its `N` numbers.
    pub(super) fn read<const N: usize>(
        &self,
        buffers: &Buffers<'_>,
        range: Range<usize>,
        put: impl FnMut(usize, [f32; N]),
    ) {
        let elements = Elements { bytes: buffers.get(self.span), stride: self.stride, range };
        let share = |v: i16, most: i16| (f32::from(v) / f32::from(most)).max(-1.0);
        match self.component {
            Component::I8 => elements.each(put, |[v]| f32::from(i8::from_le_bytes([v]))),
            Component::I8Share => {
                elements.each(put, |[v]| share(i8::from_le_bytes([v]).into(), i8::MAX.into()));
            }
            Component::U8 => elements.each(put, |[v]| f32::from(v)),
            Component::U8Share => elements.each(put, |[v]| f32::from(v) / f32::from(u8::MAX)),
            Component::I16 => elements.each(put, |v| f32::from(i16::from_le_bytes(v))),
            Component::I16Share => elements.each(put, |v| share(i16::from_le_bytes(v), i16::MAX)),
            Component::U16 => elements.each(put, |v| f32::from(u16::from_le_bytes(v))),
            Component::U16Share => {
                elements.each(put, |v| f32::from(u16::from_le_bytes(v)) / f32::from(u16::MAX));
            }
            Component::F32 => elements.each(put, f32::from_le_bytes),
        }
    }
}

/// Elements of a buffer.
struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
    range: Range<usize>,
}

impl Elements<'_> {
    /// Reads `N` numbers of `B` bytes of each element.
    fn each<const N: usize, const B: usize>(
        self,
        mut put: impl FnMut(usize, [f32; N]),
        number: impl Fn([u8; B]) -> f32,
    ) {
        for (index, element) in self.range.enumerate() {
            let bytes = self.bytes.get(element.saturating_mul(self.stride)..).unwrap_or_default();
            if let Some((numbers, _)) = bytes.as_chunks::<B>().0.split_first_chunk::<N>() {
                put(index, numbers.map(&number));
            }
        }
    }
}

impl Shape {
    /// Returns the number of values of an element.
    pub(super) fn numbers(self) -> usize {
        match self {
            Self::Scalar | Self::Other => 1,
            Self::Vec3 => 3,
            Self::Vec4 => 4,
        }
    }
}
