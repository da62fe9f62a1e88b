//! The views to draw, and the photos that belong to them.

mod beside;
mod fit;
mod folder;
mod photo;
mod split;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};
use std::str::FromStr;

use lexisplat::{Geometry, Offset};
use lexisplat_render::{Camera, ViewSet, interior_views, is_interior, object, orbit, read_views};

use crate::error::{Error, Result};
use crate::signs::near_plane_hides;
pub use beside::{cameras_beside, read_beside};
use folder::PhotoFolder;
pub use photo::photo;
pub use split::{DEFAULT_HOLD, SplitFilter, marked};

/// Default of the largest width of a picture, in pixels, as in the field (INRIA `utils/camera_utils.py`).
pub const DEFAULT_MAX_WIDTH: u32 = 1600;
/// Default number of generated views.
pub const DEFAULT_ORBIT: u16 = 8;
/// Width and height of generated views, in pixels, before the width is limited.
pub const ORBIT_SIZE: (u32, u32) = (960, 640);
/// Divisors of photos that data sets have, in folders such as `images_2`.
const DIVISORS: [u32; 4] = [1, 2, 4, 8];

/// Where generated views are taken from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Viewpoints {
    /// From where [`is_interior`] says.
    #[default]
    Auto,
    /// From around the scene ([`object`]).
    Object,
    /// From inside the scene ([`interior_views`]).
    Room,
}

impl FromStr for Viewpoints {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "auto" => Ok(Self::Auto),
            "object" => Ok(Self::Object),
            "room" => Ok(Self::Room),
            _ => Err(Error::parameter("views", text, "auto, object or room")),
        }
    }
}

/// The views that [`find_views`] returns.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewOptions {
    /// Cameras of any kind that [`read_views`] reads. Views are generated without them.
    pub cameras: Option<PathBuf>,
    /// The cameras to use. Generated views have no split.
    pub split: SplitFilter,
    /// If no camera is marked with a split, every `hold`-th by name is a test view, beginning with the first. Above
    /// 0.
    pub hold: usize,
    /// Where generated views are taken from.
    pub viewpoints: Viewpoints,
    /// Number of views to generate.
    pub count: u16,
    /// Largest width of a picture, in pixels. Wider cameras are scaled down.
    pub max_width: u32,
    /// Folder of photos. Cameras without one are left out.
    pub images: Option<PathBuf>,
    /// Distance of the near plane of all views, in world units, above 0. Without it cameras that are read have the trainer's,
    /// and generated ones one of the scene's own size.
    pub near: Option<f32>,
    /// Divisor of the photos' size: 1, 2, 4 or 8. The photos come from the folder of this divisor beside the given
    /// one (`images_4`), or are scaled when they are read. Without photos the cameras are scaled.
    pub resolution: Option<u32>,
    /// The offset of the scene's positions, in whose world given cameras are: it is subtracted from theirs.
    pub offset: Option<Offset>,
}

impl Default for ViewOptions {
    fn default() -> Self {
        Self {
            cameras: None,
            split: SplitFilter::All,
            hold: DEFAULT_HOLD,
            viewpoints: Viewpoints::Auto,
            count: DEFAULT_ORBIT,
            max_width: DEFAULT_MAX_WIDTH,
            images: None,
            near: None,
            resolution: None,
            offset: None,
        }
    }
}

/// A camera and its photo.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// The camera, which has the size to draw and to read the photo at.
    pub camera: Camera,
    /// The file of the photo.
    pub photo: Option<PathBuf>,
}

/// The views to draw.
#[derive(Debug, Clone, PartialEq)]
pub struct ChosenViews {
    /// The views in the order of their source. At least one.
    pub views: Vec<View>,
    /// Where the views come from: the file or folder as given, `orbit` or `room`.
    pub from: String,
    /// Warnings of views that were left out or look wrong, one sentence each.
    pub warnings: Vec<String>,
}

