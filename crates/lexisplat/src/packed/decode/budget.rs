//! A view of a scene, and what may be drawn and held of the scene.

use crate::support::builder::builder_methods;

/// A position from which a scene is looked at, for the choice of chunks.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Eye {
    /// Position, in the coordinates of the file.
    pub position: [f32; 3],
    /// Direction of view, of any length. Default none: all directions count alike.
    pub forward: Option<[f32; 3]>,
    /// Half the angle of the cone that holds the picture, in radians. Default that of all directions.
    pub half_angle: f32,
    /// Angle that a pixel covers, in radians. Detail that is finer is not chosen. Default 0: all detail may be chosen.
    pub pixel: f32,
}

impl Eye {
    /// Creates an eye at `position` that looks in all directions.
    #[must_use]
    pub fn at(position: [f32; 3]) -> Self {
        Self { position, forward: None, half_angle: std::f32::consts::PI, pixel: 0.0 }
    }

    builder_methods!(
        with_forward(forward: impl Into<Option<[f32; 3]>>),
        with_half_angle(half_angle: f32),
        with_pixel(pixel: f32),
    );
}

/// The most that is drawn and held of a scene at a time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Budget {
    /// Most Gaussians. Default no limit.
    pub splats: u64,
    /// Most bytes of ranges of the file. Default no limit.
    pub bytes: u64,
}

impl Default for Budget {
    fn default() -> Self {
        Self { splats: u64::MAX, bytes: u64::MAX }
    }
}

impl Budget {
    builder_methods!(with_splats(splats: u64), with_bytes(bytes: u64),);
}
