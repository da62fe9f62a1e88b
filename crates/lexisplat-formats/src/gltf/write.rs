//! Writes a glb.

use lexisplat::ply::ReadOptions;
use lexisplat::sh::{C0, CHANNELS, COLOUR_OFFSET};
use lexisplat::{Error, Limits, Result, SURE_OPACITY, ShDegree, Splats};

use super::accessor::Component;
use super::columns::{log_scale, logit};
use super::document::Shape;
use super::glb::{BIN, CHUNK_HEADER, HEADER, JSON, MAGIC, VERSION};
use super::json::{Attribute, Root};
use super::placement::GLTF;
use super::{attribute, rest_attributes};
use crate::axes::Flip;
use crate::lost::Lost;
use crate::opacity::to_byte;
use crate::rows::RowsMut;
use crate::settle::settled;
use crate::spz;
use crate::write_options::WriteOptions;

/// Highest SH degree of the extension.
const MOST_DEGREE: u8 = 3;
/// Version of SPZ in the extension of compression.
const SPZ_VERSION: u8 = 2;
/// Alignment of chunks and accessors, in bytes.
const ALIGNMENT: usize = 4;
/// Number of Gaussians that are processed together.
const PART: usize = 8192;
/// Largest difference from 1 of the length of a quaternion that is written as it is.
const UNIT_SLACK: f64 = 1e-6;
/// Constants of the decoding of sRGB to linear values (IEC 61966-2-1). Values up to the first number are divided by the
/// second. Larger values are `((v + 0.055) / 1.055)^2.4`.
const SRGB: [f32; 5] = [0.040_45, 12.92, 0.055, 1.055, 2.4];

/// Writes `splats` as a glb, with floats, or with an SPZ if the options ask for it.
///
/// # Errors
/// [`Error::Parameter`] for no splats, because a glTF cannot be empty, and for SPZ options out of range; [`Error::Limit`]
/// for more bytes than a glb can have.
pub(crate) fn write(splats: &Splats, options: &WriteOptions) -> Result<(Vec<u8>, Lost)> {
    if splats.is_empty() {
        return Err(Error::parameter("scene", "no Gaussians", "one or more: glTF has no empty accessors"));
    }
    let most = ShDegree::new(MOST_DEGREE)?;
    let cut = (splats.degree > most).then(|| splats.with_degree_cut(most));
    let kept = cut.as_ref().unwrap_or(splats);
    let attributes = attributes(kept.degree);
    let mut lost = Lost::beside(splats, kept.degree, options.glb_spz);
    let (mut root, bin) = if options.glb_spz {
        let (spz, lost_in_spz) = spz::write(kept, &WriteOptions { spz_version: SPZ_VERSION, ..*options })?;
        (lost.precision, lost.limited) = (lost_in_spz.precision, lost_in_spz.limited);
        lost.coarse = lost_in_spz.coarse;
        (Root::new(kept.len(), &attributes, flipped(spz_bounds(&spz)?), Some(spz.len())), spz)
    } else {
        let width: usize = attributes.iter().map(Attribute::width).sum();
        check_length((width as u64).saturating_mul(kept.len() as u64))?;
        lost.precision.push("scales and opacities, which are linear, to floats".to_owned());
        let bin = columns(kept, width, &mut lost.limited);
        let bounds = bounds(kept.geometry.positions.iter().copied());
        (Root::new(kept.len(), &attributes, flipped(bounds), None), bin)
    };
    root.set_translation(splats.meta.offset);
    lost.offset = None;
    Ok((glb(&root, &bin)?, lost))
}

