//! Packed scenes in the container: four tensors instead of one for each attribute.

use std::collections::BTreeMap;
use std::io::Write;

use safetensors::Dtype;

use super::read::{degree, extras, meta, record};
use super::schema::{EXTRA_PREFIX, FORMAT, IGNORED_PREFIX, PACKED_VERSION, key, tensor};
use super::spilled::{Extras, write_tensors};
use super::tensors::{Checked, Draft, Tensor, preamble};
use super::write::{extra_tensors, put_record};
use crate::packed::{CHUNK, Packed, TargetRecord};
use crate::support::error::Result;
use crate::support::limits::Limits;
use crate::support::memory_budget::MemoryBudget;
use crate::support::output::Output;
use crate::support::spill::Spilled;

/// Gaussians a byte of a packed file stands for at most: a rotation takes at least 3 raw bits. So a lying
/// header is refused before anything is allocated.
const GAUSSIANS_PER_BYTE: u64 = 3;

/// Writes `packed` to `output`, whole or not at all. Returns the file's size in bytes.
///
/// # Errors
/// [`crate::Error::Io`] for the file.
pub fn write_packed<'a>(output: impl Into<Output<'a>>, packed: &Packed) -> Result<u64> {
    draft(packed).save(output.into())
}

/// Writes `packed` to `writer`. Returns the number of bytes.
///
/// # Errors
/// [`crate::Error::Writer`] if the writer fails.
pub fn write_packed_to(writer: &mut impl Write, packed: &Packed) -> Result<u64> {
    draft(packed).stream(writer)
}

/// Bytes of the whole file as written.
#[must_use]
pub fn packed_bytes(packed: &Packed) -> u64 {
    packed_tensor_bytes(packed).iter().map(|t| t.1).sum()
}

/// Bytes of each tensor as written, and of the header under `header`. They sum to the file's size.
#[must_use]
pub fn packed_tensor_bytes(packed: &Packed) -> Vec<(String, u64)> {
    let (metadata, tensors) = contents(packed);
    Draft::sizes(metadata, tensors)
}

/// The packed scene of a file whose checksums hold.
pub(super) fn from_checked(checked: &Checked<'_>, file_bytes: u64, limits: &Limits) -> Result<Packed> {
    let head = head(checked, file_bytes, limits)?;
    let n = head.gaussians;
    let budget = MemoryBudget::new(limits, checked.file, file_bytes);
    let lists = (head.parameters.len() + head.lengths.len(), size_of::<u32>());
    for (count, each) in [lists, (head.tables.len(), 1), (data(checked)?.len(), 1)] {
        budget.take(count, each)?;
    }
    for extra in extras(checked, n, &(0..0))? {
        budget.take(n, extra.values.width())?;
    }
    let order = if checked.has(tensor::ORDER) {
        budget.take(n, size_of::<u32>())?;
        Some(checked.values(tensor::ORDER, Dtype::U32, &[n])?)
    } else {
        None
    };
    Ok(Packed { extras: extras(checked, n, &(0..n))?, order, data: data(checked)?.to_vec(), ..head })
}

/// The data of a packed file.
pub(super) fn data<'a>(checked: &Checked<'a>) -> Result<&'a [u8]> {
    checked.data(tensor::DATA, Dtype::U8, &length(checked, tensor::DATA, Dtype::U8)?)
}

fn length(checked: &Checked<'_>, name: &str, dtype: Dtype) -> Result<[usize; 1]> {
    match checked.view(name)?.shape() {
        [len] => Ok([*len]),
        shape => Err(checked.malformed(format!("tensor '{name}' is {dtype:?} {shape:?}, not a list"))),
    }
}

/// Everything of a packed scene that is not as long as the scene; all is looked at.
pub(super) fn head(checked: &Checked<'_>, file_bytes: u64, limits: &Limits) -> Result<Packed> {
    let gaussians: u64 = checked.number(key::GAUSSIANS)?;
    limits.check_gaussians(checked.file, gaussians)?;
    let what = format!("Gaussians in {}, for its {file_bytes} bytes", checked.file);
    Limits::check(&what, gaussians, file_bytes.saturating_mul(GAUSSIANS_PER_BYTE))?;
    let atoms = checked.number(key::ATOMS)?;
    limits.check_atoms(checked.file, atoms)?;
    let gaussians = usize::try_from(gaussians).map_err(|_| checked.malformed("too many Gaussians"))?;
    let mut known =
        vec![tensor::PARAMETERS, tensor::LENGTHS, tensor::TABLES, tensor::DATA, tensor::HEADER_CHECKSUM];
    if checked.has(tensor::ORDER) {
        known.push(tensor::ORDER);
        if !is_permutation(checked, gaussians)? {
            return Err(checked.malformed("tensor 'packed.order' is not a permutation"));
        }
    }
    let ignored = |name: &str| name.starts_with(EXTRA_PREFIX) || name.starts_with(IGNORED_PREFIX);
    if let Some(name) = checked.names().iter().find(|name| !known.contains(name) && !ignored(name)) {
        return Err(checked.malformed(format!("tensor '{name}' is not known for layout 'packed'")));
    }
    let chunks = gaussians.div_ceil(CHUNK);
    let target = match checked.optional::<String>(key::PROMISE)? {
        None => None,
        Some(text) => Some(
            serde_json::from_str::<TargetRecord>(&text)
                .map_err(|e| checked.malformed(format!("metadata 'promise': {e}")))?,
        ),
    };
    extras(checked, gaussians, &(0..0))?;
    data(checked)?;
    Ok(Packed {
        degree: degree(checked)?,
        gaussians,
        atoms: usize::try_from(atoms).map_err(|_| checked.malformed("too many atoms"))?,
        atom_bits: checked.number(key::ATOM_BITS)?,
        record: record(checked)?,
        meta: meta(checked)?,
        extras: Vec::new(),
        order: None,
        target,
        device: checked.optional(key::DRAWN_ON)?,
        parameters: checked.values(
            tensor::PARAMETERS,
            Dtype::F32,
            &length(checked, tensor::PARAMETERS, Dtype::F32)?,
        )?,
        lengths: checked.values(tensor::LENGTHS, Dtype::U32, &[2 * (chunks + 1)])?,
        tables: checked.values(tensor::TABLES, Dtype::U8, &length(checked, tensor::TABLES, Dtype::U8)?)?,
        data: Vec::new(),
        limits: *limits,
    })
}

