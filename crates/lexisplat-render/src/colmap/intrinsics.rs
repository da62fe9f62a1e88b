//! A COLMAP camera: size, model and parameters.

use std::collections::BTreeMap;

use crate::camera::MAX_SIDE;
use crate::error::Result;

/// Cameras by their number.
pub(super) type Cameras = BTreeMap<u32, Intrinsics>;

/// Names of COLMAP's models in order of their numbers (`src/colmap/sensor/models.h`).
const MODELS: [&str; 12] = [
    "SIMPLE_PINHOLE",
    "PINHOLE",
    "SIMPLE_RADIAL",
    "RADIAL",
    "OPENCV",
    "OPENCV_FISHEYE",
    "FULL_OPENCV",
    "FOV",
    "SIMPLE_RADIAL_FISHEYE",
    "RADIAL_FISHEYE",
    "THIN_PRISM_FISHEYE",
    "RAD_TAN_THIN_PRISM_FISHEYE",
];

/// A model without distortion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Pinhole {
    /// A model with one focal length: f, cx, cy.
    Simple,
    /// A model with two focal lengths: fx, fy, cx, cy.
    Two,
}

impl Pinhole {
    /// Returns the model of this name. The error for an unsupported model gives advice.
    pub(super) fn named(name: &str) -> Result<Self, String> {
        match name {
            "SIMPLE_PINHOLE" => Ok(Self::Simple),
            "PINHOLE" => Ok(Self::Two),
            other => Err(format!(
                "model {other} is not supported, only PINHOLE and SIMPLE_PINHOLE; run `colmap image_undistorter` and use its model and photos"
            )),
        }
    }

    /// Returns the model of this number in binary files.
    pub(super) fn numbered(number: u32) -> Result<Self, String> {
        let name = usize::try_from(number).ok().and_then(|n| MODELS.get(n));
        name.map_or_else(|| Self::named(&format!("number {number}")), |name| Self::named(name))
    }
}

/// Size, focal lengths and principal point of a camera, in pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Intrinsics {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) focal: [f64; 2],
    pub(super) centre: [f64; 2],
}

impl Intrinsics {
    /// Returns the intrinsics, or an error if a value is out of range.
    pub(super) fn new(width: u64, height: u64, focal: [f64; 2], centre: [f64; 2]) -> Result<Self, String> {
        let side = |name: &str, value: u64| match u32::try_from(value) {
            Ok(side) if (1..=MAX_SIDE).contains(&side) => Ok(side),
            _ => Err(format!("{name} is {value}, expected 1 to {MAX_SIDE} pixels")),
        };
        for value in focal {
            if !(value.is_finite() && value > 0.0) {
                return Err(format!("focal length is {value}, expected a finite number above 0"));
            }
        }
        for value in centre {
            if !value.is_finite() {
                return Err(format!("principal point is at {value}, expected a finite number"));
            }
        }
        Ok(Self { width: side("width", width)?, height: side("height", height)?, focal, centre })
    }
}
