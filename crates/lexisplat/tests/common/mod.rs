//! Small hand-made models that several tests share.
#![allow(
    dead_code,
    unreachable_pub,
    clippy::unwrap_used,
    reason = "each test binary uses a part; a test may panic"
)]

use half::f16;
use lexisplat::lexi::{LexiReader, LexiWriter};
use lexisplat::pursuit::ValueType;
use lexisplat::{
    CodeLayout, Dictionary, Escapes, Extra, ExtraValues, Geometry, Indices, Limits, Model, Pursuit, Record,
    Result, SceneMeta, ShDegree, Silent, SparseCodes, Splats, Values,
};
use lexisplat_sample::{SampleOptions, scene};
use serde_json::Value;

/// A number in a small range, exact in f16, from an index: no library decides what the files hold.
pub fn plain(i: usize) -> f32 {
    let steps = u8::try_from(i * 37 % 64).unwrap();
    f32::from(steps) / 16.0 - 2.0
}

fn rows<const W: usize>(n: usize, start: usize) -> Vec<[f32; W]> {
    (0..n).map(|i| std::array::from_fn(|c| plain(start + i * W + c))).collect()
}

fn geometry(n: usize) -> Geometry {
    Geometry {
        positions: rows(n, 1),
        normals: Vec::new(),
        dc: rows(n, 2),
        opacities: (0..n).map(|i| plain(i + 3)).collect(),
        scales: rows(n, 4),
        rotations: rows(n, 5),
        extras: Vec::new(),
    }
}

/// Atoms `0.6 e_a + 0.8 e_b`.
fn dictionary(degree: ShDegree, atoms: usize) -> Dictionary {
    let dim = degree.rest();
    let mut values = vec![0.0; atoms * dim];
    for (j, atom) in values.chunks_exact_mut(dim).enumerate() {
        let first = j % dim;
        atom[first] = 0.6;
        atom[(first + 1 + (j / dim) % (dim - 1)) % dim] = 0.8;
    }
    Dictionary::new(degree, values).unwrap()
}

fn model(
    degree: u8,
    atoms: usize,
    values: ValueType,
    escape: bool,
    change: impl FnOnce(&mut Geometry, &mut Record),
) -> Model {
    let (n, degree) = (5, ShDegree::new(degree).unwrap());
    let mut record = Record {
        tolerance: Some(0.1),
        max_nonzeros: None,
        pursuit: Some(Pursuit::Ols),
        seed: 7,
        max_residual: 0.0625,
        rms_residual: 0.03125,
        over_tolerance: 0,
    };
    let counts: Vec<u8> = if degree.rest() == 0 { vec![0; n] } else { vec![2, 0, 3, 0, 1] };
    let nonzeros = counts.iter().map(|&c| usize::from(c)).sum::<usize>();
    let dictionary = if degree.rest() == 0 { Dictionary::empty() } else { dictionary(degree, atoms) };
    // Ascending within each Gaussian, whatever the number of atoms.
    let picks: Vec<usize> = [0, atoms.saturating_sub(1), 0, 1, 2, 3][..nonzeros].to_vec();
    let indices = match Indices::for_atoms(atoms) {
        Indices::U8(_) => Indices::U8(picks.iter().map(|&p| u8::try_from(p).unwrap()).collect()),
        Indices::U16(_) => Indices::U16(picks.iter().map(|&p| u16::try_from(p).unwrap()).collect()),
    };
    let numbers: Vec<f32> = (0..nonzeros).map(|k| plain(k + 11)).collect();
    let values = match values {
        ValueType::F16 => Values::F16(numbers.iter().map(|&v| f16::from_f32(v)).collect()),
        ValueType::F32 => Values::F32(numbers),
    };
    let escapes = if escape {
        Escapes { gaussians: vec![3], rows: (0..degree.rest()).map(|d| plain(d + 23)).collect() }
    } else {
        Escapes::default()
    };
    let codes = SparseCodes::new(&dictionary, counts, indices, values, escapes).unwrap();
    let meta = SceneMeta {
        comments: vec!["made by \"hand\"".to_owned()],
        antialiased: escape,
        ..SceneMeta::default()
    };
    let mut geometry = geometry(n);
    change(&mut geometry, &mut record);
    Model::new(geometry, meta, dictionary, codes, record).unwrap()
}

