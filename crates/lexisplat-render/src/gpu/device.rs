//! Finding a GPU, and what it can hold.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};

use crate::error::{Error, Result};

/// What to install or use where no adapter is found.
const NO_ADAPTER: &str = "no GPU adapter was found; install a Vulkan driver and loader (Debian and Ubuntu: mesa-vulkan-drivers and libvulkan1), or draw with the CPU renderer (--device cpu)";

/// An adapter that this machine offers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AdapterSummary {
    /// Its place in the list, best first: what `--device N` takes.
    pub index: usize,
    /// Its name, as the driver says it.
    pub name: String,
    /// Driver and version.
    pub driver: String,
    /// `Vulkan`, `Metal` or `Dx12`.
    pub backend: String,
    /// Whether it is software on the processor, such as lavapipe.
    pub software: bool,
    /// Largest part of a buffer a kernel can see at once, in bytes.
    pub max_binding: u64,
    /// Whether stages can be timed.
    pub timestamps: bool,
}

/// Which adapter to open.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum GpuChoice {
    /// The best one that is not software.
    Hardware,
    /// The best one of any kind.
    #[default]
    Best,
    /// The one at this place in [`adapters`].
    Index(usize),
}

/// An open GPU. Clones share it.
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
    /// Bytes of all buffers and textures alive.
    bytes: Arc<AtomicU64>,
    most_bytes: AtomicU64,
    /// The first error that no scope caught.
    failure: Arc<Mutex<Option<String>>>,
}

/// Drivers that are looked at. Without OpenGL: it lacks what the kernels need, and its loaders print on
/// start.
const BACKENDS: wgpu::Backends =
    wgpu::Backends::VULKAN.union(wgpu::Backends::METAL).union(wgpu::Backends::DX12);

fn instance() -> wgpu::Instance {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = BACKENDS;
    // The arguments of indirect dispatches come from this crate's own kernels, clamped there.
    descriptor.flags.remove(wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL);
    wgpu::Instance::new(descriptor)
}

/// How good an adapter is, best first: discrete, integrated, virtual, other, software.
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

