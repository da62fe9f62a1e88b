//! What `info` says about a .lexi beyond what it says about any scene.

use std::fmt::Write as _;

use anyhow::Result;
use lexisplat::packed::{Packed, StreamBits};
use lexisplat::{Model, lexi};
use serde_json::{Map, Value, json};

use super::bars;
use lexisplat_eval::text;

use crate::commands::compress::error_line;
use crate::commands::pack::{attribute_bytes, promise_line, sh_bytes};

/// Bytes of a Gaussian's SH in a dense degree-3 scene, DC and rest, in f32.
const DENSE_SH_BYTES: usize = 192;
/// Atoms listed as the most used.
const TOP_ATOMS: usize = 8;

/// Gaussians by number of nonzeros, escapes apart.
fn nonzero_histogram(model: &Model) -> Vec<u64> {
    let mut histogram = vec![0; model.degree().rest() + 1];
    for &count in model.codes.counts() {
        histogram[usize::from(count)] += 1;
    }
    let escapes = model.codes.escapes().gaussians.len() as u64;
    histogram[0] -= escapes;
    histogram
}

/// Gaussians that use each atom.
fn atom_usage(model: &Model) -> Vec<u64> {
    let mut usage = vec![0; model.dictionary.len()];
    for k in 0..model.codes.nonzeros() {
        usage[model.codes.indices().get(k)] += 1;
    }
    usage
}

fn each(bytes: f64, model: &Model) -> f64 {
    bytes / model.len().max(1) as f64
}

pub(super) fn as_json(model: &Model, packed: Option<&Packed>) -> Result<Value> {
    let record = &model.record;
    let mut value = json!({
        "version": if packed.is_some() { lexi::PACKED_VERSION } else { lexi::VERSION },
        "layout": record.layout.name(),
        "tol": record.tolerance,
        "seed": record.seed,
        "max_residual": record.max_residual,
        "rms_residual": record.rms_residual,
        "over_tolerance": record.over_tolerance,
        "atoms": model.dictionary.len(),
        "nonzeros": model.codes.nonzeros(),
        "escapes": model.codes.escapes().gaussians.len(),
        "nonzero_histogram": nonzero_histogram(model),
        "atom_usage": atom_usage(model),
        "resident_sh_bytes": model.resident_sh_bytes(),
        "resident_sh_bytes_per_gaussian": each(model.resident_sh_bytes() as f64, model),
        "checksums": "ok",
    });
    let bytes: Map<String, Value> = match packed {
        None => {
            value["pursuit"] = record.pursuit.name().into();
            value["max_nnz"] = record.max_nonzeros.into();
            value["sh_bytes"] = lexi::sh_bytes(model)?.into();
            lexi::attribute_bytes(model)?.into_iter().map(|(name, bytes)| (name, bytes.into())).collect()
        }
        Some(packed) => {
            let streams = packed.stream_bits()?;
            value["promise"] = json!(packed.promise);
            value["device"] = packed.drawn_on.as_deref().unwrap_or("cpu").into();
            value["order_kept"] = packed.order.is_some().into();
            value["sh_bytes"] = sh_bytes(&streams).into();
            let bits = streams.iter().map(|s| (s.name.clone(), json!(each(s.bits, model))));
            value["stream_bits_per_gaussian"] = Value::Object(bits.collect());
            attribute_bytes(packed, &streams).into_iter().map(|(name, bytes)| (name, bytes.into())).collect()
        }
    };
    value["attribute_bytes"] = Value::Object(bytes);
    Ok(value)
}