/// Every kind of file, by the name of its golden copy.
pub fn models() -> Vec<(&'static str, CodeLayout, Model)> {
    use ValueType::{F16, F32};
    let rich = |geometry: &mut Geometry, record: &mut Record| {
        geometry.normals = rows(5, 9);
        geometry.extras = vec![
            Extra { name: "label".to_owned(), values: ExtraValues::U8(vec![1, 2, 3, 4, 255]) },
            Extra { name: "time".to_owned(), values: ExtraValues::F64(vec![0.5, -1.0, f64::MAX, 0.0, 3.25]) },
        ];
        record.tolerance = None;
        record.max_nonzeros = Some(3);
    };
    vec![
        ("f32", CodeLayout::Compact, model(3, 8, F32, false, |_, _| ())),
        ("f16", CodeLayout::Compact, model(3, 8, F16, false, |_, _| ())),
        ("paper", CodeLayout::Paper, model(2, 8, F32, false, |_, _| ())),
        ("degree0", CodeLayout::Compact, model(0, 0, F16, false, |_, _| ())),
        ("degree4", CodeLayout::Compact, model(4, 5, F16, true, |_, _| ())),
        ("degree1_u16_escapes", CodeLayout::Compact, model(1, 300, F32, true, rich)),
    ]
}

/// The bytes of `model` as written today.
pub fn written(model: &Model, codes: CodeLayout) -> Vec<u8> {
    let mut bytes = Vec::new();
    LexiWriter::exact(model, codes).unwrap().write(&mut bytes, &Silent).unwrap();
    bytes
}

/// A file of `header` and `data` with all checksums made to fit again, as far as the header allows.
pub fn reseal(header: &mut Value, data: &mut [u8]) -> Vec<u8> {
    let range = |entry: &Value| -> Option<std::ops::Range<usize>> {
        let offsets = entry.get("data_offsets")?;
        let at = |i: usize| usize::try_from(offsets.get(i)?.as_u64()?).ok();
        Some(at(0)?..at(1)?)
    };
    let mut sums = serde_json::Map::new();
    let mut own = None;
    // In packed files the checksum of the header is in the first four bytes of the head, which it covers too.
    let sealed = header.get("packed.head").and_then(range);
    for (name, entry) in header.as_object().unwrap() {
        if name == "checksum.header" {
            own = range(entry);
        } else if name != "__metadata__"
            && (sealed.is_none() || !["packed.head", "packed.data"].contains(&name.as_str()))
            && let Some(bytes) = range(entry).and_then(|r| data.get(r))
        {
            sums.insert(name.clone(), Value::String(format!("{:08x}", crc32fast::hash(bytes))));
        }
    }
    if let Some(slot) = header.get_mut("__metadata__").and_then(|m| m.get_mut("checksums"))
        && slot.is_string()
    {
        *slot = Value::String(Value::Object(sums).to_string());
    }
    let text = header.to_string();
    let mut out = (text.len() as u64).to_le_bytes().to_vec();
    out.extend_from_slice(text.as_bytes());
    let mut sum = crc32fast::hash(&out).to_le_bytes();
    if let Some((_, head)) =
        sealed.clone().and_then(|r| data.get(r)).and_then(|head| head.split_first_chunk::<4>())
    {
        let mut crc = crc32fast::Hasher::new_with_initial_len(u32::from_le_bytes(sum), out.len() as u64);
        crc.update(head);
        sum = crc.finalize().to_le_bytes();
        own = sealed.map(|r| r.start..r.start + sum.len());
    }
    if let Some(slot) = own.and_then(|r| data.get_mut(r))
        && slot.len() == sum.len()
    {
        slot.copy_from_slice(&sum);
    }
    out.extend_from_slice(data);
    out
}

/// How many Gaussians a file read part by part has.
pub fn count_in_parts(bytes: &[u8]) -> Result<usize> {
    let mut gaussians = 0;
    LexiReader::open("mutated.lexi", bytes, &Limits::default())?.each(&mut |_, part| {
        gaussians += part.len();
        Ok(())
    })?;
    Ok(gaussians)
}

/// One Gaussian again and again, with nothing but geometry.
pub fn copies(count: usize) -> Splats {
    let one = scene(&SampleOptions::new(1, 1)).geometry;
    let geometry = Geometry {
        positions: one.positions.repeat(count),
        dc: one.dc.repeat(count),
        opacities: one.opacities.repeat(count),
        scales: one.scales.repeat(count),
        rotations: one.rotations.repeat(count),
        ..Geometry::default()
    };
    Splats { geometry, degree: ShDegree::ZERO, sh_rest: Vec::new(), meta: SceneMeta::default() }
}
