//! Draws an arrangement of pictures to memory instead of the screen.

use lexisplat_render::gpu::{OwnedBuffer, readback};

use crate::error::{Error, Result};
use crate::present::{Composition, Presenter};

/// Alignment of the rows of a texture in a buffer, in bytes.
const ROW: u32 = wgpu::COPY_BYTES_PER_ROW_ALIGNMENT;
/// Number of bytes of a pixel.
const PIXEL: u32 = 4;
/// A format without sRGB encoding, because the pictures are sRGB already.
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

/// A picture: width, height, and pixels row by row.
pub type Rgb8Image = (u32, u32, Vec<[u8; 3]>);

/// Draws arrangements off screen with the shader of the window.
#[derive(Debug)]
pub struct Composer {
    pub(crate) presenter: Presenter,
    pub(crate) queue: wgpu::Queue,
}

impl Composer {
    /// Returns a composer on `device`, whose queue is `queue`.
    #[must_use]
    pub fn new(device: wgpu::Device, queue: wgpu::Queue) -> Self {
        Self { presenter: Presenter::new(device, FORMAT), queue }
    }

    /// Draws `composition` at its own size. Outside of a browser something must poll the device meanwhile.
    ///
    /// # Errors
    /// [`Error::Device`] if a picture is missing, or too large for the device; [`Error::Render`] if the device is lost.
    pub async fn compose_async(&self, composition: &Composition) -> Result<Rgb8Image> {
        let (target, size) = self.submit(composition)?;
        Ok(image(size, &readback::read_async(&target, target.size()).await?))
    }

    /// Draws like [`Self::compose_async`], and blocks.
    ///
    /// # Errors
    /// As [`Self::compose_async`].
    #[cfg(feature = "window")]
    pub(crate) fn compose(&self, composition: &Composition) -> Result<Rgb8Image> {
        let (target, size) = self.submit(composition)?;
        Ok(image(size, &readback::read(&self.presenter.device, &target)?))
    }

    /// Starts drawing `composition`. Returns the buffer for its rows, each padded to [`ROW`] bytes, and its width and
    /// height in pixels.
    fn submit(&self, composition: &Composition) -> Result<(OwnedBuffer, (u32, u32))> {
        let device = &self.presenter.device;
        let bound = self.presenter.bind(composition);
        let (Some(bound), Some((width, height))) = (bound, composition.size()) else {
            return Err(Error::Device("there is no picture to save".to_owned()));
        };
        let most = device.limits().max_texture_dimension_2d;
        if width.max(height) > most {
            return Err(Error::Device(format!("{width} x {height} pixels: at most {most} on a side")));
        }
        let extent = wgpu::Extent3d { width, height, depth_or_array_layers: 1 };
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("composed"),
            size: extent,
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let row = row_bytes(width);
        let target = readback::target(device, u64::from(row) * u64::from(height));
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("compose"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                ..Default::default()
            });
            self.presenter.draw(&mut pass, &bound);
        }
        encoder.copy_texture_to_buffer(
            texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &target,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(row),
                    rows_per_image: None,
                },
            },
            extent,
        );
        self.queue.submit([encoder.finish()]);
        Ok((target, (width, height)))
    }
}

/// Returns the number of bytes of a padded row of `width` pixels in a buffer.
fn row_bytes(width: u32) -> u32 {
    (width * PIXEL).next_multiple_of(ROW)
}

/// Returns the picture in padded rows.
fn image((width, height): (u32, u32), bytes: &[u8]) -> Rgb8Image {
    let pixels = bytes
        .chunks_exact(row_bytes(width) as usize)
        .flat_map(|line| line[..(width * PIXEL) as usize].chunks_exact(PIXEL as usize))
        .map(|pixel| [pixel[0], pixel[1], pixel[2]])
        .collect();
    (width, height, pixels)
}