/// Returns the attributes of splats of `degree`, in the order of the file.
fn attributes(degree: ShDegree) -> Vec<Attribute> {
    let of = |name: String, shape| Attribute { name, shape, is_byte: false };
    let mut all = vec![
        of("POSITION".to_owned(), Shape::Vec3),
        Attribute { name: "COLOR_0".to_owned(), shape: Shape::Vec4, is_byte: true },
        of(attribute("ROTATION"), Shape::Vec4),
        of(attribute("SCALE"), Shape::Vec3),
        of(attribute("OPACITY"), Shape::Scalar),
        of(attribute("SH_DEGREE_0_COEF_0"), Shape::Vec3),
    ];
    all.extend(rest_attributes(degree).map(|name| of(name, Shape::Vec3)));
    all
}

/// Returns the bytes of all attributes, `width` bytes for each Gaussian. Adds the number of values that are out of range
/// to `limited`.
fn columns(splats: &Splats, width: usize, limited: &mut u64) -> Vec<u8> {
    fn put(bin: &mut Vec<u8>, values: &[f32]) {
        values.iter().for_each(|v| bin.extend(v.to_le_bytes()));
    }
    let geometry = &splats.geometry;
    let flip = Flip::of(GLTF);
    let mut bin = Vec::with_capacity(width * splats.len());
    geometry.positions.iter().for_each(|position| put(&mut bin, &flip.position(*position)));
    let shares: Vec<f32> = geometry.opacities.iter().map(|v| share(*v)).collect();
    for (dc, share) in geometry.dc.iter().zip(&shares) {
        bin.extend(dc.map(|v| to_byte(linear((COLOUR_OFFSET + C0 * v).clamp(0.0, 1.0)))));
        bin.push(to_byte(*share));
    }
    for rotation in &geometry.rotations {
        let [w, x, y, z] = flip.rotation(unit(*rotation));
        put(&mut bin, &[x, y, z, w]);
    }
    for scale in geometry.scales.as_flattened() {
        let (value, is_limited) = spread(*scale);
        *limited += u64::from(is_limited);
        put(&mut bin, &[value]);
    }
    put(&mut bin, &shares);
    put(&mut bin, geometry.dc.as_flattened());
    let (all, per) = (splats.degree.rest(), splats.degree.rest_per_channel());
    for (k, sign) in flip.rest().into_iter().enumerate().take(per) {
        for rest in splats.sh_rest.chunks_exact(all) {
            let colours: [f32; CHANNELS] = std::array::from_fn(|c| rest[c * per + k] * sign);
            put(&mut bin, &colours);
        }
    }
    bin
}

/// Returns the standard deviation for its logarithm `scale`, and whether it was limited to the range of `f32`.
#[expect(clippy::cast_possible_truncation, reason = "the file has single precision")]
fn spread(scale: f32) -> (f32, bool) {
    let exp = |scale: f32| (libm::exp(f64::from(scale)) as f32).min(f32::MAX);
    let again = |bits: u32| exp(log_scale(f32::from_bits(bits), Component::F32.half_step())).to_bits();
    (f32::from_bits(settled(exp(scale).to_bits(), again)), libm::exp(f64::from(scale)) > f64::from(f32::MAX))
}

/// Returns the opacity as a share, 0 to 1, for `opacity` before the sigmoid.
#[expect(clippy::cast_possible_truncation, reason = "the file has single precision")]
pub(super) fn share(opacity: f32) -> f32 {
    // `SURE_OPACITY` stands for infinity, and its negative for minus infinity.
    if opacity <= -SURE_OPACITY {
        return 0.0;
    }
    let sigmoid = |opacity: f32| (1.0 / (1.0 + libm::exp(-f64::from(opacity)))) as f32;
    f32::from_bits(settled(sigmoid(opacity).to_bits(), |bits| sigmoid(logit(f32::from_bits(bits))).to_bits()))
}

/// Returns `q` scaled to length 1.
#[expect(clippy::cast_possible_truncation, reason = "the file has single precision")]
pub(super) fn unit(q: [f32; 4]) -> [f32; 4] {
    let length = q.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt();
    if (length - 1.0).abs() <= UNIT_SLACK {
        q
    } else if length > 0.0 && length.is_finite() {
        q.map(|v| (f64::from(v) / length) as f32)
    } else {
        [1.0, 0.0, 0.0, 0.0]
    }
}

