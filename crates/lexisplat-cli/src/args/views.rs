//! The options that say what is drawn from where.

use std::path::PathBuf;

use clap::Args;
use lexisplat_compress::{SplitFilter, ViewOptions, Viewpoints};
use lexisplat_render::Device;

use super::values::{colour, length, split, viewpoints, whole};

/// The cameras to draw from, and the background and device of drawing.
#[derive(Debug, Args)]
pub(crate) struct Views {
    /// Cameras to draw from: INRIA's cameras.json, a transforms.json of nerfstudio, or a COLMAP folder such as sparse/0
    /// [default: views generated for the scene].
    #[arg(long, visible_alias = "sparse", value_name = "PATH", conflicts_with_all = ["orbit", "viewpoints"])]
    pub(crate) cameras: Option<PathBuf>,
    /// Cameras to use: all of them, or the cameras of one split. If the file marks no split, --hold makes one
    /// [default: all; with photos, test].
    #[arg(long, value_parser = split(), requires = "cameras")]
    pub(crate) split: Option<SplitFilter>,
    /// Period of test cameras if the file marks no split: every N-th camera in the order of names is a test camera,
    /// starting with the first; at least 1.
    #[arg(long, default_value_t = lexisplat_compress::DEFAULT_HOLD, value_name = "N", value_parser = whole::<usize>(0..=u64::MAX), requires = "cameras")]
    pub(crate) hold: usize,
    /// Viewpoints of generated views: around an `object`, or inside a `room`. `auto` chooses one of them by the scene.
    #[arg(long = "views", value_parser = viewpoints(), default_value = "auto")]
    pub(crate) viewpoints: Viewpoints,
    /// Number of generated views, 1 to 65535 [default: 8].
    #[arg(long, value_name = "N", value_parser = whole::<u16>(1..=65_535))]
    pub(crate) orbit: Option<u16>,
    /// Largest width of a picture, 1 to 16384 pixels. Wider pictures are drawn smaller.
    #[arg(long, default_value_t = lexisplat_compress::DEFAULT_MAX_WIDTH, value_name = "PIXELS", value_parser = whole::<u32>(1..=16_384))]
    pub(crate) width: u32,
    /// Distance of the near plane, in the scene's units, above 0, such as 0.01. Gaussians nearer than this distance are
    /// not drawn [default: the trainer's 0.2 for --cameras, otherwise a distance that suits the scene's size].
    #[arg(long, value_name = "UNITS", value_parser = length)]
    pub(crate) near: Option<f32>,
    /// Colour behind the scene: `black`, `white`, or R,G,B with each value from 0 to 1, such as 0.2,0.2,0.2.
    #[arg(long, default_value = "black", value_parser = colour)]
    pub(crate) background: [f32; 3],
    /// Device that draws: `cpu`, `gpu`, `auto` (a GPU if there is one that is not emulated in software, otherwise the
    /// CPU), or a number from `lexisplat devices`.
    #[arg(long, default_value = "auto", value_name = "auto|cpu|gpu|N")]
    pub(crate) device: Device,
}

/// Photos to score against.
#[derive(Debug, Args)]
pub(crate) struct Photos {
    /// Folder of photos. Each photo belongs to the camera of the same name. Without --split only test cameras are used.
    #[arg(long, value_name = "DIR", requires = "cameras")]
    pub(crate) images: Option<PathBuf>,
    /// Divisor of the width and height of photos: 1, 2, 4 or 8. The folder `DIR_N` is used if it exists, otherwise the
    /// photos are scaled [default: 1].
    #[arg(long, value_name = "N", value_parser = whole::<u32>(0..=u64::MAX), requires = "images")]
    pub(crate) resolution: Option<u32>,
}

impl Views {
    /// Returns the number of generated views.
    pub(crate) fn generated(&self) -> u16 {
        self.orbit.unwrap_or(lexisplat_compress::DEFAULT_ORBIT)
    }

    /// Returns the options in the form that the library takes.
    pub(crate) fn options(&self, photos: Option<&Photos>) -> ViewOptions {
        let mut options = ViewOptions::default();
        options.cameras.clone_from(&self.cameras);
        options.hold = self.hold;
        options.viewpoints = self.viewpoints;
        options.count = self.generated();
        options.max_width = self.width;
        options.near = self.near;
        if let Some(photos) = photos {
            options.images.clone_from(&photos.images);
            options.resolution = photos.resolution;
        }
        let default = if options.images.is_some() { SplitFilter::Test } else { SplitFilter::All };
        options.split = self.split.unwrap_or(default);
        options
    }
}