/// All adapters of the machine, best first.
fn sorted_adapters() -> Vec<wgpu::Adapter> {
    let mut found = pollster::block_on(instance().enumerate_adapters(BACKENDS));
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

/// The machine's adapters, best first; none where there is no driver.
#[must_use]
pub fn adapters() -> Vec<AdapterSummary> {
    sorted_adapters().iter().enumerate().map(|(i, adapter)| summarise(i, adapter)).collect()
}

impl Gpu {
    /// Opens an adapter.
    ///
    /// # Errors
    /// [`Error::Gpu`] if there is none or it refuses; [`Error::Parameter`] for an index out of range.
    pub fn open(choice: GpuChoice) -> Result<Self> {
        Self::open_with(choice, |_| {})
    }

    /// [`Self::open`], asking the device for what `reduce` leaves of the limits.
    pub(super) fn open_with(choice: GpuChoice, reduce: impl FnOnce(&mut wgpu::Limits)) -> Result<Self> {
        Self::find_with(choice, reduce)?.ok_or_else(|| Error::Gpu { problem: NO_ADAPTER.to_owned() })
    }

    /// [`Self::open`], or `None` if there is no such adapter.
    ///
    /// # Errors
    /// [`Error::Gpu`] if there is one but it refuses; [`Error::Parameter`] for an index out of range, where
    /// there are any.
    pub fn find(choice: GpuChoice) -> Result<Option<Self>> {
        Self::find_with(choice, |_| {})
    }

    fn find_with(choice: GpuChoice, reduce: impl FnOnce(&mut wgpu::Limits)) -> Result<Option<Self>> {
        let found = sorted_adapters();
        let index = match choice {
            GpuChoice::Index(index) if index < found.len() => Some(index),
            GpuChoice::Index(index) if !found.is_empty() => {
                let expected = format!("an adapter's number, 0 to {}", found.len() - 1);
                return Err(Error::parameter("device", index, expected));
            }
            GpuChoice::Best | GpuChoice::Index(_) => (!found.is_empty()).then_some(0),
            GpuChoice::Hardware => {
                found.iter().position(|adapter| adapter.get_info().device_type != wgpu::DeviceType::Cpu)
            }
        };
        let Some((index, adapter)) = index.and_then(|index| Some((index, found.get(index)?))) else {
            return Ok(None);
        };
        let mut descriptor = Self::descriptor(adapter);
        reduce(&mut descriptor.required_limits);
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|error| Error::Gpu { problem: format!("{}: {error}", adapter.get_info().name) })?;
        Ok(Some(Self::new(summarise(index, adapter), device, queue)))
    }

    /// What this renderer asks of a device that is made elsewhere, such as by a window.
    ///
    /// Limits are WebGPU's defaults, which every adapter has, but for sizes: those are the adapter's own.
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

    /// A GPU on a device made with [`Self::descriptor`].
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
        let shared = Shared {
            device,
            queue,
            summary,
            limits,
            bytes: Arc::default(),
            most_bytes: AtomicU64::new(0),
            failure,
        };
        Self { shared: Arc::new(shared) }
    }

    /// Whether `other` is a clone of this. Devices of two instances can compare as equal.
    pub(super) fn is(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.shared, &other.shared)
    }

    /// What was opened.
    #[must_use]
    pub fn summary(&self) -> &AdapterSummary {
        &self.shared.summary
    }

    /// Bytes of all buffers and textures alive that this renderer made.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.shared.bytes.load(Relaxed)
    }

    /// The most [`Self::bytes`] has been.
    #[must_use]
    pub fn most_bytes(&self) -> u64 {
        self.shared.most_bytes.load(Relaxed)
    }

    /// The device.
    #[must_use]
    pub fn device(&self) -> &wgpu::Device {
        &self.shared.device
    }

    /// The queue.
    #[must_use]
    pub fn queue(&self) -> &wgpu::Queue {
        &self.shared.queue
    }

    pub(super) fn limits(&self) -> &wgpu::Limits {
        &self.shared.limits
    }

    /// Largest part of a buffer that a kernel can see, in bytes.
    pub(super) fn max_binding(&self) -> u64 {
        self.shared.limits.max_storage_buffer_binding_size.min(self.shared.limits.max_buffer_size)
    }

    /// A counted buffer.
    pub(super) fn buffer(&self, label: &str, size: u64, usage: wgpu::BufferUsages) -> Result<Buffer> {
        // Empty bindings are refused, and sizes of copies are in words.
        let size = size.next_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT).max(MIN_BUFFER);
        let limit = self.shared.limits.max_buffer_size;
        if size > limit {
            return Err(Error::GpuLimit { what: format!("bytes of GPU buffer {label}"), found: size, limit });
        }
        let raw = self.checked(label, || {
            let descriptor =
                wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
            self.shared.device.create_buffer(&descriptor)
        })?;
        Ok(Buffer { raw, bytes: self.count(size) })
    }

    /// A counted buffer that kernels read and write, and that can be copied from and to.
    pub(super) fn storage(&self, label: &str, size: u64) -> Result<Buffer> {
        use wgpu::BufferUsages as U;
        self.buffer(label, size, U::STORAGE | U::COPY_DST | U::COPY_SRC)
    }

    /// A counted buffer with `words` in it, for kernels to read.
    pub(super) fn upload<T: bytemuck::Pod>(&self, label: &str, words: &[T]) -> Result<Buffer> {
        let bytes: &[u8] = bytemuck::cast_slice(words);
        let buffer = self.storage(label, bytes.len() as u64)?;
        self.write(&buffer, bytes);
        Ok(buffer)
    }

    /// A small counted buffer of uniforms.
    pub(super) fn uniform<T: bytemuck::Pod>(&self, label: &str, value: &T) -> Result<Buffer> {
        use wgpu::BufferUsages as U;
        let buffer = self.buffer(label, size_of::<T>() as u64, U::UNIFORM | U::COPY_DST)?;
        self.write(&buffer, bytemuck::bytes_of(value));
        Ok(buffer)
    }

    /// Copies `bytes`, of whole words, to the start of `buffer`, in pieces so that the staging copies do
    /// not pile up.
    pub(super) fn write(&self, buffer: &Buffer, bytes: &[u8]) {
        for (piece, at) in bytes.chunks(UPLOAD_PIECE).zip((0_u64..).step_by(UPLOAD_PIECE)) {
            self.shared.queue.write_buffer(&buffer.raw, at, piece);
            if bytes.len() > UPLOAD_PIECE {
                self.shared.queue.submit([]);
                let _ = self.shared.device.poll(wgpu::PollType::wait_indefinitely());
            }
        }
    }

    /// Adds `size` to the bytes alive until what is returned is dropped.
    pub(super) fn count(&self, size: u64) -> Counted {
        let now = self.shared.bytes.fetch_add(size, Relaxed) + size;
        self.shared.most_bytes.fetch_max(now, Relaxed);
        Counted { size, total: Arc::clone(&self.shared.bytes) }
    }

    /// Runs `make`; what the device has against it is an error about `what`.
    pub(super) fn checked<T>(&self, what: &str, make: impl FnOnce() -> T) -> Result<T> {
        let validation = self.shared.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let memory = self.shared.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let made = make();
        let memory = pollster::block_on(memory.pop());
        let validation = pollster::block_on(validation.pop());
        match memory.or(validation) {
            None => Ok(made),
            Some(error) => Err(Error::Gpu { problem: format!("{}: {what}: {error}", self.summary().name) }),
        }
    }

    /// Waits until all work is done.
    ///
    /// # Errors
    /// [`Error::Gpu`] if the device was lost or some work was refused.
    pub fn wait(&self) -> Result<()> {
        let waited = self.shared.device.poll(wgpu::PollType::wait_indefinitely());
        let failure = self.shared.failure.lock().unwrap_or_else(PoisonError::into_inner).take();
        match (failure, waited) {
            (Some(problem), _) => Err(Error::Gpu { problem: format!("{}: {problem}", self.summary().name) }),
            (None, Err(error)) => Err(Error::Gpu { problem: format!("{}: {error}", self.summary().name) }),
            (None, Ok(_)) => Ok(()),
        }
    }

    /// All of a buffer made by [`Self::storage`].
    #[cfg(test)]
    pub(super) fn read_back<T: bytemuck::Pod>(&self, buffer: &Buffer) -> Vec<T> {
        use wgpu::BufferUsages as U;
        let size = buffer.bytes();
        let back = self.buffer("back", size, U::MAP_READ | U::COPY_DST).unwrap();
        let mut encoder = self.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(&buffer.raw, 0, &back.raw, 0, size);
        self.queue().submit([encoder.finish()]);
        self.read(&back, size).unwrap()
    }

    /// The first `size` bytes of `buffer`, which must be `MAP_READ`.
    pub(super) fn read<T: bytemuck::Pod>(&self, buffer: &Buffer, size: u64) -> Result<Vec<T>> {
        if size == 0 {
            return Ok(Vec::new());
        }
        let slice = buffer.raw.slice(..size);
        slice.map_async(wgpu::MapMode::Read, |_| {});
        self.wait()?;
        let refused = |error: &dyn std::fmt::Display| Error::Gpu {
            problem: format!("{}: reading back: {error}", self.summary().name),
        };
        let view = slice.get_mapped_range().map_err(|error| refused(&error))?;
        let words = bytemuck::pod_collect_to_vec(&view);
        drop(view);
        buffer.raw.unmap();
        Ok(words)
    }
}

/// Least size of a buffer in bytes: that of the largest type in a binding.
const MIN_BUFFER: u64 = 256;
/// Bytes uploaded at once.
const UPLOAD_PIECE: usize = 32 << 20;

/// A buffer that counts while it lives.
#[derive(Debug)]
pub(super) struct Buffer {
    pub(super) raw: wgpu::Buffer,
    bytes: Counted,
}

impl Buffer {
    pub(super) fn bytes(&self) -> u64 {
        self.bytes.size
    }
}

/// Bytes alive on the GPU.
#[derive(Debug)]
pub(super) struct Counted {
    size: u64,
    total: Arc<AtomicU64>,
}

impl Counted {
    pub(super) fn size(&self) -> u64 {
        self.size
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        self.total.fetch_sub(self.size, Relaxed);
    }
}
