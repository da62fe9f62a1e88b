//! The output of `info` for a .lexi file, in addition to the output for any scene.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use anyhow::Result;
use lexisplat::Record;
use lexisplat::lexi::LexiReader;
use lexisplat::packed::{ReachedRecord, StreamBits, TargetRecord};
use lexisplat::stream::Survey;
use lexisplat_compress::{ByteCount, RecordReport, attribute_bytes, sh_bytes};
use lexisplat_eval::format;
use serde::Serialize;

use super::histogram::bars;
use super::layers::LayersFacts;
use crate::commands::compress::{error_line, record_line, removed_line};

/// Number of bytes of a Gaussian's SH in a dense scene of degree 3, DC included, in f32.
const DENSE_SH_BYTES: usize = 192;
/// Name of the processor as a device.
const CPU: &str = "cpu";
/// Number of atoms listed as the most used.
const TOP_ATOMS: usize = 8;

/// The facts about a .lexi file.
#[derive(Serialize)]
pub(super) struct LexiFacts<'a> {
    version: u64,
    layout: &'static str,
    #[serde(flatten)]
    made: RecordReport,
    atoms: usize,
    nonzeros: u64,
    escapes: u64,
    nonzero_histogram: &'a [u64],
    atom_usage: &'a [u64],
    resident_sh_bytes: u64,
    resident_sh_bytes_per_gaussian: f64,
    checksums: &'static str,
    /// Whether the checksums of decoded integers match, if they were verified.
    integer_checksums: Option<&'static str>,
    sh_bytes: ByteCount,
    attribute_bytes: BTreeMap<&'a str, ByteCount>,
    #[serde(flatten)]
    packed: Option<PackedFacts<'a>>,
    #[serde(skip)]
    gaussians: usize,
    #[serde(skip)]
    record: &'a Record,
    /// Number of bytes by part, in the order of the file.
    #[serde(skip)]
    parts: &'a [(String, f64)],
}

/// The facts about a packed file.
#[derive(Serialize)]
struct PackedFacts<'a> {
    removed: u64,
    target: Option<&'a TargetRecord>,
    reached: Option<&'a ReachedRecord>,
    device: &'a str,
    order_kept: bool,
    stream_bits_per_gaussian: BTreeMap<&'a str, f64>,
    #[serde(flatten)]
    layers: Option<LayersFacts>,
    #[serde(skip)]
    streams: &'a [StreamBits],
}

/// Returns the number of bytes of each part of the file, by name.
pub(super) fn parts(lexi: &LexiReader<'_>, survey: &Survey) -> Vec<(String, f64)> {
    attribute_bytes(lexi.tensor_bytes(), &survey.stream_bits)
}

impl<'a> LexiFacts<'a> {
    /// Returns the facts about the file of `lexi`. `verified` tells whether the checksums of integers were verified.
    pub(super) fn new(
        lexi: &'a LexiReader<'_>,
        survey: &'a Survey,
        parts: &'a [(String, f64)],
        file_bytes: u64,
        verified: bool,
    ) -> Self {
        let (record, gaussians) = (lexi.record(), lexi.len());
        let each = |value: f64| value / gaussians.max(1) as f64;
        let streams = &survey.stream_bits;
        let packed = lexi.packed_head().map(|head| PackedFacts {
            removed: head.removed,
            target: head.target.as_ref(),
            reached: head.reached.as_ref(),
            device: head.device.as_deref().unwrap_or(CPU),
            order_kept: lexi.order_kept(),
            stream_bits_per_gaussian: streams.iter().map(|s| (s.name.as_str(), each(s.bits))).collect(),
            layers: lexi.outline().map(|outline| LayersFacts::new(outline, file_bytes)),
            streams,
        });
        Self {
            version: lexi.version(),
            layout: lexi.layout().name(),
            made: record.into(),
            atoms: lexi.dictionary().len(),
            nonzeros: survey.nonzeros,
            escapes: survey.escapes,
            nonzero_histogram: &survey.nonzero_histogram,
            atom_usage: &survey.atom_usage,
            resident_sh_bytes: survey.resident_sh_bytes,
            resident_sh_bytes_per_gaussian: each(survey.resident_sh_bytes as f64),
            checksums: "ok",
            integer_checksums: verified.then_some("ok"),
            sh_bytes: sh_bytes(parts).into(),
            attribute_bytes: parts.iter().map(|(name, bytes)| (name.as_str(), (*bytes).into())).collect(),
            packed,
            gaussians,
            record,
            parts,
        }
    }

