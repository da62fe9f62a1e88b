//! The values of splats that are not compressed.

use std::ops::Range;

use lexisplat::sh::CHANNELS;
use lexisplat::{Error, Result, ShDegree};

use super::accessor::{Accessor, Component};
use super::buffers::Buffers;
use super::document::{Document, Shape};
use super::primitive::Found;
use super::{attribute, rest_attributes};
use crate::rows::RowsMut;

use Component::{F32, I8, I8Share, I16, I16Share, U8, U8Share, U16, U16Share};

/// Types that the numbers of positions may have, with `KHR_mesh_quantization`.
const POSITION: &[Component] = &[F32, I8, I8Share, U8, U8Share, I16, I16Share, U16, U16Share];
const ROTATION: &[Component] = &[F32, I8Share, I16Share];
const SCALE: &[Component] = &[F32, U8, U8Share, U16, U16Share];
const OPACITY: &[Component] = &[F32, U8Share, U16Share];
const HARMONICS: &[Component] = &[F32];

/// The accessors of a primitive. All have the same number of elements.
#[derive(Debug)]
pub(super) struct Accessors {
    position: Accessor,
    rotation: Accessor,
    scale: Accessor,
    opacity: Accessor,
    dc: Accessor,
    rest: Vec<Accessor>,
}

impl Accessors {
    /// Returns the number of Gaussians.
    pub(super) fn len(&self) -> usize {
        self.position.count
    }

    /// Checks the accessors of a primitive that is not compressed.
    ///
    /// # Errors
    /// [`Error::Format`] for numbers that are not all in the file or have the wrong type.
    pub(super) fn check(
        name: &str,
        document: &Document<'_>,
        buffers: &Buffers<'_>,
        found: &Found,
        (geometry, rest, degree): (&[usize; 5], &[usize], ShDegree),
    ) -> Result<Self> {
        let check = |name_of: &str, index: usize, shape, components| {
            Accessor::check(name, document, buffers, (name_of, index), shape, components)
        };
        let [position, rotation, scale, opacity, dc] = *geometry;
        let position = check("POSITION", position, Shape::Vec3, POSITION)?;
        let same = |name_of: &str, accessor: Accessor| {
            if accessor.count == position.count {
                return Ok(accessor);
            }
            let text = format!(
                "{}: {} elements of {name_of}, and {} of POSITION",
                found.label, accessor.count, position.count
            );
            Err(Error::malformed(name, text))
        };
        let of = |word: &str, index: usize, shape, components| {
            let name_of = attribute(word);
            same(&name_of, check(&name_of, index, shape, components)?)
        };
        let sh = |(name_of, index): (String, &usize)| {
            same(&name_of, check(&name_of, *index, Shape::Vec3, HARMONICS)?)
        };
        Ok(Self {
            position,
            rotation: of("ROTATION", rotation, Shape::Vec4, ROTATION)?,
            scale: of("SCALE", scale, Shape::Vec3, SCALE)?,
            opacity: of("OPACITY", opacity, Shape::Scalar, OPACITY)?,
            dc: of("SH_DEGREE_0_COEF_0", dc, Shape::Vec3, HARMONICS)?,
            rest: rest_attributes(degree).zip(rest).map(sh).collect::<Result<_>>()?,
        })
    }

    /// Decodes Gaussians `range` to SH of `degree`, which must not be lower than the degree of the primitive.
    pub(super) fn fill(
        &self,
        buffers: &Buffers<'_>,
        range: Range<usize>,
        degree: ShDegree,
        out: RowsMut<'_>,
    ) {
        let RowsMut { positions, dc, opacities, scales, rotations, sh_rest } = out;
        self.position.read(buffers, range.clone(), |i, v| positions[i] = v);
        self.rotation.read(buffers, range.clone(), |i, [x, y, z, w]| rotations[i] = [w, x, y, z]);
        let half_step = self.scale.component.half_step();
        self.scale.read(buffers, range.clone(), |i, v: [f32; 3]| {
            scales[i] = v.map(|v| log_scale(v, half_step));
        });
        self.opacity.read(buffers, range.clone(), |i, [share]| opacities[i] = logit(share));
        self.dc.read(buffers, range.clone(), |i, v| dc[i] = v);
        if self.rest.len() < degree.rest_per_channel() {
            sh_rest.fill(0.0);
        }
        let (all, per) = (degree.rest(), degree.rest_per_channel());
        for (k, accessor) in self.rest.iter().enumerate() {
            accessor.read(buffers, range.clone(), |i, colours: [f32; CHANNELS]| {
                for (c, v) in colours.into_iter().enumerate() {
                    sh_rest[i * all + c * per + k] = v;
                }
            });
        }
    }
}

/// Returns the opacity before the sigmoid of `share`. It is infinite for shares up to 0 and from 1 on.
#[expect(clippy::cast_possible_truncation, reason = "scenes are in single precision")]
pub(super) fn logit(share: f32) -> f32 {
    if share <= 0.0 {
        f32::NEG_INFINITY
    } else if share >= 1.0 {
        f32::INFINITY
    } else {
        let share = f64::from(share);
        libm::log(share / (1.0 - share)) as f32
    }
}

/// Returns the logarithm of `scale`. For 0, whose logarithm is not finite, half of the smallest scale above 0 is used.
#[expect(clippy::cast_possible_truncation, reason = "scenes are in single precision")]
pub(super) fn log_scale(scale: f32, half_step: f64) -> f32 {
    libm::log(if scale == 0.0 { half_step } else { scale.into() }) as f32
}
