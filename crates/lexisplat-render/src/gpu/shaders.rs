//! Compiles kernels, and binds buffers to them.

use std::collections::HashMap;

use crate::error::Result;

use super::buffer::Buffer;
use super::constants::declarations;
use super::device::Gpu;

/// Kernels by the names of their entry points.
pub(super) type Kernels = HashMap<&'static str, wgpu::ComputePipeline>;

/// The name of a module, its entry points, and the parts of its text.
pub(super) type ModuleText = (&'static str, &'static [&'static str], &'static [&'static str]);

const FRAME: &str = include_str!("kernels/frame.wgsl");
const TILE: &str = include_str!("kernels/tile.wgsl");

/// All kernels for drawing and comparing except radiance, which depends on the scene.
pub(super) const DRAWING: [ModuleText; 10] = [
    ("cull", &["cull"], &[FRAME, include_str!("kernels/cull.wgsl")]),
    ("compact", &["compact"], &[FRAME, include_str!("kernels/compact.wgsl")]),
    ("plan", &["plan_slots", "plan_entries"], &[FRAME, include_str!("kernels/plan.wgsl")]),
    ("scan", &["scan_reduce", "scan_spine", "scan_spread"], &[FRAME, include_str!("kernels/scan.wgsl")]),
    ("project", &["project"], &[FRAME, include_str!("kernels/project.wgsl")]),
    ("sort", &["sort_count", "sort_scatter"], &[FRAME, include_str!("kernels/sort.wgsl")]),
    (
        "tiles",
        &["count_tiles", "list_tiles"],
        &[FRAME, include_str!("kernels/tiles.wgsl"), include_str!("kernels/list_tiles.wgsl")],
    ),
    ("ranges", &["find_ranges"], &[FRAME, include_str!("kernels/ranges.wgsl")]),
    ("blend", &["blend"], &[FRAME, TILE, include_str!("kernels/blend.wgsl")]),
    ("squared_error", &["squared_error"], &[FRAME, include_str!("kernels/squared_error.wgsl")]),
];

/// Kernels that are needed only to measure sensitivities.
pub(super) const MEASURING: [ModuleText; 3] = [
    ("slots_of_entries", &["slots_of_entries"], &[FRAME, include_str!("kernels/slots_of_entries.wgsl")]),
    ("moments", &["tile_moments"], &[FRAME, TILE, include_str!("kernels/moments.wgsl")]),
    ("gather_moments", &["gather_moments"], &[FRAME, include_str!("kernels/gather_moments.wgsl")]),
];

/// Compiles all kernels of `modules`.
pub(super) async fn kernels(gpu: &Gpu, modules: &[ModuleText]) -> Result<Kernels> {
    let of_module = |(name, entries, parts): &ModuleText| {
        let module = compile(gpu, name, &parts.concat());
        entries.iter().map(move |&entry| (entry, pipeline(gpu, &module, entry)))
    };
    gpu.checked("kernels", || Ok(modules.iter().flat_map(of_module).collect())).await
}

/// Returns a module of the shared declarations followed by `text`. The [`checked`](Gpu::checked) call around it reports
/// what the device refuses; the same holds for [`pipeline`] and [`bind`].
pub(super) fn compile(gpu: &Gpu, name: &str, text: &str) -> wgpu::ShaderModule {
    let source = format!("{}\n{text}", declarations());
    gpu.device().create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(name),
        source: wgpu::ShaderSource::Wgsl(source.into()),
    })
}

/// Returns the pipeline of one entry point.
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

/// Returns bindings of whole buffers: the first buffer at binding `first`, the others after it.
pub(super) fn all_from<'a>(
    first: u32,
    buffers: impl IntoIterator<Item = &'a Buffer>,
) -> impl Iterator<Item = wgpu::BindGroupEntry<'a>> {
    let entry = |(binding, buffer): (u32, &'a Buffer)| wgpu::BindGroupEntry {
        binding,
        resource: buffer.raw.as_entire_binding(),
    };
    (first..).zip(buffers).map(entry)
}

/// Binds `entries` to the only bind group of `pipeline`.
pub(super) fn bind<'a>(
    gpu: &Gpu,
    pipeline: &wgpu::ComputePipeline,
    entries: impl IntoIterator<Item = wgpu::BindGroupEntry<'a>>,
) -> wgpu::BindGroup {
    gpu.device().create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries.into_iter().collect::<Vec<_>>(),
    })
}
