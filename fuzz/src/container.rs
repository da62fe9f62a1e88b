//! Mutations of .lexi files that leave lengths, offsets and checksums right, so that what lies behind them
//! is reached.

use lexisplat::ShDegree;
use lexisplat::packed::fuzzing;
use serde_json::{Map, Value, json};

/// Bytes after a file that say how it is fed, in the target `feed`.
pub const FEED_SCRIPT: usize = 32;
/// One time in so many the bytes are changed as they lie, and nothing is made to fit.
const RAW: usize = 8;
/// Bytes of the checksum of header and head that a packed head starts with.
const SEAL: usize = 4;
/// Most bytes a tensor may grow by in one mutation.
const GROWTH: usize = 64;
/// Types of tensors, known ones and one that no reader takes.
const DTYPES: [(&str, usize); 11] = [
    ("U8", 1),
    ("I8", 1),
    ("I16", 2),
    ("U16", 2),
    ("F16", 2),
    ("I32", 4),
    ("U32", 4),
    ("F32", 4),
    ("F64", 8),
    ("BF16", 2),
    ("BOOL", 1),
];
/// Names of tensors, so that one may turn up where it does not belong.
const NAMES: [&str; 20] = [
    "position",
    "dc",
    "opacity",
    "scale",
    "rotation",
    "normal",
    "dictionary",
    "codes.counts",
    "codes.pointers",
    "codes.indices",
    "codes.values",
    "escapes.gaussians",
    "escapes.rows",
    "extra.a",
    "extra.",
    "x-new",
    "packed.data",
    "packed.order",
    "packed.head",
    "checksum.header",
];
/// Values of metadata that mean something to some key.
const VALUES: [&str; 28] = [
    "0",
    "1",
    "2",
    "3",
    "4",
    "5",
    "14",
    "15",
    "72",
    "255",
    "256",
    "257",
    "1024",
    "1025",
    "32768",
    "32769",
    "4294967295",
    "18446744073709551615",
    "-1",
    "0.1",
    "1e308",
    "nan",
    "inf",
    "true",
    "f32",
    "f16",
    "paper",
    "packed",
];

/// Repeatable numbers (Knuth's MMIX generator) from libFuzzer's seed.
struct Random(u64);

impl Random {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(self.0 >> 33).unwrap_or(0) % bound.max(1)
    }

    fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len())]
    }
}

struct Tensor {
    name: String,
    dtype: Value,
    shape: Vec<u64>,
    bytes: Vec<u8>,
}

impl Tensor {
    /// Puts other bytes into a list of bytes.
    fn replace(&mut self, bytes: Vec<u8>) {
        self.shape = vec![bytes.len() as u64];
        self.bytes = bytes;
    }
}

/// A file as its parts.
struct Parts {
    metadata: Map<String, Value>,
    tensors: Vec<Tensor>,
}

impl Parts {
    /// `None` if `bytes` are no such file.
    fn of(bytes: &[u8]) -> Option<Self> {
        let (length, rest) = bytes.split_first_chunk::<8>()?;
        let length = usize::try_from(u64::from_le_bytes(*length)).ok()?;
        let (header, data) = rest.split_at_checked(length)?;
        let Value::Object(mut entries) = serde_json::from_slice(header).ok()? else { return None };
        let metadata = match entries.remove("__metadata__") {
            Some(Value::Object(metadata)) => metadata,
            _ => Map::new(),
        };
        let mut tensors = Vec::new();
        for (name, entry) in entries {
            let at = |i: usize| usize::try_from(entry["data_offsets"][i].as_u64()?).ok();
            let bytes = data.get(at(0)?..at(1)?)?.to_vec();
            let shape = entry["shape"].as_array()?.iter().filter_map(Value::as_u64).collect();
            tensors.push(Tensor { name, dtype: entry["dtype"].clone(), shape, bytes });
        }
        Some(Self { metadata, tensors })
    }

    /// Makes the checksums of the ranges of a packed scene fit its data, if its head can be read.
    fn fit_ranges(&mut self) {
        let Some((degree, [head, data])) = self.packed() else { return };
        let data = &self.tensors[data].bytes;
        let Some((own, rest)) = self.tensors[head].bytes.split_first_chunk::<SEAL>() else { return };
        let Some(sealed) = fuzzing::resealed(rest, degree, data) else { return };
        self.tensors[head].bytes = [own, &sealed[..]].concat();
    }

