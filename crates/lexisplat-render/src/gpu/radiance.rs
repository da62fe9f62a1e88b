//! The radiance kernel of a scene. Its text depends on the path of SH, on the degree and on the dictionary.

use crate::error::{Error, Result};

use super::constants::{atom_terms, dense_terms, float_terms, vectors};
use super::device::Gpu;
use super::part_layout::{ShKind, ShLayout};
use super::shaders::{compile, pipeline};
use crate::sh_path::ShPath;

/// Number of bytes of workgroup memory that the shared path leaves to the compiler.
const SHARED_RESERVE: usize = 64;

/// Compiles the kernel that colours the Gaussians of a scene with this `layout`.
pub(super) async fn radiance_pipeline(
    gpu: &Gpu,
    layout: ShLayout,
    path: ShPath,
) -> Result<wgpu::ComputePipeline> {
    if let (ShKind::Codes { atoms, .. }, ShPath::SparseShared) = (layout.kind, path) {
        let shared = atoms as usize * layout.degree.rest() * size_of::<f32>();
        let most = gpu.limits().max_compute_workgroup_storage_size as usize;
        if shared + SHARED_RESERVE > most {
            let expected = format!("a dictionary of at most {most} bytes for this GPU's workgroup memory");
            return Err(Error::parameter("dictionary", format!("{shared} bytes"), expected));
        }
    }
    let make = || Ok(pipeline(gpu, &compile(gpu, path.name(), &radiance_text(layout, path)), "radiance"));
    gpu.checked("radiance", make).await
}

/// Returns the text of the kernel that colours the Gaussians of a scene with this `layout`.
pub(super) fn radiance_text(layout: ShLayout, path: ShPath) -> String {
    let common = concat!(include_str!("kernels/frame.wgsl"), include_str!("kernels/radiance.wgsl"));
    let codes = include_str!("kernels/radiance_sparse.wgsl");
    let per_channel = layout.degree.rest_per_channel();
    match layout.kind {
        ShKind::Dense { half } => {
            let load = |v: usize| {
                let at = format!("rows[row + {v}u]");
                if half { format!("vec4<f32>(unpack2x16float({at}.x), unpack2x16float({at}.y))") } else { at }
            };
            let terms = dense_terms(per_channel, load);
            let row = if half { "vec2<u32>" } else { "vec4<f32>" };
            let vectors = vectors(per_channel + 1);
            let dense = include_str!("kernels/radiance_dense.wgsl")
                .replace("ROW_TYPE", row)
                .replace("// DENSE_TERMS", &terms);
            format!("const ROW_VECTORS: u32 = {vectors}u;\n{common}{dense}")
        }
        ShKind::Codes { index, value, atoms } => {
            let (cached, coloured) =
                (include_str!("kernels/radiance_cached.wgsl"), include_str!("kernels/radiance_codes.wgsl"));
            let parts = match path {
                ShPath::SparseOrdered => [cached, include_str!("kernels/radiance_ordered.wgsl")],
                ShPath::SparseShared => ["", include_str!("kernels/radiance_shared.wgsl")],
                ShPath::SparseTable => [include_str!("kernels/radiance_table.wgsl"), coloured],
                _ => [cached, coloured],
            };
            let dim = layout.degree.rest();
            let exact = float_terms(per_channel, |c| format!("bitcast<f32>(nonzeros[at + {c}u])"));
            let shared = float_terms(per_channel, |c| format!("atoms_here[at + {c}u]"));
            let codes =
                codes.replace("// ATOM_TERMS", &atom_terms(per_channel)).replace("// EXACT_TERMS", &exact);
            let entry = parts.concat().replace("// SHARED_TERMS", &shared);
            format!(
                "const INDEX_BYTES: u32 = {index}u;\nconst INDEX_MASK: u32 = {}u;\n\
                 const VALUE_BYTES: u32 = {value}u;\nconst ATOMS: u32 = {atoms}u;\nconst DIM: u32 = {}u;\n\
                 const ATOM_VECTORS: u32 = {}u;\nconst DICTIONARY: u32 = {}u;\n{common}{codes}{entry}",
                if index == 1 { 0xff } else { 0xffff },
                dim.max(1),
                vectors(per_channel),
                (atoms as usize * dim).max(1),
            )
        }
    }
}
