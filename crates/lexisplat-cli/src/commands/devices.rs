//! `lexisplat devices`.

use anyhow::Result;
use lexisplat::simd::Simd;
use lexisplat_eval::format;
use lexisplat_render::gpu::{AdapterSummary, adapters};
use serde_json::json;

use crate::args::Common;
use crate::files::{print, print_json};

pub(crate) fn run(common: &Common) -> Result<()> {
    let found = adapters();
    if common.json {
        let list: Vec<_> = found
            .iter()
            .map(|a| {
                json!({
                    "index": a.index,
                    "name": a.name,
                    "driver": a.driver,
                    "backend": a.backend,
                    "software": a.software,
                    "max_binding_bytes": a.max_binding,
                    "timestamps": a.timestamps,
                })
            })
            .collect();
        let available: Vec<_> = Simd::available().into_iter().map(Simd::name).collect();
        let processor = json!({ "simd": Simd::detect().name(), "available": available });
        return print_json(&json!({ "devices": list, "processor": processor }));
    }
    let simd = Simd::detect().name();
    if found.is_empty() {
        return print(&format!(
            "no GPU was found: everything is drawn on the processor (cpu, {simd})\n\
             A Vulkan, Metal or DX12 driver is needed; on Debian and Ubuntu, mesa-vulkan-drivers and libvulkan1\n\
             bring one for many GPUs, and a software one.\n"
        ));
    }
    let lines: String = found.iter().map(line).collect();
    print(&format!("{lines}cpu  the processor ({simd}); the same pictures bit for bit on every machine\n"))
}

fn line(a: &AdapterSummary) -> String {
    let kind = if a.software { "software: not taken by `auto`" } else { "GPU" };
    let times = if a.timestamps { "" } else { ", without stage times" };
    let largest = format::bytes(a.max_binding);
    format!(
        "{:<4} {} ({}, {}; {kind}; arrays of up to {largest}{times})\n",
        a.index, a.name, a.backend, a.driver
    )
}
