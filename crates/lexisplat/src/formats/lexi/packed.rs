//! Packed scenes in the container: a few tensors instead of one for each attribute.

use std::ops::Range;

use safetensors::Dtype;

use super::checked::Checked;
use super::fields::{check_extra_names, column, degree, extras, meta, record};
use super::json::Json;
use super::schema::{EXTRA_PREFIX, PACKED, key, tensor};
use crate::packed::{Packed, PackedHead, ReachedRecord, TargetRecord, atoms_of_head};
use crate::scene::extra::ExtraValues;
use crate::support::error::Result;
use crate::support::limits::Limits;
use crate::support::memory_budget::MemoryBudget;

/// Largest number of Gaussians that a byte of a packed file can stand for: a rotation takes at least 3 raw bits. A header
/// that claims more Gaussians is refused before anything is allocated.
const GAUSSIANS_PER_BYTE: u64 = 3;

/// Returns the packed scene of a file whose checksums hold, and whose [head](head) is `head`.
pub(super) fn packed(checked: &Checked<'_>, head: PackedHead, limits: &Limits) -> Result<Packed> {
    let n = head.gaussians;
    let budget = MemoryBudget::new(limits, &checked.file, checked.bytes().len() as u64);
    for bytes in [head.bytes.len(), data(checked)?.len()] {
        budget.take(bytes, 1)?;
    }
    for extra in extras(checked, n, &(0..0))? {
        budget.take(n, extra.values.width())?;
    }
    let order = if has_order(checked) {
        budget.take(n, size_of::<u32>())?;
        Some(order(checked, n, 0..n)?)
    } else {
        None
    };
    Ok(Packed::new(head, extras(checked, n, &(0..n))?, order, data(checked)?.to_vec()))
}

/// Returns the data of a packed file, or their first part if not all of them are there.
pub(super) fn data<'a>(checked: &'a Checked<'_>) -> Result<&'a [u8]> {
    if !checked.is_whole() {
        return Ok(checked.first_of(tensor::DATA).map(|(_, _, data)| data).unwrap_or_default());
    }
    checked.data(tensor::DATA, Dtype::U8, &length(checked, tensor::DATA, Dtype::U8)?)
}

/// Returns the position at which the data of a packed file start, and their length.
pub(super) fn data_span(checked: &Checked<'_>) -> (u64, u64) {
    checked.first_of(tensor::DATA).map(|(start, length, _)| (start, length)).unwrap_or_default()
}

/// Returns whether the order of the source is there.
pub(super) fn has_order(checked: &Checked<'_>) -> bool {
    checked.is_whole() && checked.has(tensor::ORDER)
}

fn length(checked: &Checked<'_>, name: &str, dtype: Dtype) -> Result<[usize; 1]> {
    match checked.tensor(name)?.shape {
        [len] => Ok([*len]),
        shape => Err(checked.malformed(format!("tensor '{name}' is {dtype:?} {shape:?}, not a list"))),
    }
}