/// Returns the linear value of the sRGB value `v`.
fn linear(v: f32) -> f32 {
    let [least, factor, offset, size, power] = SRGB;
    if v <= least { v / factor } else { libm::powf((v + offset) / size, power) }
}

/// Returns the lowest and the highest value of `positions` along each axis of a trainer's PLY.
fn bounds(mut positions: impl Iterator<Item = [f32; 3]>) -> [[f32; 3]; 2] {
    let first = positions.next().unwrap_or_default();
    positions.fold([first; 2], |[low, high], p| {
        [[0, 1, 2].map(|k| low[k].min(p[k])), [0, 1, 2].map(|k| high[k].max(p[k]))]
    })
}

/// Returns the bounds along the axes of a glTF.
fn flipped([low, high]: [[f32; 3]; 2]) -> [[f32; 3]; 2] {
    let [a, b] = [low, high].map(|corner| Flip::of(GLTF).position(corner));
    [[0, 1, 2].map(|k| a[k].min(b[k])), [0, 1, 2].map(|k| a[k].max(b[k]))]
}

/// Returns the bounds of the positions in the SPZ `bytes`, which this program wrote, along the axes of a trainer's PLY.
fn spz_bounds(bytes: &[u8]) -> Result<[[f32; 3]; 2]> {
    let options = ReadOptions::default().with_limits(Limits::default().with_expansion(u64::MAX));
    let described = spz::read("the SPZ of the glb", bytes, &options)?;
    let most = PART.min(described.len);
    let (mut positions, mut dc) = (vec![[0.0; 3]; most], vec![[0.0; 3]; most]);
    let (mut opacities, mut scales) = (vec![0.0; most], vec![[0.0; 3]; most]);
    let (mut rotations, mut sh_rest) = (vec![[0.0; 4]; most], vec![0.0; most * described.degree.rest()]);
    let mut found = Vec::new();
    for start in (0..described.len).step_by(PART) {
        let n = PART.min(described.len - start);
        let out = RowsMut {
            positions: &mut positions[..n],
            dc: &mut dc[..n],
            opacities: &mut opacities[..n],
            scales: &mut scales[..n],
            rotations: &mut rotations[..n],
            sh_rest: &mut sh_rest[..n * described.degree.rest()],
        };
        described.rows.fill(start..start + n, out);
        found.extend(bounds(positions[..n].iter().copied()));
    }
    Ok(bounds(found.into_iter()))
}

/// Returns the length of a glb of `bytes` bytes, or an error if the header has no room for it.
fn check_length(bytes: u64) -> Result<u32> {
    let what = "bytes of a glb, whose lengths have 32 bits; write another format".to_owned();
    u32::try_from(bytes).map_err(|_| Error::Limit { what, found: bytes, limit: u32::MAX.into(), name: None })
}

/// Returns the glb of `root` and its buffer.
fn glb(root: &Root, bin: &[u8]) -> Result<Vec<u8>> {
    let mut json = serde_json::to_vec(root)
        .map_err(|error| Error::parameter("scene", error, "values that JSON can hold"))?;
    json.resize(json.len().next_multiple_of(ALIGNMENT), b' ');
    let padded = bin.len().next_multiple_of(ALIGNMENT);
    let length = HEADER + CHUNK_HEADER + json.len() + CHUNK_HEADER + padded;
    let mut bytes = Vec::with_capacity(length);
    bytes.extend(MAGIC);
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend(check_length(length as u64)?.to_le_bytes());
    for (kind, chunk, length) in [(JSON, &json[..], json.len()), (BIN, bin, padded)] {
        bytes.extend(check_length(length as u64)?.to_le_bytes());
        bytes.extend(kind);
        bytes.extend(chunk);
        bytes.resize(bytes.len() + length - chunk.len(), 0);
    }
    Ok(bytes)
}