    fn each(&self, value: f64) -> f64 {
        value / self.gaussians.max(1) as f64
    }

    /// Writes the line for people about the kind of the file.
    pub(super) fn head(&self, out: &mut String) -> Result<()> {
        let Self { version, layout, made, atoms, packed, .. } = self;
        let how = match (packed, made.pursuit) {
            (Some(packed), _) if packed.order_kept => ", order of the source kept".to_owned(),
            (Some(_), _) => ", order of the source not kept".to_owned(),
            (None, pursuit) => pursuit.map(|name| format!(", pursuit {name}")).unwrap_or_default(),
        };
        let sums = if self.integer_checksums.is_some() { ", also those of integers" } else { "" };
        writeln!(
            out,
            ".lexi version {version}, layout {layout}, {atoms} atoms{how}, all checksums match{sums}"
        )?;
        Ok(())
    }

    /// Returns the quality that the file records, and the number of Gaussians that were left out for it, as text.
    pub(super) fn quality(&self) -> Option<String> {
        let packed = self.packed.as_ref();
        let left_out = packed.filter(|packed| packed.removed > 0).map(|packed| removed_line(packed.removed));
        let pictures = packed.and_then(|packed| record_line(packed.reached, packed.target));
        let error =
            (packed.is_none() && self.atoms > 0).then(|| format!("SH error: {}", error_line(self.record)));
        let parts = [
            pictures.map(|line| format!("pictures: {line}")).or(error),
            left_out.map(|line| format!("left out: {line}")),
        ];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        (!parts.is_empty()).then(|| parts.join("; "))
    }

    /// Writes all other facts.
    pub(super) fn details(&self, out: &mut String) -> Result<()> {
        let Self { atoms, packed, escapes, .. } = self;
        if let Some(packed) = packed.as_ref().filter(|packed| packed.device != CPU) {
            writeln!(out, "measured on: {}", format::escape(packed.device))?;
        }
        if *atoms > 0 {
            writeln!(out, "SH error: {}", error_line(self.record))?;
            let mean = self.each(self.nonzeros as f64);
            writeln!(out, "codes: {mean:.2} nonzeros a Gaussian, {escapes} stored exactly")?;
        }
        writeln!(
            out,
            "in memory: {:.1} bytes of SH a Gaussian (codes, base colour, dictionary), beside {DENSE_SH_BYTES} dense",
            self.resident_sh_bytes_per_gaussian
        )?;
        self.parts_text(out)?;
        if let Some(layers) = packed.as_ref().and_then(|packed| packed.layers.as_ref()) {
            layers.text(out)?;
        }
        if *atoms > 0 {
            writeln!(out, "\nGaussians by nonzeros")?;
            let last = self.nonzero_histogram.iter().rposition(|&n| n > 0).unwrap_or(0);
            let labels: Vec<String> = (0..=last).map(|n| n.to_string()).collect();
            bars(out, &labels, self.nonzero_histogram)?;
            usage_text(out, self.atom_usage)?;
        }
        Ok(())
    }

    /// Writes a line for each part of the file. Parts of a packed file list their streams.
    fn parts_text(&self, out: &mut String) -> Result<()> {
        writeln!(out, "\n{:<18} {:>10} {:>16}   streams", "part", "bytes", "bits a Gaussian")?;
        for (name, bytes) in self.parts {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a size to look at")]
            let size = format::bytes(bytes.round() as u64);
            let streams = self.packed.as_ref().map_or(&[][..], |packed| packed.streams);
            let streams: Vec<String> = streams
                .iter()
                .filter(|s| s.attribute == name)
                .map(|s| format!("{} {:.2}", s.name, self.each(s.bits)))
                .collect();
            let streams = if streams.len() > 1 { streams.join(", ") } else { String::new() };
            let name = format::escape(name);
            let line = format!("{name:<18} {size:>10} {:>16.2}   {streams}", self.each(8.0 * bytes));
            writeln!(out, "{}", line.trim_end())?;
        }
        Ok(())
    }
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