pub(super) fn as_text(out: &mut String, model: &Model, packed: Option<&Packed>) -> Result<()> {
    let record = &model.record;
    let atoms = model.dictionary.len();
    match packed {
        None => writeln!(
            out,
            ".lexi version {}, layout {}, pursuit {}, {atoms} atoms, all checksums right",
            lexi::VERSION,
            record.layout,
            record.pursuit,
        )?,
        Some(packed) => writeln!(
            out,
            ".lexi version {}, layout packed, {atoms} atoms, {}, all checksums right",
            lexi::PACKED_VERSION,
            if packed.order.is_some() { "order of the source kept" } else { "in an order of its own" },
        )?,
    }
    if let Some(promise) = packed.and_then(|p| p.promise.as_ref()) {
        writeln!(out, "pictures: {}", promise_line(promise))?;
    }
    if let Some(device) = packed.and_then(|p| p.drawn_on.as_ref()) {
        writeln!(out, "looked at on: {device}")?;
    }
    if model.degree().rest() > 0 {
        writeln!(out, "error: {}", error_line(record))?;
        let escapes = model.codes.escapes().gaussians.len();
        let mean = model.codes.nonzeros() as f64 / model.len().max(1) as f64;
        writeln!(out, "codes: {mean:.2} nonzeros a Gaussian, {escapes} stored exactly")?;
    }
    writeln!(
        out,
        "in memory: {:.1} bytes of SH a Gaussian (codes, base colour, dictionary), beside {DENSE_SH_BYTES} dense",
        each(model.resident_sh_bytes() as f64, model)
    )?;
    match packed {
        None => {
            writeln!(out, "\nbytes")?;
            for (name, bytes) in lexi::attribute_bytes(model)? {
                let one = each(bytes as f64, model);
                writeln!(out, "  {name:<18} {:>10}  {one:>8.2} a Gaussian", text::bytes(bytes))?;
            }
        }
        Some(packed) => packed_bytes(out, model, packed)?,
    }
    if model.degree().rest() > 0 {
        writeln!(out, "\nGaussians by nonzeros")?;
        let histogram = nonzero_histogram(model);
        let last = histogram.iter().rposition(|&n| n > 0).unwrap_or(0);
        let labels: Vec<String> = (0..=last).map(|n| n.to_string()).collect();
        bars(out, &labels, &histogram[..=last])?;
        usage_text(out, model)?;
    }
    Ok(())
}

/// Each attribute with the streams it is made of.
fn packed_bytes(out: &mut String, model: &Model, packed: &Packed) -> Result<()> {
    let streams = packed.stream_bits()?;
    writeln!(out, "\n{:<14} {:>10} {:>16}   streams", "attribute", "bytes", "bits a Gaussian")?;
    for (name, bytes) in attribute_bytes(packed, &streams) {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a size to look at")]
        let size = text::bytes(bytes.round() as u64);
        let parts: Vec<&StreamBits> = streams.iter().filter(|s| s.attribute == name).collect();
        let parts = match parts.as_slice() {
            [] | [_] => String::new(),
            parts => {
                let part = |s: &&StreamBits| format!("{} {:.2}", s.name, each(s.bits, model));
                parts.iter().map(part).collect::<Vec<_>>().join(", ")
            }
        };
        let line = format!("{name:<14} {size:>10} {:>16.2}   {parts}", each(8.0 * bytes, model));
        writeln!(out, "{}", line.trim_end())?;
    }
    Ok(())
}

fn usage_text(out: &mut String, model: &Model) -> Result<()> {
    let usage = atom_usage(model);
    let total = usage.iter().sum::<u64>().max(1);
    let mut order: Vec<usize> = (0..usage.len()).collect();
    order.sort_by_key(|&j| (std::cmp::Reverse(usage[j]), j));
    let unused = usage.iter().filter(|&&n| n == 0).count();
    let mut covered = 0;
    let half = order.iter().take_while(|&&j| {
        let before = covered;
        covered += usage[j];
        2 * before < total
    });
    writeln!(
        out,
        "\natoms: {} make up half of all nonzeros, {unused} of {} are not used",
        half.count(),
        usage.len()
    )?;
    for &j in order.iter().take(TOP_ATOMS) {
        let share = 100.0 * usage[j] as f64 / total as f64;
        writeln!(out, "  atom {j:>4} {:>10} {share:>5.1} %", text::count(usage[j]))?;
    }
    Ok(())
}
