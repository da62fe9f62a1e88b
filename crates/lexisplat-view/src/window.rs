//! Opens the window.

use std::sync::Arc;
use std::sync::mpsc::channel;

use eframe::{egui, egui_wgpu};
use lexisplat_render::Device;
use lexisplat_render::gpu::{Gpu, rank};

use winit::event_loop::EventLoop;

use crate::Options;
use crate::app::App;
use crate::error::{Error, Result};
use crate::given_cameras::GivenCameras;
use crate::script;

/// Initial size of the window, in points.
const SIZE: [f32; 2] = [1280.0, 800.0];
/// Smallest size of the window, in points.
const LEAST_SIZE: [f32; 2] = [640.0, 400.0];
/// Graphics interfaces with the precision that the renderer's kernels need. OpenGL lacks this precision.
const BACKENDS: wgpu::Backends = wgpu::Backends::PRIMARY;

/// Opens the window and returns when it is closed.
///
/// If no adapter can run the renderer's kernels, the processor draws, and OpenGL shows its pictures. OpenGL also exists
/// without a GPU, in software.
///
/// # Errors
/// [`Error::NoDisplay`] and [`Error::NoAdapter`] if there is no display or nothing that shows pictures on it; errors of
/// reading the files named in `options`; and while a script runs, every other error.
pub fn run(mut options: Options) -> Result<()> {
    let script = script::parse(&options.script)?;
    let file = options.cameras.as_ref();
    let given = file.map(|file| GivenCameras::read(file, options.split, options.max_width, options.near));
    let given = given.transpose()?;
    if !has_display() {
        return Err(Error::NoDisplay);
    }
    let asked = wgpu::Backends::from_env();
    let backends = asked.unwrap_or(BACKENDS);
    let count = adapters(backends);
    let by_opengl = count == 0;
    if by_opengl {
        if asked.is_some() || matches!(options.device, Device::Gpu | Device::Index(_)) {
            return Err(Error::NoAdapter);
        }
        options.device = Device::Cpu;
    }
    let chosen = match options.device {
        Device::Index(index) if index >= count => {
            let expected = format!("auto, cpu, gpu, or 0 to {}", count - 1);
            return Err(lexisplat::Error::parameter("device", index, expected).into());
        }
        Device::Index(index) => Some(index),
        _ => None,
    };
    // OpenGL needs to know the display before a window exists.
    let opened = by_opengl.then(|| EventLoop::<eframe::UserEvent>::with_user_event().build()).transpose();
    let event_loop = opened.map_err(|error| Error::Window(error.to_string()))?;
    let mut setup = match &event_loop {
        Some(event_loop) => {
            egui_wgpu::WgpuSetupCreateNew::from_display_handle(event_loop.owned_display_handle())
        }
        None => egui_wgpu::WgpuSetupCreateNew::without_display_handle(),
    };
    setup.instance_descriptor.backends = if by_opengl { wgpu::Backends::GL } else { backends };
    // The renderer's kernels compute the arguments of indirect dispatches and clamp them, so they need no validation.
    setup.instance_descriptor.flags.remove(wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL);
    setup.native_adapter_selector = Some(Arc::new(move |adapters, surface| {
        best(adapters, surface, chosen)
            .ok_or_else(|| "none of the adapters can draw on this display".to_owned())
    }));
    setup.device_descriptor = if by_opengl { Arc::new(plain) } else { Arc::new(Gpu::descriptor) };
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
    let creator: eframe::AppCreator<'static> = Box::new(move |creation| {
        creation.egui_ctx.set_theme(egui::Theme::Dark);
        Ok(Box::new(App::new(creation, options, given, script, failures)?))
    });
    let ran = match event_loop {
        None => eframe::run_native("lexisplat", native, creator).map_err(|error| error.to_string()),
        Some(event_loop) => {
            let mut app = eframe::create_native("lexisplat", native, creator, &event_loop);
            event_loop.run_app(&mut app).map_err(|error| error.to_string())
        }
    };
    match (failed.try_recv(), ran) {
        (Ok(error), _) => Err(error),
        (_, Ok(())) => Ok(()),
        (_, Err(_)) if by_opengl => Err(Error::NoAdapter),
        (_, Err(error)) => Err(Error::Window(error)),
    }
}

/// Returns the descriptor of a device that only shows pictures.
fn plain(adapter: &wgpu::Adapter) -> wgpu::DeviceDescriptor<'static> {
    wgpu::DeviceDescriptor { required_limits: adapter.limits(), ..wgpu::DeviceDescriptor::default() }
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

/// Returns the best adapter that can draw on `surface`. Software adapters come last. If `chosen` is an index into all
/// adapters, best first, returns only that adapter, or `None`.
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
