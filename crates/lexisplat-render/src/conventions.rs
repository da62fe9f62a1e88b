//! The numbers of the 3DGS authors' rasteriser. Each is defined here only.
//!
//! Sources are files of `graphdeco-inria/diff-gaussian-rasterization` at commit 59f5f77 unless stated otherwise. A change
//! of any of these numbers changes every picture.
//!
//! The other conventions are these. View space is that of `OpenCV`: x right, y down, z forward. Pixel centres lie at
//! integers (`ndc2Pix`: `((v + 1) * size - 1) / 2`). Gaussians are blended in order of view-space z; Gaussians of equal z
//! are blended in order of index. A pixel is `colour + transmittance * background`, not clamped.

/// Near plane of given cameras, in world units: a Gaussian is drawn only if its view-space z is above this
/// (`auxiliary.h`, `in_frustum`). Generated cameras have a near plane that suits the size of the scene
/// ([`crate::near_plane`]).
pub const NEAR_Z: f32 = 0.2;

/// Added to the homogeneous w, in world units, before the division by w (`forward.cu`, `preprocessCUDA`). It is scaled in
/// proportion to the camera's near plane, so that a scene looks the same in all units.
pub const W_EPSILON: f32 = 1e-7;

/// Limit of `x / z` and `y / z` in the Jacobian, in units of the tangent of half the field of view
/// (`forward.cu`, `computeCov2D`).
pub const TAN_LIMIT: f32 = 1.3;

/// Added to both variances on screen, in square pixels (`forward.cu`, `computeCov2D`; `h_var` in the
/// `dr_aa` branch).
pub const DILATION: f32 = 0.3;

/// Smallest value under the square root that separates the eigenvalues, in pixels to the fourth power (`forward.cu`,
/// `preprocessCUDA`).
pub const EIGEN_FLOOR: f32 = 0.1;

/// Radius of a Gaussian on screen, in standard deviations of its long axis (`forward.cu`,
/// `preprocessCUDA`).
pub const RADIUS_SIGMAS: f32 = 3.0;

/// Side of a tile, in pixels (`config.h`, `BLOCK_X` and `BLOCK_Y`).
pub const TILE: usize = 16;

/// Largest opacity of one Gaussian in one pixel (`forward.cu`, `renderCUDA`).
pub const ALPHA_MAX: f32 = 0.99;

/// Smallest opacity of a Gaussian in a pixel. With a lower opacity the Gaussian is left out of the pixel (`forward.cu`,
/// `renderCUDA`).
pub const ALPHA_MIN: f32 = 1.0 / 255.0;

/// Smallest transmittance of a pixel that is not finished. The first Gaussian that would lower the transmittance below
/// this finishes the pixel, and is not added (`forward.cu`, `renderCUDA`).
pub const TRANSMITTANCE_MIN: f32 = 1e-4;

/// Smallest ratio of the determinants before and after the dilation. The square root of the ratio scales the opacity in
/// anti-aliased scenes (`forward.cu` of the `dr_aa` branch, `preprocessCUDA`).
pub const ANTIALIAS_FLOOR: f32 = 0.000_025;

/// Smallest length by which a quaternion is divided (`graphdeco-inria/gaussian-splatting`, `scene/gaussian_model.py`,
/// `rotation_activation`: the default of `torch.nn.functional.normalize`). The zero quaternion stays zero, and its
/// rotation matrix is then the identity.
pub const QUATERNION_FLOOR: f32 = 1e-12;

/// Slack on powers in the decision that a Gaussian cannot reach [`ALPHA_MIN`]. The errors of `exp` and of the logarithm
/// are 1e-6 together, far below this slack. The slack does not change pictures.
pub const POWER_SLACK: f32 = 1e-4;