    /// The file, with offsets and checksums that fit, and names that differ.
    fn sealed(&self) -> Vec<u8> {
        let (mut header, mut sums, mut data, mut own) = (Map::new(), Map::new(), Vec::new(), None);
        // The head of a packed file has the checksum of header and head, and those of the ranges of the data.
        let is_version_3 = self.metadata.get("version").and_then(Value::as_str) == Some("3");
        let is_packed = is_version_3 && self.tensors.iter().any(|tensor| tensor.name == "packed.head");
        let mut sealed = &[][..];
        for tensor in &self.tensors {
            if header.contains_key(&tensor.name) {
                continue;
            }
            let start = data.len();
            data.extend_from_slice(&tensor.bytes);
            let range = start..data.len();
            let entry =
                json!({"dtype": tensor.dtype, "shape": tensor.shape, "data_offsets": [start, data.len()]});
            header.insert(tensor.name.clone(), entry);
            if is_packed && tensor.name == "packed.data" {
                continue;
            }
            if is_packed && tensor.name == "packed.head" {
                if let Some((_, rest)) = tensor.bytes.split_first_chunk::<SEAL>() {
                    (own, sealed) = (Some(range.start..range.start + SEAL), rest);
                }
            } else if !is_packed && tensor.name == "checksum.header" {
                own = (range.len() == SEAL).then_some(range);
            } else {
                let sum = format!("{:08x}", crc32fast::hash(&tensor.bytes));
                sums.insert(tensor.name.clone(), Value::String(sum));
            }
        }
        let mut metadata = self.metadata.clone();
        if metadata.contains_key("checksums") {
            metadata.insert("checksums".to_owned(), Value::String(Value::Object(sums).to_string()));
        }
        header.insert("__metadata__".to_owned(), Value::Object(metadata));
        let text = Value::Object(header).to_string();
        let mut out = (text.len() as u64).to_le_bytes().to_vec();
        out.extend_from_slice(text.as_bytes());
        let mut sum = crc32fast::Hasher::new();
        sum.update(&out);
        sum.update(sealed);
        if let Some(slot) = own {
            data[slot].copy_from_slice(&sum.finalize().to_le_bytes());
        }
        out.extend_from_slice(&data);
        out
    }

    /// Changes one thing. `mutate` changes a buffer's first bytes and returns how many then count.
    fn change(&mut self, random: &mut Random, mutate: &mut dyn FnMut(&mut [u8], usize) -> usize) {
        let which = random.below(self.tensors.len());
        match random.below(18) {
            0..=8 => {
                let Some(tensor) = self.tensors.get_mut(which) else { return };
                change_bytes(tensor, random, mutate);
            }
            9..=12 => self.change_metadata(random, mutate),
            13 => {
                let Some(tensor) = self.tensors.get_mut(which) else { return };
                let (dtype, _) = random.pick(&DTYPES);
                match random.below(4) {
                    0 => tensor.dtype = Value::from(dtype),
                    1 => tensor.name = random.pick(&NAMES).to_owned(),
                    2 if !tensor.shape.is_empty() => {
                        let at = random.below(tensor.shape.len());
                        tensor.shape[at] = random.pick(&[0, 1, 2, 3, 4, 9, 45, 1024, 1 << 31, u64::MAX]);
                    }
                    _ => tensor.shape.push(1),
                }
            }
            14 => self.cut(random),
            16 | 17 => self.rearrange(random),
            _ => {
                let name = random.pick(&NAMES).to_owned();
                let bytes = self.tensors.get(which).map(|t| t.bytes.clone()).unwrap_or_default();
                let (dtype, size) = random.pick(&DTYPES);
                let shape = vec![(bytes.len() / size) as u64];
                if random.below(3) == 0 && which < self.tensors.len() {
                    drop(self.tensors.remove(which));
                } else {
                    self.tensors.push(Tensor { name, dtype: Value::from(dtype), shape, bytes });
                }
            }
        }
    }

    /// Changes what the index of a packed scene says of chunks and ranges.
    fn rearrange(&mut self, random: &mut Random) {
        let Some((degree, [head, data])) = self.packed() else { return };
        let Some((own, rest)) = self.tensors[head].bytes.split_first_chunk::<SEAL>() else { return };
        let changed =
            fuzzing::rearranged(rest, degree, &self.tensors[data].bytes, &mut |bound| random.below(bound));
        let Some((rest, bytes, gaussians)) = changed else { return };
        let head_bytes = [own, &rest[..]].concat();
        self.tensors[head].replace(head_bytes);
        self.tensors[data].replace(bytes);
        self.metadata.insert("gaussians".to_owned(), Value::from(gaussians.to_string()));
    }

    /// Degree, and offsets of head and data of a packed scene.
    fn packed(&self) -> Option<(ShDegree, [usize; 2])> {
        let degree = self.metadata.get("degree")?.as_str()?.parse().ok()?;
        let at = |name: &str| self.tensors.iter().position(|tensor| tensor.name == name);
        Some((ShDegree::new(degree).ok()?, [at("packed.head")?, at("packed.data")?]))
    }