/// Whether the order names each of `n` Gaussians once.
fn is_permutation(checked: &Checked<'_>, n: usize) -> Result<bool> {
    let data = checked.data(tensor::ORDER, Dtype::U32, &[n])?;
    let mut seen = vec![0_u64; n.div_ceil(64)];
    for place in data.as_chunks::<4>().0 {
        let place = u32::from_le_bytes(*place) as usize;
        let Some(word) = seen.get_mut(place / 64).filter(|_| place < n) else { return Ok(false) };
        let bit = 1 << (place % 64);
        if *word & bit != 0 {
            return Ok(false);
        }
        *word |= bit;
    }
    Ok(true)
}

/// What of a packed scene is as long as the scene, set aside.
#[derive(Debug)]
pub(crate) struct SpilledPacked {
    pub(crate) data: Spilled,
    pub(crate) order: Option<Spilled>,
    pub(crate) extras: Extras,
}

/// Writes the file of `head`, which lacks what is in `spilled`, with `write`, which is given what to do with
/// a writer. Returns what [`packed_tensor_bytes`] does of the whole.
pub(crate) fn write_spilled_packed(
    head: &Packed,
    spilled: SpilledPacked,
    write: impl FnOnce(&mut dyn FnMut(&mut dyn Write) -> std::io::Result<()>, u64) -> Result<()>,
) -> Result<Vec<(String, u64)>> {
    let (metadata, mut tensors) = contents(head);
    let n = head.gaussians;
    let bytes = head.lengths.iter().map(|&l| l as usize).sum();
    let data = Tensor::spilled(tensor::DATA, Dtype::U8, &[bytes], spilled.data);
    tensors.retain(|t| t.name != tensor::DATA);
    tensors.push(data);
    if let Some(order) = spilled.order {
        tensors.push(Tensor::spilled(tensor::ORDER, Dtype::U32, &[n], order));
    }
    tensors.extend(spilled.extras.tensors(n)?);
    write_tensors(metadata, tensors, write)
}

fn draft(packed: &Packed) -> Draft<'_> {
    let (metadata, tensors) = contents(packed);
    Draft::new(metadata, tensors)
}

fn contents(packed: &Packed) -> (BTreeMap<String, String>, Vec<Tensor<'_>>) {
    let mut metadata = preamble(FORMAT, PACKED_VERSION);
    put_record(&mut metadata, packed.degree, &packed.record, &packed.meta);
    let mut put = |key: &str, value: String| metadata.insert(key.to_owned(), value);
    put(key::GAUSSIANS, packed.gaussians.to_string());
    put(key::ATOMS, packed.atoms.to_string());
    put(key::ATOM_BITS, packed.atom_bits.to_string());
    if let Some(target) = &packed.target {
        put(key::PROMISE, serde_json::to_string(target).unwrap_or_default());
    }
    if let Some(device) = &packed.device {
        put(key::DRAWN_ON, device.clone());
    }
    (metadata, tensors(packed))
}

fn tensors(packed: &Packed) -> Vec<Tensor<'_>> {
    let n = packed.gaussians;
    let mut out = vec![
        Tensor::plain(tensor::PARAMETERS, Dtype::F32, &[packed.parameters.len()], &packed.parameters),
        Tensor::plain(tensor::LENGTHS, Dtype::U32, &[packed.lengths.len()], &packed.lengths),
        Tensor::plain(tensor::TABLES, Dtype::U8, &[packed.tables.len()], &packed.tables),
        Tensor::plain(tensor::DATA, Dtype::U8, &[packed.data.len()], &packed.data),
    ];
    if let Some(order) = &packed.order {
        out.push(Tensor::plain(tensor::ORDER, Dtype::U32, &[n], order));
    }
    out.extend(extra_tensors(&packed.extras, n));
    out
}