/// Returns the head of a packed scene: everything that is not as long as the scene. Checks everything except the
/// [columns](check_columns) and damage that only decoding finds.
pub(super) fn head(checked: &Checked<'_>, limits: &Limits) -> Result<PackedHead> {
    let file_bytes = checked.bytes().len() as u64;
    let gaussians: u64 = checked.number(key::GAUSSIANS)?;
    if checked.is_whole() {
        limits.check_gaussians(&checked.file, gaussians)?;
        if gaussians > file_bytes.saturating_mul(GAUSSIANS_PER_BYTE) {
            let text = format!(
                "metadata 'gaussians' is {gaussians}, above {GAUSSIANS_PER_BYTE} for each of the file's {file_bytes} bytes"
            );
            return Err(checked.malformed(text));
        }
    }
    let (_, bytes) = checked.sealed_head()?;
    let atoms = atoms_of_head(bytes).ok_or_else(|| checked.malformed("tensor 'packed.head' is too short"))?;
    limits.check_atoms(&checked.file, atoms)?;
    let gaussians = usize::try_from(gaussians).map_err(|_| checked.malformed("too many Gaussians"))?;
    let known = |name: &str| name.starts_with(EXTRA_PREFIX) || PACKED.contains(&name);
    checked.refuse_unknown(known, "for layout 'packed'")?;
    let target = checked.has_text(key::TARGET).then(|| checked.json(key::TARGET, target)).transpose()?;
    let reached = checked.has_text(key::REACHED).then(|| checked.json(key::REACHED, reached)).transpose()?;
    check_extra_names(checked)?;
    // A first part of a file has this too: its header has the types and shapes of tensors that are not there yet.
    checked.must_be_bytes(tensor::DATA)?;
    let columns = |name: &&str| *name == tensor::ORDER || name.starts_with(EXTRA_PREFIX);
    checked.names().filter(columns).try_for_each(|name| checked.must_be_bytes(name))?;
    data(checked)?;
    Ok(PackedHead {
        file: checked.file.clone(),
        degree: degree(checked)?,
        gaussians,
        removed: checked.optional(key::REMOVED)?.unwrap_or(0),
        atoms: usize::try_from(atoms).map_err(|_| checked.malformed("too many atoms"))?,
        record: record(checked)?,
        meta: meta(checked)?,
        target,
        reached,
        device: checked
            .has_text(key::DEVICE)
            .then(|| checked.text(key::DEVICE))
            .transpose()?
            .map(str::to_owned),
        bytes: bytes.to_vec(),
        limits: *limits,
    })
}

fn target(json: &Json) -> Option<TargetRecord> {
    Some(TargetRecord {
        kind: json.get("kind")?.text()?.to_owned(),
        asked: json.get("asked")?.number()?,
        mean_psnr: json.get("mean_psnr")?.number()?,
        min_psnr: json.get("min_psnr")?.number()?,
        views: json.get("views")?.number()?,
        cameras: json.get("cameras")?.bool()?,
    })
}

fn reached(json: &Json) -> Option<ReachedRecord> {
    Some(ReachedRecord {
        judged_psnr: json.get("judged_psnr")?.number()?,
        mean_psnr: json.get("mean_psnr")?.number()?,
        min_psnr: json.get("min_psnr")?.number()?,
        views: json.get("views")?.number()?,
        cameras: json.get("cameras")?.bool()?,
    })
}

/// Refuses columns that are not of `n` Gaussians. The columns are the order of the source, and extras.
pub(super) fn check_columns(checked: &Checked<'_>, n: usize) -> Result<()> {
    if has_order(checked) && !is_permutation(checked, n)? {
        return Err(checked.malformed("tensor 'packed.order' is not a permutation"));
    }
    extras(checked, n, &(0..0)).map(drop)
}

/// Returns the indices in the source of the Gaussians of `range`. The file has `n` Gaussians.
pub(super) fn order(checked: &Checked<'_>, n: usize, range: Range<usize>) -> Result<Vec<u32>> {
    if !checked.is_whole() {
        return Err(checked.malformed("only a first part is there, without the order of the source"));
    }
    let values = column(checked, tensor::ORDER, n)?.values(range);
    match values {
        Ok(ExtraValues::U32(order)) => Ok(order),
        Ok(_) => Err(checked.malformed("tensor 'packed.order' is not of u32")),
        Err(error) => Err(checked.malformed(format!("tensor 'packed.order': {error}"))),
    }
}

/// Number of Gaussians whose indices are looked at together.
const INDICES_AT_ONCE: usize = 1 << 16;

/// Returns whether the order names each of `n` Gaussians once.
fn is_permutation(checked: &Checked<'_>, n: usize) -> Result<bool> {
    let mut seen = vec![0_u64; n.div_ceil(64)];
    // The column is looked at once even if it has no values.
    for first in (0..n.max(1)).step_by(INDICES_AT_ONCE) {
        for index in order(checked, n, first..n.min(first + INDICES_AT_ONCE))? {
            let index = index as usize;
            let Some(word) = seen.get_mut(index / 64).filter(|_| index < n) else { return Ok(false) };
            let bit = 1 << (index % 64);
            if *word & bit != 0 {
                return Ok(false);
            }
            *word |= bit;
        }
    }
    Ok(true)
}