    /// Takes Gaussians off the end of every tensor that has one entry for each, or adds copies of the last.
    fn cut(&mut self, random: &mut Random) {
        let Some(n) =
            self.tensors.iter().find(|t| t.name == "position").and_then(|t| t.shape.first().copied())
        else {
            return;
        };
        let wanted = random.below(usize::try_from(n).unwrap_or(0).saturating_add(4)) as u64;
        for tensor in self.tensors.iter_mut().filter(|t| t.shape.first() == Some(&n)) {
            let Some(row) = usize::try_from(n).ok().and_then(|n| tensor.bytes.len().checked_div(n)) else {
                continue;
            };
            tensor.bytes.resize(row * usize::try_from(wanted).unwrap_or(0), 0);
            tensor.shape[0] = wanted;
        }
    }

    fn change_metadata(&mut self, random: &mut Random, mutate: &mut dyn FnMut(&mut [u8], usize) -> usize) {
        let keys: Vec<String> = self.metadata.keys().cloned().collect();
        let Some(key) = keys.get(random.below(keys.len())) else { return };
        match random.below(6) {
            0 => drop(self.metadata.remove(key)),
            1 | 2 => drop(self.metadata.insert(key.clone(), Value::from(random.pick(&VALUES)))),
            _ => {
                let Some(text) = self.metadata.get(key).and_then(Value::as_str) else { return };
                let mut bytes = text.as_bytes().to_vec();
                let len = bytes.len();
                bytes.resize(len + GROWTH, 0);
                let len = mutate(&mut bytes, len);
                bytes.truncate(len);
                let text = String::from_utf8_lossy(&bytes).into_owned();
                self.metadata.insert(key.clone(), Value::from(text));
            }
        }
    }
}

/// Changes bytes of a tensor; its shape follows where a list got longer or shorter.
fn change_bytes(tensor: &mut Tensor, random: &mut Random, mutate: &mut dyn FnMut(&mut [u8], usize) -> usize) {
    // A window, since changes should not only fall into the largest tensors' beginnings.
    let start = random.below(tensor.bytes.len() + 1);
    let width = random.below(64) + 1;
    let end = (start + width).min(tensor.bytes.len());
    let mut window = tensor.bytes[start..end].to_vec();
    let len = window.len();
    let room = if random.below(4) == 0 { GROWTH } else { 0 };
    window.resize(len + room, 0);
    if window.is_empty() {
        window.push(0);
    }
    let new = mutate(&mut window, len);
    window.truncate(new);
    if room == 0 {
        // Of the same length: only values changed.
        window.resize(len, 0);
    }
    tensor.bytes.splice(start..end, window);
    let dtype = tensor.dtype.as_str().unwrap_or_default();
    let size = DTYPES.iter().find(|d| d.0 == dtype).map_or(1, |d| d.1);
    let widths = tensor.shape.iter().skip(1).map(|&s| usize::try_from(s).unwrap_or(1));
    let row = widths.fold(size, usize::saturating_mul);
    if random.below(8) > 0 && row > 0 {
        let rows = tensor.bytes.len() / row;
        tensor.bytes.truncate(rows * row);
        if let Some(first) = tensor.shape.first_mut() {
            *first = rows as u64;
        }
    }
}

/// A mutator for libFuzzer over .lexi files: changes what `data` begins with, `size` bytes, within
/// `max_size`, by `seed`. `mutate` is libFuzzer's own, by buffer and length. Returns the new length.
pub fn mutate(
    data: &mut [u8],
    size: usize,
    max_size: usize,
    seed: u32,
    mut mutate: impl FnMut(&mut [u8], usize) -> usize,
) -> usize {
    let mut random = Random(u64::from(seed));
    let parts = if random.below(RAW) == 0 { None } else { Parts::of(&data[..size]) };
    if let Some(mut parts) = parts {
        for _ in 0..1 + random.below(3) {
            parts.change(&mut random, &mut mutate);
        }
        parts.fit_ranges();
        let bytes = parts.sealed();
        if let Some(slot) = data[..max_size].get_mut(..bytes.len()) {
            slot.copy_from_slice(&bytes);
            return bytes.len();
        }
    }
    mutate(&mut data[..max_size], size)
}

/// [`mutate`] for inputs that end with `after` bytes that are no part of the file, of which some change too.
pub fn mutate_before(
    data: &mut [u8],
    size: usize,
    max_size: usize,
    seed: u32,
    after: usize,
    mut mutate: impl FnMut(&mut [u8], usize) -> usize,
) -> usize {
    let (Some(file), Some(room)) = (size.checked_sub(after), max_size.checked_sub(after)) else {
        return mutate(&mut data[..max_size], size);
    };
    let mut tail = data[file..size].to_vec();
    let mut random = Random(u64::from(seed));
    let which = random.below(4);
    if which == 0 {
        let at = random.below(after);
        tail[at] = random.below(1 << 8).to_le_bytes()[0];
    }
    if which < 2 {
        let new = mutate(&mut tail, after);
        tail[new.min(after)..].fill(0);
    }
    let file = if which > 0 { self::mutate(data, file, room, seed.rotate_left(7), mutate) } else { file };
    data[file..file + after].copy_from_slice(&tail);
    file + after
}
