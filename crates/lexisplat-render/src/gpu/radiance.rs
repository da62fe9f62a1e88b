//! The radiance kernel of a scene. Its text depends on how SH is held, on the degree and on the dictionary.

use crate::error::{Error, Result};

use super::constants::{atom_terms, dense_terms, shared_atom_terms, vectors};
use super::device::Gpu;
use super::path::ShPath;
use super::sh_data::ShData;
use super::shaders::{compile, pipeline};

/// Bytes of workgroup memory that the shared path leaves for the compiler's own use.
const SHARED_RESERVE: usize = 64;

/// Compiles the kernel that colours the Gaussians of `sh`.
pub(super) async fn radiance_pipeline(
    gpu: &Gpu,
    sh: &ShData<'_>,
    path: ShPath,
) -> Result<wgpu::ComputePipeline> {
    if let (ShData::Codes(model), ShPath::SparseShared) = (sh, path) {
        let shared = size_of_val(model.dictionary().as_slice());
        let most = gpu.limits().max_compute_workgroup_storage_size as usize;
        if shared + SHARED_RESERVE > most {
            let expected = format!("a dictionary of at most {most} bytes for this GPU's workgroup memory");
            return Err(Error::parameter("dictionary", format!("{shared} bytes"), expected));
        }
    }
    let make = || Ok(pipeline(gpu, &compile(gpu, path.name(), &radiance_text(sh, path)), "radiance"));
    gpu.checked("radiance", make).await
}

/// The text of the kernel that colours the Gaussians of `sh`.
pub(super) fn radiance_text(sh: &ShData<'_>, path: ShPath) -> String {
    let common = concat!(include_str!("kernels/frame.wgsl"), include_str!("kernels/radiance.wgsl"));
    let codes = include_str!("kernels/radiance_sparse.wgsl");
    match sh {
        ShData::Dense { scene, half } => {
            let per_channel = scene.degree().rest_per_channel();
            let load = |v: usize| {
                let at = format!("rows[row + {v}u]");
                if *half {
                    format!("vec4<f32>(unpack2x16float({at}.x), unpack2x16float({at}.y))")
                } else {
                    at
                }
            };
            let terms = dense_terms(per_channel, load);
            let row = if *half { "vec2<u32>" } else { "vec4<f32>" };
            let vectors = vectors(per_channel + 1);
            let dense = include_str!("kernels/radiance_dense.wgsl")
                .replace("ROW_TYPE", row)
                .replace("// DENSE_TERMS", &terms);
            format!("const ROW_VECTORS: u32 = {vectors}u;\n{common}{dense}")
        }
        ShData::Codes(model) => {
            let dictionary = model.dictionary();
            let (cached, coloured) =
                (include_str!("kernels/radiance_cached.wgsl"), include_str!("kernels/radiance_codes.wgsl"));
            let parts = match path {
                ShPath::SparseOrdered => [cached, include_str!("kernels/radiance_ordered.wgsl")],
                ShPath::SparseShared => ["", include_str!("kernels/radiance_shared.wgsl")],
                ShPath::SparseTable => [include_str!("kernels/radiance_table.wgsl"), coloured],
                _ => [cached, coloured],
            };
            let (index, value) = (model.codes().indices().width(), model.codes().values().width());
            let per_channel = dictionary.degree().rest_per_channel();
            let codes = codes.replace("// ATOM_TERMS", &atom_terms(per_channel));
            let entry = parts.concat().replace("// SHARED_TERMS", &shared_atom_terms(per_channel));
            format!(
                "const INDEX_BYTES: u32 = {index}u;\nconst INDEX_MASK: u32 = {}u;\n\
                 const VALUE_BYTES: u32 = {value}u;\nconst ATOMS: u32 = {}u;\nconst DIM: u32 = {}u;\n\
                 const ATOM_VECTORS: u32 = {}u;\nconst DICTIONARY: u32 = {}u;\n{common}{codes}{entry}",
                if index == 1 { 0xff } else { 0xffff },
                dictionary.len(),
                dictionary.dim().max(1),
                vectors(per_channel),
                dictionary.as_slice().len().max(1),
            )
        }
    }
}
