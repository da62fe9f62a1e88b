//! `lexisplat devices`.

use anyhow::Result;
use lexisplat::simd::Simd;
use lexisplat_eval::format;
use lexisplat_render::gpu::AdapterSummary;
use serde_json::json;

use crate::args::Common;
use crate::device::adapters;
use crate::files::{print, print_json};

pub(crate) fn run(common: &Common) -> Result<()> {
    let found = adapters();
    let simd = Simd::current().name();
    if common.json {
        let available: Vec<_> = Simd::available().into_iter().map(Simd::name).collect();
        let processor = json!({ "simd": simd, "available": available });
        return print_json(&json!({ "devices": found, "processor": processor }));
    }
    if !cfg!(feature = "gpu") {
        return print(&format!("cpu  the CPU ({simd}); this program was built without drawing on GPUs\n"));
    }
    if found.is_empty() {
        return print(&format!(
            "no GPU was found: everything is drawn on the CPU (cpu, {simd})\n\
             A GPU needs a Vulkan, Metal or DX12 driver. On Debian and Ubuntu the packages mesa-vulkan-drivers\n\
             and libvulkan1 have drivers for many GPUs, and one that emulates a GPU in software.\n"
        ));
    }
    let lines: String = found.iter().map(line).collect();
    print(&format!("{lines}cpu  the CPU ({simd}); it draws the same pictures bit for bit on every machine\n"))
}

fn line(a: &AdapterSummary) -> String {
    let kind = if a.software { "emulated in software, never chosen by `auto`" } else { "GPU" };
    let times = if a.timestamps { "" } else { ", without stage times" };
    let largest = format::bytes(a.max_binding);
    format!(
        "{:<4} {} ({}, {}; {kind}; arrays of up to {largest}{times})\n",
        a.index, a.name, a.backend, a.driver
    )
}
