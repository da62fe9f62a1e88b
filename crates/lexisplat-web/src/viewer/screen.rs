//! The canvas, and the GPU that draws on it.

use lexisplat_render::gpu::{Gpu, GpuRenderer, GpuScene, SceneBytes, SceneForm, ScenePart};
use lexisplat_view::{Composer, Composition, Picture, Presenter, Rgb8Image, Slot};
use wasm_bindgen::JsValue;
use web_sys::HtmlCanvasElement;
use wgpu::CurrentSurfaceTexture;

use super::view::{Drawn, View};

/// Result with an error in words for people.
type Result<T> = std::result::Result<T, String>;

/// Number of channels of a pixel.
const CHANNELS: f64 = 3.0;

/// The canvas, the device, and the scenes on it.
pub(super) struct Screen {
    surface: wgpu::Surface<'static>,
    configuration: wgpu::SurfaceConfiguration,
    gpu: Gpu,
    renderer: GpuRenderer,
    presenter: Presenter,
    composer: Option<Composer>,
    scenes: [Option<GpuScene>; 2],
}

impl Screen {
    pub(super) async fn open(canvas: HtmlCanvasElement) -> Result<Self> {
        let (width, height) = (canvas.width().max(1), canvas.height().max(1));
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = wgpu::Backends::BROWSER_WEBGPU;
        let instance = wgpu::Instance::new(descriptor);
        let surface =
            instance.create_surface(wgpu::SurfaceTarget::Canvas(canvas)).map_err(|e| e.to_string())?;
        let adapter = instance
            .request_adapter(&wgpu::RequestAdapterOptions {
                power_preference: wgpu::PowerPreference::HighPerformance,
                compatible_surface: Some(&surface),
                ..wgpu::RequestAdapterOptions::default()
            })
            .await
            .map_err(|_| "this browser has WebGPU, but no graphics adapter for it".to_owned())?;
        let opened = adapter.request_device(&Gpu::descriptor(&adapter)).await;
        let (device, queue) = opened.map_err(|e| e.to_string())?;
        let gpu = Gpu::from_device(&adapter, device, queue);
        let capabilities = surface.get_capabilities(&adapter);
        // The pictures are sRGB already.
        let format =
            capabilities.formats.iter().find(|format| !format.is_srgb()).or(capabilities.formats.first());
        let format = *format.ok_or_else(|| "the canvas has no format that can be drawn to".to_owned())?;
        let configuration = surface
            .get_default_config(&adapter, width, height)
            .map(|configuration| wgpu::SurfaceConfiguration { format, ..configuration })
            .ok_or_else(|| "the adapter cannot draw to the canvas".to_owned())?;
        surface.configure(gpu.device(), &configuration);
        let renderer = GpuRenderer::new_async(&gpu).await.map_err(|e| e.to_string())?;
        let presenter = Presenter::new(gpu.device().clone(), format);
        Ok(Self { surface, configuration, gpu, renderer, presenter, composer: None, scenes: [None, None] })
    }

    pub(super) fn resize(&mut self, (width, height): (u32, u32)) {
        (self.configuration.width, self.configuration.height) = (width, height);
        self.surface.configure(self.gpu.device(), &self.configuration);
    }

    /// Begins a scene in `slot`. The old scene is freed first, because there may be no memory for both.
    pub(super) async fn begin(&mut self, slot: Slot, form: &SceneForm) -> Result<()> {
        self.remove(slot);
        let scene = GpuScene::of_parts_async(&self.gpu, form).await.map_err(|e| e.to_string())?;
        self.scenes[slot.index()] = Some(scene);
        Ok(())
    }

    pub(super) async fn put(&mut self, slot: Slot, index: usize, part: &ScenePart<'_>) -> Result<()> {
        match &mut self.scenes[slot.index()] {
            Some(scene) => scene.put_async(index, part).await.map_err(|e| e.to_string()),
            None => Err("a part of a scene without its form".to_owned()),
        }
    }

    pub(super) fn remove_part(&mut self, slot: Slot, index: usize) {
        if let Some(scene) = &mut self.scenes[slot.index()] {
            scene.remove(index);
        }
    }

    pub(super) fn remove(&mut self, slot: Slot) {
        self.scenes[slot.index()] = None;
    }

    /// Draws and shows `view`. Reuses the pictures of `before` if they are those of `view`.
    pub(super) async fn draw(&mut self, view: View, before: Option<Drawn>) -> Result<Drawn> {
        let drawn = match before.filter(|before| before.has_pictures_of(&view)) {
            Some(before) => before.arranged(view),
            None => self.pictures(view).await?,
        };
        self.show(&drawn)?;
        Ok(drawn)
    }

