//! Opening the window, and saying why it cannot be opened.

use std::sync::{Arc, Mutex, PoisonError};

use eframe::{egui, egui_wgpu};
use lexisplat::Geometry;
use lexisplat_eval::choose_views;
use lexisplat_render::gpu::{Gpu, rank};
use lexisplat_render::{Camera, Device};

use crate::Options;
use crate::app::App;
use crate::error::{Error, Result};
use crate::script;

/// Size of the window to begin with and at least, in points.
const SIZE: [f32; 2] = [1280.0, 800.0];
const LEAST_SIZE: [f32; 2] = [640.0, 400.0];
/// Drivers that draw with all the precision pictures need.
const BACKENDS: wgpu::Backends = wgpu::Backends::PRIMARY;

/// Opens the window and returns when it is closed.
///
/// # Errors
/// [`Error::NoDisplay`] and [`Error::NoAdapter`] where there is nothing to open a window on or to draw it
/// with; what reading the files named in `options` says, and while a script runs anything else that goes
/// wrong.
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
    // The arguments of indirect dispatches come from the renderer's own kernels, clamped there.
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
    let outcome = Arc::new(Mutex::new(None));
    let result = Arc::clone(&outcome);
    let ran = eframe::run_native(
        "lexisplat",
        native,
        Box::new(move |creation| {
            creation.egui_ctx.set_theme(egui::Theme::Dark);
            Ok(Box::new(App::new(creation, options, given, script, outcome)?))
        }),
    );
    let failure = result.lock().unwrap_or_else(PoisonError::into_inner).take();
    match (failure, ran) {
        (Some(error), _) => Err(error),
        (None, Ok(())) => Ok(()),
        (None, Err(error)) => Err(Error::Window(error.to_string())),
    }
}

/// The cameras of the file named in `options`.
fn given_cameras(options: &Options) -> Result<Option<Vec<Camera>>> {
    let Some(path) = &options.cameras else { return Ok(None) };
    let nothing = Geometry::default();
    let cameras = choose_views(Some(path), options.split, 0, options.max_width, &nothing)?;
    for camera in &cameras {
        camera.validate()?;
    }
    Ok(Some(cameras))
}

/// Whether there may be a display. Elsewhere than on free desktops there always is.
fn has_display() -> bool {
    let set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    !cfg!(all(unix, not(target_vendor = "apple")))
        || ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"].into_iter().any(set)
}

/// How many adapters there are.
fn adapters(backends: wgpu::Backends) -> usize {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = backends;
    let instance = wgpu::Instance::new(descriptor);
    pollster::block_on(instance.enumerate_adapters(backends)).len()
}

/// The best adapter that can draw on `surface`: a real one if there is any. Or the one chosen by its place
/// among all, best first.
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
