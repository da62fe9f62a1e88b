//! Finds a GPU and its limits.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};

use crate::error::{Error, Result};
use crate::renderer::Device;
use crate::wait::answer;

use super::counted::Counted;
use crate::gpu_report::AdapterSummary;

/// Advice for a machine without an adapter.
const NO_ADAPTER: &str = "no GPU adapter was found; install a Vulkan driver and loader (Debian and Ubuntu: mesa-vulkan-drivers and libvulkan1), or draw with the CPU renderer";

/// An open GPU. Clones share the device.
#[derive(Debug, Clone)]
pub struct Gpu {
    shared: Arc<Shared>,
}

#[derive(Debug)]
struct Shared {
    device: wgpu::Device,
    queue: wgpu::Queue,
    summary: AdapterSummary,
    limits: wgpu::Limits,
    /// Bytes of all existing buffers and textures.
    bytes: Arc<AtomicU64>,
    most_bytes: AtomicU64,
    /// First error that no scope caught.
    failure: Arc<Mutex<Option<String>>>,
}

/// Backends that are searched. OpenGL is not among them: it lacks features that the kernels need, and its loaders print
/// messages on start.
const BACKENDS: wgpu::Backends = wgpu::Backends::PRIMARY;

fn instance() -> wgpu::Instance {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = BACKENDS;
    // The arguments of indirect dispatches come from this crate's own kernels, which clamp them. They need no validation.
    descriptor.flags.remove(wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL);
    wgpu::Instance::new(descriptor)
}