    async fn pictures(&mut self, view: View) -> Result<Drawn> {
        let clock = web_time::Instant::now();
        let camera = view.scaled_camera();
        let (mut pictures, mut visible) = ([None, None], [None; 2]);
        for slot in Slot::BOTH.map(Slot::index) {
            let Some(scene) = self.scenes[slot].as_ref().filter(|_| view.wanted[slot]) else { continue };
            let frame =
                self.renderer.draw_async(scene, &camera, &view.options).await.map_err(|e| e.to_string())?;
            let (device, queue) = (self.gpu.device(), self.gpu.queue());
            pictures[slot] = Some(Picture::copied(device, queue, &frame.pixels, frame.width, frame.height));
            visible[slot] = Some(frame.stats.visible);
        }
        let milliseconds = clock.elapsed().as_secs_f64() * 1e3;
        let (mut psnr, mut identical) = (None, false);
        if let [Some(first), Some(second)] = &pictures {
            let pixels = first.width * first.height;
            let compared = self.renderer.squared_error_async(&first.pixels, &second.pixels, pixels).await;
            let mean = compared.map_err(|e| e.to_string())? / (CHANNELS * f64::from(pixels));
            identical = mean == 0.0;
            psnr = (mean > 0.0).then(|| -10.0 * mean.log10());
        }
        Ok(Drawn { view, pictures, visible, milliseconds, psnr, identical })
    }

    fn show(&self, drawn: &Drawn) -> Result<()> {
        let composition = composition(drawn);
        let Some(bound) = self.presenter.bind(&composition) else { return Ok(()) };
        let texture = match self.surface.get_current_texture() {
            CurrentSurfaceTexture::Success(texture) | CurrentSurfaceTexture::Suboptimal(texture) => texture,
            // The canvas is not visible, or will be drawn again when it has its size.
            CurrentSurfaceTexture::Timeout
            | CurrentSurfaceTexture::Occluded
            | CurrentSurfaceTexture::Outdated => {
                return Ok(());
            }
            _ => return Err("the canvas was lost".to_owned()),
        };
        let target = texture.texture.create_view(&wgpu::TextureViewDescriptor::default());
        let mut encoder =
            self.gpu.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let [r, g, b] = drawn.view.options.background.map(f64::from);
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("show"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &target,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a: 1.0 }),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                ..wgpu::RenderPassDescriptor::default()
            });
            let size = (self.configuration.width, self.configuration.height);
            let [x, y, width, height] = drawn.view.place(size);
            pass.set_viewport(x, y, width, height, 0.0, 1.0);
            self.presenter.draw(&mut pass, &bound);
        }
        self.gpu.queue().submit([encoder.finish()]);
        self.gpu.queue().present(texture);
        Ok(())
    }

    /// Returns the picture shown, in memory.
    pub(super) async fn picture(&mut self, drawn: &Drawn) -> Result<Rgb8Image> {
        let gpu = &self.gpu;
        let composer =
            self.composer.get_or_insert_with(|| Composer::new(gpu.device().clone(), gpu.queue().clone()));
        composer.compose_async(&composition(drawn)).await.map_err(|e| e.to_string())
    }

    /// Returns the `GPUDevice` of the browser.
    pub(super) fn device(&self) -> Option<&JsValue> {
        self.gpu.device().as_webgpu().map(AsRef::as_ref)
    }

    pub(super) fn device_name(&self) -> &str {
        &self.gpu.summary().name
    }

    /// Returns the number of bytes of the scenes and of the buffers for drawing.
    pub(super) fn resident_bytes(&self) -> u64 {
        self.gpu.bytes()
    }

    /// Returns the largest value that this number has had.
    pub(super) fn most_bytes(&self) -> u64 {
        self.gpu.most_bytes()
    }

    pub(super) fn scene_bytes(&self) -> [Option<SceneBytes>; 2] {
        self.scenes.each_ref().map(|scene| scene.as_ref().map(GpuScene::bytes))
    }

    pub(super) fn gaussians(&self) -> [Option<u32>; 2] {
        self.scenes.each_ref().map(|scene| scene.as_ref().map(GpuScene::len))
    }
}

fn composition(drawn: &Drawn) -> Composition {
    Composition { arrangement: drawn.view.arrangement, pictures: drawn.pictures.clone() }
}
