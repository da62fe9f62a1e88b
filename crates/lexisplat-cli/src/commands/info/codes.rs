//! What `info` says about a .lexi beyond what it says about any scene.

use std::fmt::Write as _;

use anyhow::Result;
use lexisplat::Layout;
use lexisplat::lexi::{self, LexiChunks};
use lexisplat::packed::StreamBits;
use lexisplat::stream::Survey;
use serde_json::{Map, Value, json};

use super::bars;
use lexisplat_eval::format;

use crate::commands::compress::error_line;
use crate::commands::pack::{attribute_bytes, promise_line, sh_bytes};

/// Bytes of a Gaussian's SH in a dense degree-3 scene, DC and rest, in f32.
const DENSE_SH_BYTES: usize = 192;
/// Atoms listed as the most used.
const TOP_ATOMS: usize = 8;

fn each(bytes: f64, lexi: &LexiChunks<'_>) -> f64 {
    bytes / lexi.len().max(1) as f64
}

fn is_packed(lexi: &LexiChunks<'_>) -> bool {
    lexi.record().layout == Layout::Packed
}

pub(super) fn as_json(lexi: &LexiChunks<'_>, survey: &Survey) -> Value {
    let record = lexi.record();
    let packed = is_packed(lexi);
    let mut value = json!({
        "version": if packed { lexi::PACKED_VERSION } else { lexi::VERSION },
        "layout": record.layout.name(),
        "tol": record.tolerance,
        "seed": record.seed,
        "max_residual": record.max_residual,
        "rms_residual": record.rms_residual,
        "over_tolerance": record.over_tolerance,
        "atoms": lexi.dictionary().len(),
        "nonzeros": survey.nonzeros,
        "escapes": survey.escapes,
        "nonzero_histogram": survey.nonzero_histogram,
        "atom_usage": survey.atom_usage,
        "resident_sh_bytes": survey.resident_sh_bytes,
        "resident_sh_bytes_per_gaussian": each(survey.resident_sh_bytes as f64, lexi),
        "checksums": "ok",
    });
    let tensors = lexi.attribute_bytes();
    let bytes: Map<String, Value> = if packed {
        let streams = &survey.stream_bits;
        value["promise"] = json!(lexi.target());
        value["device"] = lexi.device().unwrap_or("cpu").into();
        value["order_kept"] = lexi.order_kept().into();
        value["sh_bytes"] = sh_bytes(streams).into();
        let bits = streams.iter().map(|s| (s.name.clone(), json!(each(s.bits, lexi))));
        value["stream_bits_per_gaussian"] = Value::Object(bits.collect());
        attribute_bytes(tensors, streams).into_iter().map(|(name, bytes)| (name, bytes.into())).collect()
    } else {
        value["pursuit"] = record.pursuit.name().into();
        value["max_nnz"] = record.max_nonzeros.into();
        value["sh_bytes"] = lexi.sh_bytes().into();
        tensors.iter().map(|(name, bytes)| (name.clone(), (*bytes).into())).collect()
    };
    value["attribute_bytes"] = Value::Object(bytes);
    value
}

pub(super) fn as_text(out: &mut String, lexi: &LexiChunks<'_>, survey: &Survey) -> Result<()> {
    let record = lexi.record();
    let atoms = lexi.dictionary().len();
    let packed = is_packed(lexi);
    if packed {
        writeln!(
            out,
            ".lexi version {}, layout packed, {atoms} atoms, {}, all checksums right",
            lexi::PACKED_VERSION,
            if lexi.order_kept() { "order of the source kept" } else { "in an order of its own" },
        )?;
    } else {
        writeln!(
            out,
            ".lexi version {}, layout {}, pursuit {}, {atoms} atoms, all checksums right",
            lexi::VERSION,
            record.layout,
            record.pursuit,
        )?;
    }
    if let Some(promise) = lexi.target() {
        writeln!(out, "pictures: {}", promise_line(promise))?;
    }
    if let Some(device) = lexi.device() {
        writeln!(out, "looked at on: {device}")?;
    }
    if atoms > 0 {
        writeln!(out, "error: {}", error_line(record))?;
        let mean = survey.nonzeros as f64 / lexi.len().max(1) as f64;
        writeln!(out, "codes: {mean:.2} nonzeros a Gaussian, {} stored exactly", survey.escapes)?;
    }
    writeln!(
        out,
        "in memory: {:.1} bytes of SH a Gaussian (codes, base colour, dictionary), beside {DENSE_SH_BYTES} dense",
        each(survey.resident_sh_bytes as f64, lexi)
    )?;
    if packed {
        packed_bytes(out, lexi, &survey.stream_bits)?;
    } else {
        writeln!(out, "\nbytes")?;
        for (name, bytes) in lexi.attribute_bytes() {
            let one = each(*bytes as f64, lexi);
            writeln!(out, "  {name:<18} {:>10}  {one:>8.2} a Gaussian", format::bytes(*bytes))?;
        }
    }
    if atoms > 0 {
        writeln!(out, "\nGaussians by nonzeros")?;
        let histogram = &survey.nonzero_histogram;
        let last = histogram.iter().rposition(|&n| n > 0).unwrap_or(0);
        let labels: Vec<String> = (0..=last).map(|n| n.to_string()).collect();
        bars(out, &labels, &histogram[..=last])?;
        usage_text(out, &survey.atom_usage)?;
    }
    Ok(())
}

/// Each attribute with the streams it is made of.
fn packed_bytes(out: &mut String, lexi: &LexiChunks<'_>, streams: &[StreamBits]) -> Result<()> {
    writeln!(out, "\n{:<14} {:>10} {:>16}   streams", "attribute", "bytes", "bits a Gaussian")?;
    for (name, bytes) in attribute_bytes(lexi.attribute_bytes(), streams) {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a size to look at")]
        let size = format::bytes(bytes.round() as u64);
        let parts: Vec<&StreamBits> = streams.iter().filter(|s| s.attribute == name).collect();
        let parts = match parts.as_slice() {
            [] | [_] => String::new(),
            parts => {
                let part = |s: &&StreamBits| format!("{} {:.2}", s.name, each(s.bits, lexi));
                parts.iter().map(part).collect::<Vec<_>>().join(", ")
            }
        };
        let line = format!("{name:<14} {size:>10} {:>16.2}   {parts}", each(8.0 * bytes, lexi));
        writeln!(out, "{}", line.trim_end())?;
    }
    Ok(())
}

fn usage_text(out: &mut String, usage: &[u64]) -> Result<()> {
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
        writeln!(out, "  atom {j:>4} {:>10} {share:>5.1} %", format::count(usage[j]))?;
    }
    Ok(())
}
