//! Opens renderers and GPUs, and suppresses the noise of GPU drivers.
//!
//! Mesa's Vulkan layer `VK_LAYER_MESA_device_select` connects to a Wayland display whenever an instance has the extension
//! `VK_KHR_wayland_surface` and its adapters are listed. wgpu 30 enables this extension wherever it exists, and has no
//! option against it. If `XDG_RUNTIME_DIR` is not set, as on machines without a desktop, libwayland then prints an error
//! to standard error, although no window was asked for. The functions of this module suppress this line, and only this
//! line.

use lexisplat_render::gpu::{self, AdapterSummary, Gpu};
use lexisplat_render::{Device, Renderer, Result};

/// Returns all adapters of the machine, best first.
pub(crate) fn adapters() -> Vec<AdapterSummary> {
    quietly(gpu::adapters)
}

/// Opens the renderer for `device`.
pub(crate) fn open_renderer(device: Device) -> Result<Renderer> {
    match device {
        Device::Cpu => Renderer::open(device),
        _ => quietly(|| Renderer::open(device)),
    }
}

/// Opens the GPU of `device`; `None` if `device` is the processor.
pub(crate) fn open_gpu(device: Device) -> Result<Option<Gpu>> {
    match device {
        Device::Cpu => Ok(None),
        _ => quietly(|| device.open_gpu()),
    }
}

/// Runs `open`, which lists adapters.
#[cfg(not(unix))]
fn quietly<T>(open: impl FnOnce() -> T) -> T {
    open()
}

/// Runs `open`, which lists adapters, without libwayland's line.
#[cfg(unix)]
fn quietly<T>(open: impl FnOnce() -> T) -> T {
    let is_absolute = |folder: std::ffi::OsString| std::path::Path::new(&folder).is_absolute();
    // With an absolute path libwayland prints nothing. If there is no file to divert standard error to, the line is
    // printed.
    let needed = !std::env::var_os("XDG_RUNTIME_DIR").is_some_and(is_absolute);
    let _diverted = needed.then(diverted::Stderr::divert).and_then(std::result::Result::ok);
    open()
}

#[cfg(unix)]
mod diverted {
    use std::fs::File;
    use std::io::{BufRead, BufReader, Seek, Write};
    use std::os::fd::OwnedFd;

    /// Beginning of libwayland's line.
    const NOISE: &[u8] = b"error: XDG_RUNTIME_DIR is invalid or not set";

    /// Standard error, which is diverted to a file until this value is dropped.
    pub(super) struct Stderr {
        terminal: OwnedFd,
        file: File,
    }

    impl Stderr {
        pub(super) fn divert() -> std::io::Result<Self> {
            let terminal = rustix::io::fcntl_dupfd_cloexec(std::io::stderr(), 0)?;
            let file = tempfile::tempfile()?;
            rustix::stdio::dup2_stderr(&file)?;
            Ok(Self { terminal, file })
        }
    }

    impl Drop for Stderr {
        /// Restores standard error, and prints the contents of the file without the noise.
        fn drop(&mut self) {
            let restored = rustix::stdio::dup2_stderr(&self.terminal);
            if restored.is_err() || self.file.rewind().is_err() {
                return;
            }
            let lines = BufReader::new(&self.file).split(b'\n').map_while(Result::ok);
            for line in lines.filter(|line| !line.starts_with(NOISE)) {
                let _ = std::io::stderr().write_all(&[&line[..], b"\n"].concat());
            }
        }
    }
}