/// Returns the rank of an adapter, 0 for the best: discrete, integrated, virtual, other, software.
#[must_use]
pub fn rank(adapter: &wgpu::Adapter) -> u8 {
    match adapter.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

/// Returns all adapters of the machine, best first.
async fn sorted_adapters() -> Vec<wgpu::Adapter> {
    let mut found = instance().enumerate_adapters(BACKENDS).await;
    found.sort_by_key(rank);
    found
}

fn summarise(index: usize, adapter: &wgpu::Adapter) -> AdapterSummary {
    let info = adapter.get_info();
    AdapterSummary {
        index,
        name: info.name,
        driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
        backend: format!("{:?}", info.backend),
        software: info.device_type == wgpu::DeviceType::Cpu,
        max_binding: adapter.limits().max_storage_buffer_binding_size,
        timestamps: adapter.features().contains(wgpu::Features::TIMESTAMP_QUERY),
    }
}

/// Returns the adapters of the machine, best first. The list is empty if there is no driver.
pub async fn adapters_async() -> Vec<AdapterSummary> {
    sorted_adapters().await.iter().enumerate().map(|(i, adapter)| summarise(i, adapter)).collect()
}

/// Blocks on [`adapters_async`].
#[cfg(not(target_family = "wasm"))]
#[must_use]
pub fn adapters() -> Vec<AdapterSummary> {
    pollster::block_on(adapters_async())
}

impl Device {
    /// Opens the GPU that this device names; `None` if it names the processor.
    ///
    /// # Errors
    /// As [`Renderer::open_async`](crate::Renderer::open_async).
    pub async fn open_gpu_async(self) -> Result<Option<Gpu>> {
        self.open_gpu_with(|_| {}).await
    }

    /// Blocks on [`Self::open_gpu_async`].
    ///
    /// # Errors
    /// As [`Self::open_gpu_async`].
    #[cfg(not(target_family = "wasm"))]
    pub fn open_gpu(self) -> Result<Option<Gpu>> {
        pollster::block_on(self.open_gpu_async())
    }

    /// Opens the GPU like [`Self::open_gpu_async`], with limits that `reduce` lowers.
    pub(super) async fn open_gpu_with(self, reduce: impl FnOnce(&mut wgpu::Limits)) -> Result<Option<Gpu>> {
        if self == Self::Cpu {
            return Ok(None);
        }
        let found = sorted_adapters().await;
        let index = match self {
            Self::Index(index) => index,
            _ => 0,
        };
        let Some(adapter) = found.get(index) else {
            return match self {
                Self::Auto => Ok(None),
                Self::Index(_) if !found.is_empty() => {
                    let expected = format!("an adapter's number, 0 to {}", found.len() - 1);
                    Err(Error::parameter("device", index, expected))
                }
                _ => Err(Error::Gpu { problem: NO_ADAPTER.to_owned() }),
            };
        };
        // Software comes last in the list.
        if self == Self::Auto && adapter.get_info().device_type == wgpu::DeviceType::Cpu {
            return Ok(None);
        }
        let mut descriptor = Gpu::descriptor(adapter);
        reduce(&mut descriptor.required_limits);
        let opened = adapter.request_device(&descriptor).await;
        let (device, queue) = opened
            .map_err(|error| Error::Gpu { problem: format!("{}: {error}", adapter.get_info().name) })?;
        Ok(Some(Gpu::new(summarise(index, adapter), device, queue)))
    }
}

impl Gpu {
    /// Returns the descriptor for a device that is made elsewhere, such as by a window.
    ///
    /// Its limits are WebGPU's defaults, which every adapter has. Sizes have the limits of the adapter.
    #[must_use]
    pub fn descriptor(adapter: &wgpu::Adapter) -> wgpu::DeviceDescriptor<'static> {
        let most = adapter.limits();
        wgpu::DeviceDescriptor {
            label: Some("lexisplat"),
            required_features: adapter.features() & wgpu::Features::TIMESTAMP_QUERY,
            required_limits: wgpu::Limits {
                max_storage_buffer_binding_size: most.max_storage_buffer_binding_size,
                max_buffer_size: most.max_buffer_size,
                max_compute_workgroup_storage_size: most.max_compute_workgroup_storage_size,
                max_texture_dimension_2d: most.max_texture_dimension_2d,
                max_texture_array_layers: most.max_texture_array_layers,
                ..wgpu::Limits::default()
            },
            memory_hints: wgpu::MemoryHints::MemoryUsage,
            ..wgpu::DeviceDescriptor::default()
        }
    }

    /// Wraps a device that was made with [`Self::descriptor`].
    #[must_use]
    pub fn from_device(adapter: &wgpu::Adapter, device: wgpu::Device, queue: wgpu::Queue) -> Self {
        Self::new(summarise(0, adapter), device, queue)
    }

    fn new(summary: AdapterSummary, device: wgpu::Device, queue: wgpu::Queue) -> Self {
        let failure = Arc::new(Mutex::new(None));
        let slot = Arc::clone(&failure);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            slot.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_with(|| error.to_string());
        }));
        let limits = device.limits();
        let (bytes, most_bytes) = (Arc::default(), AtomicU64::new(0));
        Self { shared: Arc::new(Shared { device, queue, summary, limits, bytes, most_bytes, failure }) }
    }

    /// Returns whether `other` is a clone of this GPU. Devices of two instances can compare as equal, so they are not
    /// compared.
    pub(super) fn is(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.shared, &other.shared)
    }

    /// Returns the summary of the adapter that was opened.
    #[must_use]
    pub fn summary(&self) -> &AdapterSummary {
        &self.shared.summary
    }

    /// Returns the bytes of all existing buffers and textures that this crate made on this GPU.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.shared.bytes.load(Relaxed)
    }

    /// Returns the largest value that [`Self::bytes`] has had.
    #[must_use]
    pub fn most_bytes(&self) -> u64 {
        self.shared.most_bytes.load(Relaxed)
    }

    /// Returns the device.
    #[must_use]
    pub fn device(&self) -> &wgpu::Device {
        &self.shared.device
    }

    /// Returns the queue.
    #[must_use]
    pub fn queue(&self) -> &wgpu::Queue {
        &self.shared.queue
    }

    pub(super) fn limits(&self) -> &wgpu::Limits {
        &self.shared.limits
    }

    /// Returns the size of the largest part of a buffer that a kernel can see, in bytes.
    pub(super) fn max_binding(&self) -> u64 {
        self.shared.limits.max_storage_buffer_binding_size.min(self.shared.limits.max_buffer_size)
    }

    /// Adds `size` to the bytes of existing buffers until the result is dropped.
    pub(super) fn count(&self, size: u64) -> Counted {
        let counted = Counted::new(size, &self.shared.bytes);
        self.shared.most_bytes.fetch_max(self.bytes(), Relaxed);
        counted
    }

    /// Runs `make`, which must not submit work. If the device refuses one of its calls, returns an error about `what`.
    pub(super) async fn checked<T>(&self, what: &str, make: impl FnOnce() -> Result<T>) -> Result<T> {
        let validation = self.device().push_error_scope(wgpu::ErrorFilter::Validation);
        let memory = self.device().push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let made = make();
        // Error scopes belong to the thread, so both are closed before anything is awaited.
        let (memory, validation) = (memory.pop(), validation.pop());
        let (memory, validation) = (memory.await, validation.await);
        match memory.or(validation) {
            None => made,
            Some(error) => Err(self.failed(format!("{what}: {error}"))),
        }
    }

    /// Waits until all submitted work is done. Outside of a browser something must poll the device meanwhile, as
    /// [`Self::wait`] does.
    ///
    /// # Errors
    /// [`Error::Gpu`] if some work was refused.
    pub async fn wait_async(&self) -> Result<()> {
        let (give, done) = answer();
        self.queue().on_submitted_work_done(move || give(()));
        done.await;
        self.take_failure()
    }

    /// Blocks until all submitted work is done.
    ///
    /// # Errors
    /// [`Error::Gpu`] if the device was lost or some work was refused.
    #[cfg(not(target_family = "wasm"))]
    pub fn wait(&self) -> Result<()> {
        self.block_on(self.wait_async())
    }

    /// Runs `future` to its end on this thread, and waits for this GPU whenever the future does.
    #[cfg(not(target_family = "wasm"))]
    pub(crate) fn block_on<T>(&self, future: impl Future<Output = Result<T>>) -> Result<T> {
        crate::wait::block_on(|| self.poll(), future)
    }

    /// Waits until the device has done all its work and called the callbacks.
    #[cfg(not(target_family = "wasm"))]
    pub(crate) fn poll(&self) -> Result<()> {
        super::readback::poll(self.device())
    }

    /// Returns the first error that no scope caught, and forgets it.
    pub(super) fn take_failure(&self) -> Result<()> {
        let failure = self.shared.failure.lock().unwrap_or_else(PoisonError::into_inner).take();
        failure.map_or(Ok(()), |problem| Err(self.failed(problem)))
    }

    fn failed(&self, problem: String) -> Error {
        Error::Gpu { problem: format!("{}: {problem}", self.summary().name) }
    }
}
