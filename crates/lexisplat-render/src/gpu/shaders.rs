//! Compiles kernels and binds buffers to them.

use crate::error::Result;

use super::constants::declarations;
use super::device::Gpu;
use super::moments::MomentKernels;

/// Every kernel but radiance, which depends on the scene.
#[derive(Debug, Clone)]
pub(super) struct Kernels {
    pub(super) cull: wgpu::ComputePipeline,
    pub(super) compact: wgpu::ComputePipeline,
    pub(super) plan_slots: wgpu::ComputePipeline,
    pub(super) plan_entries: wgpu::ComputePipeline,
    pub(super) scan_reduce: wgpu::ComputePipeline,
    pub(super) scan_spine: wgpu::ComputePipeline,
    pub(super) scan_spread: wgpu::ComputePipeline,
    pub(super) project: wgpu::ComputePipeline,
    pub(super) sort_count: wgpu::ComputePipeline,
    pub(super) sort_scatter: wgpu::ComputePipeline,
    pub(super) count_tiles: wgpu::ComputePipeline,
    pub(super) list_tiles: wgpu::ComputePipeline,
    pub(super) find_ranges: wgpu::ComputePipeline,
    pub(super) blend: wgpu::ComputePipeline,
    /// There only while sensitivities are measured.
    pub(super) moments: Option<MomentKernels>,
}

const FRAME: &str = include_str!("kernels/frame.wgsl");
const TILE: &str = include_str!("kernels/tile.wgsl");

/// The texts of all kernels but radiance, by name.
pub(super) const TEXTS: [(&str, &[&str]); 12] = [
    ("cull", &[FRAME, include_str!("kernels/cull.wgsl")]),
    ("compact", &[FRAME, include_str!("kernels/compact.wgsl")]),
    ("plan", &[FRAME, include_str!("kernels/plan.wgsl")]),
    ("scan", &[FRAME, include_str!("kernels/scan.wgsl")]),
    ("project", &[FRAME, include_str!("kernels/project.wgsl")]),
    ("sort", &[FRAME, include_str!("kernels/sort.wgsl")]),
    ("tiles", &[FRAME, include_str!("kernels/tiles.wgsl"), include_str!("kernels/list_tiles.wgsl")]),
    ("ranges", &[FRAME, include_str!("kernels/ranges.wgsl")]),
    ("blend", &[FRAME, TILE, include_str!("kernels/blend.wgsl")]),
    ("slots_of_entries", &[FRAME, include_str!("kernels/slots_of_entries.wgsl")]),
    ("moments", &[FRAME, TILE, include_str!("kernels/moments.wgsl")]),
    ("gather_moments", &[FRAME, include_str!("kernels/gather_moments.wgsl")]),
];

impl Kernels {
    /// Compiles them.
    pub(super) async fn new(gpu: &Gpu) -> Result<Self> {
        let alone = |name: &str, entry: &str| pipeline(gpu, &kernel(gpu, name), entry);
        let make = || {
            let [plan, scan, sort, tiles] = ["plan", "scan", "sort", "tiles"].map(|name| kernel(gpu, name));
            Ok(Self {
                cull: alone("cull", "cull"),
                compact: alone("compact", "compact"),
                plan_slots: pipeline(gpu, &plan, "plan_slots"),
                plan_entries: pipeline(gpu, &plan, "plan_entries"),
                scan_reduce: pipeline(gpu, &scan, "scan_reduce"),
                scan_spine: pipeline(gpu, &scan, "scan_spine"),
                scan_spread: pipeline(gpu, &scan, "scan_spread"),
                project: alone("project", "project"),
                sort_count: pipeline(gpu, &sort, "sort_count"),
                sort_scatter: pipeline(gpu, &sort, "sort_scatter"),
                count_tiles: pipeline(gpu, &tiles, "count_tiles"),
                list_tiles: pipeline(gpu, &tiles, "list_tiles"),
                find_ranges: alone("ranges", "find_ranges"),
                blend: alone("blend", "blend"),
                moments: None,
            })
        };
        gpu.checked("kernels", make).await
    }
}

/// The module of the kernel called `name`. What the device has against it is reported by the
/// [`checked`](Gpu::checked) around it, as for [`compile`], [`pipeline`] and [`bind`].
pub(super) fn kernel(gpu: &Gpu, name: &str) -> wgpu::ShaderModule {
    let parts = TEXTS.iter().find(|(found, _)| *found == name).map_or(&[][..], |(_, parts)| parts);
    compile(gpu, name, &parts.concat())
}

/// A module of `text` after the shared declarations.
pub(super) fn compile(gpu: &Gpu, name: &str, text: &str) -> wgpu::ShaderModule {
    let source = format!("{}\n{text}", declarations());
    gpu.device().create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(name),
        source: wgpu::ShaderSource::Wgsl(source.into()),
    })
}

/// The pipeline of one entry point.
pub(super) fn pipeline(gpu: &Gpu, module: &wgpu::ShaderModule, entry: &str) -> wgpu::ComputePipeline {
    gpu.device().create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(entry),
        layout: None,
        module,
        entry_point: Some(entry),
        // Every kernel writes its workgroup memory before it reads it.
        compilation_options: wgpu::PipelineCompilationOptions {
            zero_initialize_workgroup_memory: false,
            ..wgpu::PipelineCompilationOptions::default()
        },
        cache: None,
    })
}

/// What is bound to a kernel at one binding.
pub(super) enum Bound<'a> {
    /// All of a buffer.
    All(&'a wgpu::Buffer),
    /// A part of a buffer: its first byte, and the number of bytes.
    Part(&'a wgpu::Buffer, u64, u64),
    /// A texture.
    Texture(&'a wgpu::TextureView),
    /// A sampler for a texture.
    Sampler(&'a wgpu::Sampler),
}

/// Binds `entries` to the one group of `pipeline`.
pub(super) fn bind<'a>(
    gpu: &Gpu,
    pipeline: &wgpu::ComputePipeline,
    entries: impl IntoIterator<Item = (u32, Bound<'a>)>,
) -> wgpu::BindGroup {
    let entries: Vec<wgpu::BindGroupEntry<'_>> = entries
        .into_iter()
        .map(|(binding, bound)| wgpu::BindGroupEntry {
            binding,
            resource: match bound {
                Bound::All(buffer) => buffer.as_entire_binding(),
                Bound::Part(buffer, offset, size) => wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                    buffer,
                    offset,
                    size: std::num::NonZeroU64::new(size),
                }),
                Bound::Texture(view) => wgpu::BindingResource::TextureView(view),
                Bound::Sampler(sampler) => wgpu::BindingResource::Sampler(sampler),
            },
        })
        .collect();
    gpu.device().create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries,
    })
}
