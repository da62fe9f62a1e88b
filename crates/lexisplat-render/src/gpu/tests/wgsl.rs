//! Every kernel is valid WGSL within WebGPU's default limits; no adapter needed.

use lexisplat::ShDegree;
use naga::valid::{Capabilities, FunctionInfo, ModuleInfo, ValidationFlags, Validator};
use naga::{AddressSpace, GlobalVariable, Module};

use super::super::constants::declarations;
use super::super::radiance::radiance_text;
use super::super::sh_data::ShData;
use super::super::shaders::{DRAWING, MEASURING};
use super::made;
use crate::scene::Scene;
use crate::sh_path::ShPath;

/// Capabilities of plain WebGPU; halves there are in packed pairs only.
const PLAIN: Capabilities = Capabilities::SHADER_FLOAT16_IN_FLOAT32;
/// WebGPU's `maxStorageBuffersPerShaderStage`.
const MOST_BUFFERS: usize = 8;
/// WebGPU's `maxComputeInvocationsPerWorkgroup`.
const MOST_LANES: u32 = 256;
/// WebGPU's `maxComputeWorkgroupStorageSize`, in bytes.
const MOST_SHARED: u32 = 16 << 10;

fn validated(name: &str, text: &str) -> (Module, ModuleInfo) {
    let source = format!("{}\n{text}", declarations());
    let module = naga::front::wgsl::parse_str(&source)
        .unwrap_or_else(|error| panic!("{name}: {}", error.emit_to_string(&source)));
    let info = Validator::new(ValidationFlags::all(), PLAIN)
        .validate(&module)
        .unwrap_or_else(|error| panic!("{name}: {}", error.emit_to_string(&source)));
    (module, info)
}

/// The globals of one kind that an entry point uses.
fn used<'a>(
    module: &'a Module,
    info: &'a FunctionInfo,
    kind: impl Fn(AddressSpace) -> bool + 'a,
) -> impl Iterator<Item = &'a GlobalVariable> {
    module
        .global_variables
        .iter()
        .filter(move |(handle, global)| kind(global.space) && !info[*handle].is_empty())
        .map(|(_, global)| global)
}

/// Checks every entry point of `text`; their names.
fn check(name: &str, text: &str, most_shared: u32) -> Vec<String> {
    let (module, info) = validated(name, text);
    for (index, entry) in module.entry_points.iter().enumerate() {
        let info = info.get_entry_point(index);
        let buffers = used(&module, info, |space| matches!(space, AddressSpace::Storage { .. })).count();
        assert!((1..=MOST_BUFFERS).contains(&buffers), "{name}, {}: {buffers} storage buffers", entry.name);
        let lanes: u32 = entry.workgroup_size.iter().product();
        assert!(lanes <= MOST_LANES, "{name}, {}: {lanes} lanes", entry.name);
        let shared: u32 = used(&module, info, |space| space == AddressSpace::WorkGroup)
            .map(|global| module.types[global.ty].inner.size(module.to_ctx()).next_multiple_of(16))
            .sum();
        assert!(shared <= most_shared, "{name}, {}: {shared} bytes of workgroup memory", entry.name);
    }
    module.entry_points.iter().map(|entry| entry.name.clone()).collect()
}

#[test]
fn every_kernel_is_portable() {
    for (name, entries, parts) in DRAWING.into_iter().chain(MEASURING) {
        assert_eq!(check(name, &parts.concat(), MOST_SHARED), entries, "{name}");
    }
    assert!(!check("speed", include_str!("../kernels/speed.wgsl"), MOST_SHARED).is_empty());
}

#[test]
fn every_radiance_is_portable() {
    for degree in (0..=4).map(|d| ShDegree::new(d).unwrap()) {
        let splats = made::scene(1, 2, degree, false);
        for (scene, half) in [(Scene::from(&splats), false), (Scene::from(&splats), true)] {
            let text = radiance_text(ShData::Dense { scene: &scene, half }.layout(), ShPath::DenseF32);
            assert_eq!(check(&format!("dense, half {half}, {degree}"), &text, MOST_SHARED), ["radiance"]);
        }
        // At degree 0 atoms are empty; at the others 257 need two bytes a number.
        for (atoms, half) in [(12, false), (12, true), (257, false), (257, true)] {
            let atoms = if degree == ShDegree::ZERO { 0 } else { atoms };
            let model = made::model(degree, atoms, half);
            for path in ShPath::ALL.into_iter().filter(|path| path.is_sparse()) {
                let text = radiance_text(ShData::Codes(&model).layout(), path);
                let own = size_of_val(model.dictionary().as_slice()).max(4).next_multiple_of(16) as u32;
                let most = if path == ShPath::SparseShared { own } else { MOST_SHARED };
                let name = format!("{}, {degree}, {atoms} atoms, half {half}", path.name());
                assert_eq!(check(&name, &text, most), ["radiance"]);
            }
        }
    }
}

#[test]
fn the_check_would_notice() {
    let refused = |text: &str, most_shared| {
        let text = text.to_owned();
        std::panic::catch_unwind(move || check("bad", &text, most_shared)).is_err()
    };
    let entry = "@group(0) @binding(0) var<storage, read_write> out: array<u32>;
        @compute @workgroup_size(LANES) fn main() { out[0] = shared_words[0]; }";
    let text = |lanes: u32, words: u32| {
        format!(
            "var<workgroup> shared_words: array<u32, {words}>; {}",
            entry.replace("LANES", &lanes.to_string())
        )
    };
    assert!(!refused(&text(256, 64), MOST_SHARED));
    assert!(refused(&text(257, 64), MOST_SHARED));
    assert!(refused(&text(256, 4097), MOST_SHARED));
    let many: String =
        (0..9).map(|k| format!("@group(0) @binding({}) var<storage> in{k}: array<u32>;", k + 1)).collect();
    let sum: String = (0..9).map(|k| format!(" + in{k}[0]")).collect();
    let nine = text(1, 4).replace("shared_words[0];", &format!("shared_words[0]{sum};")) + &many;
    assert!(refused(&nine, MOST_SHARED));
}