/// Returns the views that `options` mean for a scene of `geometry`.
///
/// # Errors
/// [`Error::Parameter`] if the resolution is not one of the divisors, the split leaves no camera, or the folder has
/// no photo of any camera. [`Error::Io`] if the folder or a photo cannot be read. [`Error::Format`] if a photo
/// cannot be decoded or has another shape than its camera. Errors of [`read_views`].
pub fn find_views(options: &ViewOptions, geometry: &Geometry) -> Result<ChosenViews> {
    let divisor = options.resolution.unwrap_or(1);
    if !DIVISORS.contains(&divisor) {
        return Err(Error::parameter("resolution", divisor, "expected 1, 2, 4 or 8"));
    }
    let near = |view: View| View { camera: view.camera.with_near(options.near), ..view };
    let Some(source) = &options.cameras else {
        let mut found = generated(options, divisor, geometry)?;
        found.views = found.views.into_iter().map(near).collect();
        return Ok(found);
    };
    let photos = options.images.as_deref().map(|images| PhotoFolder::open(images, divisor)).transpose()?;
    let set = read(source, photos.as_ref())?.relative_to(options.offset);
    let ViewSet { cameras, mut warnings, .. } = set;
    let cameras = split::filter(cameras, options.split, options.hold)?;
    let views = match &photos {
        Some(photos) => {
            let mut views = Vec::new();
            for (camera, path) in photos.matched(cameras, &mut warnings)? {
                let camera = fit::to_photo(&camera, photo::size(&path)?, &path)?;
                let camera = fit::divided(&camera, photos.divisor);
                views.push(View { camera, photo: Some(path) });
            }
            views
        }
        None => {
            let alone = cameras.iter().map(|camera| fit::divided(camera, divisor));
            alone.map(|camera| View { camera, photo: None }).collect()
        }
    };
    let views: Vec<View> = capped(views, options.max_width).into_iter().map(near).collect();
    let cameras: Vec<Camera> = views.iter().map(|view| view.camera.clone()).collect();
    warnings.extend(near_plane_hides(geometry, &cameras));
    Ok(ChosenViews { views, from: source.display().to_string(), warnings })
}

/// Reads the cameras of `source`. A size that it does not state is that of the photo, in the folder or where the
/// source says it is.
fn read(source: &Path, photos: Option<&PhotoFolder>) -> Result<ViewSet> {
    let mut failed = None;
    let set = read_views(source, &mut |name| {
        let path = match photos {
            Some(photos) => photos.find(name).one()?.to_path_buf(),
            None => folder::beside(source, name)?,
        };
        photo::size(&path).map_err(|e| failed.get_or_insert(e)).ok()
    });
    match (set, failed) {
        (Err(_), Some(error)) => Err(error),
        (set, _) => Ok(set?),
    }
}

fn generated(options: &ViewOptions, divisor: u32, geometry: &Geometry) -> Result<ChosenViews> {
    if options.images.is_some() {
        return Err(Error::parameter("images", "a folder", "a folder only with the cameras of the photos"));
    }
    let inside = match options.viewpoints {
        Viewpoints::Auto => is_interior(geometry),
        Viewpoints::Object => false,
        Viewpoints::Room => true,
    };
    let (count, (width, height)) = (usize::from(options.count), ORBIT_SIZE);
    let (cameras, from) = if inside {
        (interior_views(geometry, count, width, height), "room")
    } else {
        (object(geometry, count, width, height), "orbit")
    };
    let cameras = split::unmarked(cameras, options.split)?;
    let views = cameras.iter().map(|c| View { camera: fit::divided(c, divisor), photo: None }).collect();
    Ok(ChosenViews { views: capped(views, options.max_width), from: from.into(), warnings: Vec::new() })
}

fn capped(views: Vec<View>, max_width: u32) -> Vec<View> {
    let cap = |view: View| View { camera: view.camera.with_max_width(max_width), ..view };
    views.into_iter().map(cap).collect()
}

/// Reads cameras of any kind that [`read_views`] reads, or generates an [`orbit`] of `orbit_views` around all of
/// `geometry`. If no camera is marked with a split, every [`DEFAULT_HOLD`]th is a test view.
///
/// # Errors
/// [`Error::Parameter`] if the filter leaves no camera. Errors of [`read_views`].
pub fn choose_views(
    cameras: Option<&Path>,
    filter: SplitFilter,
    orbit_views: u16,
    max_width: u32,
    geometry: &Geometry,
) -> Result<Vec<Camera>> {
    let found = match cameras {
        Some(source) => split::filter(read(source, None)?.cameras, filter, DEFAULT_HOLD)?,
        None => split::unmarked(orbit(geometry, orbit_views.into(), ORBIT_SIZE.0, ORBIT_SIZE.1), filter)?,
    };
    Ok(found.iter().map(|camera| camera.with_max_width(max_width)).collect())
}
