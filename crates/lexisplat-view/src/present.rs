//! Draws one or two pictures to a window, a canvas or a texture, with one triangle and a shader.

use wgpu::util::DeviceExt;

use crate::command::{Mode, Slot};
use crate::picture::Picture;
use crate::state::Arrangement;

/// The uniform `Arrangement` of the shader.
#[repr(C)]
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Uniform {
    size: [u32; 2],
    mode: u32,
    encodes: u32,
    split: f32,
    gain: f32,
    padding: [f32; 2],
}

/// Pictures of the same size, and their arrangement.
#[derive(Debug, Clone)]
pub struct Composition {
    /// Arrangement of the pictures.
    pub arrangement: Arrangement,
    /// The picture of each model.
    pub pictures: [Option<Picture>; 2],
}

impl Composition {
    /// Returns the left and the right picture. They are the same if one model is shown. Returns `None` if the arrangement
    /// needs a picture that is missing.
    #[must_use]
    pub fn sides(&self) -> Option<[&Picture; 2]> {
        let [first, second] = [0, 1].map(|i| self.pictures[i].as_ref());
        match (self.arrangement.mode, first, second) {
            (Mode::One(Slot::First), Some(one), _) | (Mode::One(Slot::Second), _, Some(one)) => {
                Some([one; 2])
            }
            (Mode::One(_), ..) => None,
            (_, Some(first), Some(second)) => Some([first, second]),
            _ => None,
        }
    }

    /// Returns the width and height of the arrangement in pixels, or `None` if a picture is missing.
    #[must_use]
    pub fn size(&self) -> Option<(u32, u32)> {
        let [picture, _] = self.sides()?;
        Some((picture.width * self.arrangement.columns(), picture.height))
    }
}

/// A presenter of pictures: a pipeline for one texture format.
#[derive(Debug)]
pub struct Presenter {
    pub(crate) device: wgpu::Device,
    pipeline: wgpu::RenderPipeline,
    encodes: bool,
}

impl Presenter {
    /// Returns a presenter for targets of `format`. The pictures are sRGB already. If the format encodes written values
    /// as sRGB, the shader decodes the pictures first, so that the same colours are shown.
    #[must_use]
    pub fn new(device: wgpu::Device, format: wgpu::TextureFormat) -> Self {
        let module = device.create_shader_module(wgpu::include_wgsl!("present.wgsl"));
        let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("present"),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("corner"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: None,
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("colour"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: &[Some(format.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        Self { device, pipeline, encodes: format.is_srgb() }
    }

    /// Returns the bind group that shows `composition`, or `None` if a picture is missing. Both pictures must have the
    /// same size and be on the presenter's device.
    #[must_use]
    pub fn bind(&self, composition: &Composition) -> Option<wgpu::BindGroup> {
        let [left, right] = composition.sides()?;
        let uniform = Uniform {
            size: [left.width, left.height],
            mode: match composition.arrangement.mode {
                Mode::One(_) => 0,
                Mode::SideBySide => 1,
                Mode::Wipe => 2,
                Mode::Difference => 3,
            },
            encodes: u32::from(self.encodes),
            split: composition.arrangement.split,
            gain: composition.arrangement.gain,
            padding: [0.0; 2],
        };
        let uniform = self.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("arrangement"),
            contents: bytemuck::bytes_of(&uniform),
            usage: wgpu::BufferUsages::UNIFORM,
        });
        Some(self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("present"),
            layout: &self.pipeline.get_bind_group_layout(0),
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: uniform.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: left.pixels.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 2, resource: right.pixels.as_entire_binding() },
            ],
        }))
    }

    /// Draws a bind group of [`Self::bind`] over the whole viewport of `pass`.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>, bound: &wgpu::BindGroup) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, bound, &[]);
        pass.draw(0..3, 0..1);
    }
}
