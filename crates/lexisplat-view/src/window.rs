//! Opening the window.

use std::sync::Arc;
use std::sync::mpsc::channel;

use eframe::{egui, egui_wgpu};
use lexisplat::Geometry;
use lexisplat_eval::choose_views;
use lexisplat_render::gpu::{Gpu, rank};
use lexisplat_render::{Camera, Device};

use crate::Options;
use crate::app::App;
use crate::error::{Error, Result};
use crate::script;

/// Initial size of the window, in points.
const SIZE: [f32; 2] = [1280.0, 800.0];
/// Smallest size of the window, in points.
const LEAST_SIZE: [f32; 2] = [640.0, 400.0];
/// Graphics interfaces with the precision that the renderer's kernels need; OpenGL lacks it.
const BACKENDS: wgpu::Backends = wgpu::Backends::PRIMARY;

/// Opens the window and returns when it is closed.
///
/// # Errors
/// [`Error::NoDisplay`] and [`Error::NoAdapter`] if there is no display or no graphics adapter; errors of reading
/// the files named in `options`; and while a script runs, every other error.
pub fn run(options: Options) -> Result<()> {
    let script = script::parse(&options.script)?;
    let given = given_cameras(&options)?;
    if !has_display() {
        return Err(Error::NoDisplay);
    }
    let backends = wgpu::Backends::from_env().unwrap_or(BACKENDS);
    let count = adapters(backends);
    if count == 0 {
        return Err(Error::NoAdapter);
    }
    let chosen = match options.device {
        Device::Index(index) if index >= count => {
            let expected = format!("auto, cpu, gpu, or 0 to {}", count - 1);
            return Err(lexisplat::Error::parameter("device", index, expected).into());
        }
        Device::Index(index) => Some(index),
        _ => None,
    };
    let mut setup = egui_wgpu::WgpuSetupCreateNew::without_display_handle();
    setup.instance_descriptor.backends = backends;
    // The renderer's kernels compute the arguments of indirect dispatches and clamp them.
    setup.instance_descriptor.flags.remove(wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL);
    setup.native_adapter_selector = Some(Arc::new(move |adapters, surface| {
        best(adapters, surface, chosen)
            .ok_or_else(|| "none of the adapters can draw on this display".to_owned())
    }));
    setup.device_descriptor = Arc::new(Gpu::descriptor);
    let mut native = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_title("lexisplat")
            .with_app_id("lexisplat")
            .with_inner_size(SIZE)
            .with_min_inner_size(LEAST_SIZE)
            .with_drag_and_drop(true),
        ..Default::default()
    };
    native.wgpu_options.wgpu_setup = setup.into();
    let (failures, failed) = channel();
    let ran = eframe::run_native(
        "lexisplat",
        native,
        Box::new(move |creation| {
            creation.egui_ctx.set_theme(egui::Theme::Dark);
            Ok(Box::new(App::new(creation, options, given, script, failures)?))
        }),
    );
    match (failed.try_recv(), ran) {
        (Ok(error), _) => Err(error),
        (_, Ok(())) => Ok(()),
        (_, Err(error)) => Err(Error::Window(error.to_string())),
    }
}

/// Reads the camera file named in `options`, if there is one.
fn given_cameras(options: &Options) -> Result<Option<Vec<Camera>>> {
    let Some(path) = &options.cameras else { return Ok(None) };
    let nothing = Geometry::default();
    let mut cameras = choose_views(Some(path), options.split, 0, options.max_width, &nothing)?;
    if let Some(near) = options.near {
        cameras.iter_mut().for_each(|camera| camera.near = near);
    }
    for camera in &cameras {
        camera.validate()?;
    }
    Ok(Some(cameras))
}

/// Returns whether there may be a display. Systems without X11 and Wayland always have one.
fn has_display() -> bool {
    let set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    !cfg!(all(unix, not(target_vendor = "apple")))
        || ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"].into_iter().any(set)
}

/// Returns the number of adapters.
fn adapters(backends: wgpu::Backends) -> usize {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = backends;
    let instance = wgpu::Instance::new(descriptor);
    pollster::block_on(instance.enumerate_adapters(backends)).len()
}

/// Returns the best adapter that can draw on `surface`; software adapters come last. If `chosen` is an index into
/// all adapters, best first, returns that one or nothing.
fn best(
    adapters: &[wgpu::Adapter],
    surface: Option<&wgpu::Surface<'_>>,
    chosen: Option<usize>,
) -> Option<wgpu::Adapter> {
    let mut sorted: Vec<&wgpu::Adapter> = adapters.iter().collect();
    sorted.sort_by_key(|adapter| rank(adapter));
    let fits = |adapter: &&&wgpu::Adapter| surface.is_none_or(|s| adapter.is_surface_supported(s));
    let found = match chosen {
        Some(index) => sorted.get(index).filter(fits),
        None => sorted.iter().find(fits),
    };
    found.map(|adapter| (*adapter).clone())
}
