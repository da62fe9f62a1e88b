//! Ways to change a packed file that leave its container and the checksums of its ranges whole.

use lexisplat_testing::Random;
use serde_json::Value;

use crate::parts::Parts;

/// Tensors that are changed as they lie.
pub(crate) const TENSORS: [&str; 3] = ["packed.head", "packed.data", "packed.order"];
/// Bytes of the checksum that a head starts with.
const SEAL: usize = 4;
/// Bytes of numbers of fixed size: grid, step, mean and turn of base colours; steps; softening; a point of view of f24.
const VALUES: usize = 8 * 4 + 4 * 2;
const STEPS: usize = 5 * 3;
const SOFTENING: usize = 4;
const POINT: usize = 3 * 3;
/// Bytes of the bounds of a chunk, and of the two checksums of a range.
const BOUNDS: usize = 6 * 2;
const SUM: usize = 4;
/// Marks a sorted index.
const SORTED: u8 = 1 << 7;
/// Marks a head whose last atoms are fixed.
const FIXED: u8 = 1 << 7;
/// Ways to write a number of 7 bits a byte as no writer does.
pub(crate) const FORMS: [Form; 3] = [Form::Longer, Form::Endless, Form::Above];

/// A way to write a number of 7 bits a byte as no writer does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Form {
    /// With a byte of zeros at its end.
    Longer,
    /// With more bits than 64.
    Endless,
    /// More by 2^32.
    Above,
}

/// Where a number of 7 bits a byte lies in a head.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Number {
    at: usize,
    bytes: usize,
    value: u64,
    /// Whether it may be 2^32 or more: that of a cell.
    pub(crate) is_long: bool,
}

#[derive(Clone, Default)]
struct Chunk {
    layer: u8,
    gaussians: u64,
    cell: u64,
    /// None if there is no other chunk.
    bounds: Vec<u8>,
}

#[derive(Clone, Default)]
struct Range {
    chunk: u64,
    kind: u8,
    length: u64,
    /// Checksums of bytes and of integers.
    sums: [[u8; SUM]; 2],
    /// Where they are in the head.
    at: usize,
}

/// The layers, chunks and ranges of a head, and the positions of their numbers.
#[derive(Clone, Default)]
pub(crate) struct Index {
    /// Bytes of the head before it.
    start: usize,
    /// Where tables and dictionary are.
    tables: std::ops::Range<usize>,
    dictionary: std::ops::Range<usize>,
    /// All numbers of 7 bits a byte of the head.
    pub(crate) numbers: Vec<Number>,
    pub(crate) is_sorted: bool,
    levels: Vec<u8>,
    chunks: Vec<Chunk>,
    ranges: Vec<Range>,
}

/// A number of 7 bits a byte.
fn number(mut value: u64) -> Vec<u8> {
    let mut out = Vec::new();
    while value >= 0x80 {
        out.push(value.to_le_bytes()[0] | 0x80);
        value >>= 7;
    }
    out.push(value.to_le_bytes()[0]);
    out
}

/// Takes what a head consists of. Every method returns `None` where too few bytes are left.
struct Head<'h> {
    bytes: &'h [u8],
    at: usize,
    numbers: Vec<Number>,
}

impl Head<'_> {
    fn take(&mut self, count: usize) -> Option<&[u8]> {
        let taken = self.bytes.get(self.at..)?.get(..count)?;
        self.at += count;
        Some(taken)
    }

    fn byte(&mut self) -> Option<u8> {
        self.take(1).map(|taken| taken[0])
    }

    fn sum(&mut self) -> Option<[u8; SUM]> {
        self.take(SUM)?.try_into().ok()
    }

    /// A number, in whatever form.
    fn number(&mut self, is_long: bool) -> Option<u64> {
        let (at, mut value) = (self.at, 0);
        for shift in (0..u64::BITS).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                self.numbers.push(Number { at, bytes: self.at - at, value, is_long });
                return Some(value);
            }
        }
        None
    }

    /// Where a list of bytes lies whose length is before it.
    fn list(&mut self) -> Option<std::ops::Range<usize>> {
        let length = usize::try_from(self.number(false)?).ok()?;
        self.take(length)?;
        Some(self.at - length..self.at)
    }
}

impl Index {
    /// Returns the index of a file as it was written.
    pub(crate) fn of(parts: &mut Parts) -> Self {
        let data = parts.tensor("packed.data").unwrap().len() as u64;
        let head = parts.tensor("packed.head").unwrap();
        let index = Self::read(head).unwrap();
        assert_eq!(index.ranges.iter().map(|range| range.length).sum::<u64>(), data, "ranges cover the data");
        assert_eq!(head[index.start..], index.written(), "the index comes back");
        index
    }

    /// Reads a head, which may be damaged, by the rules of docs/FORMAT.md.
    fn read(head: &[u8]) -> Option<Self> {
        let mut from = Head { bytes: head, at: SEAL, numbers: Vec::new() };
        from.number(false)?;
        let (flags, exponent) = (from.byte()?, from.byte()?);
        let (points, parts, interim) =
            (usize::from(flags & 15), usize::from(flags >> 4 & 3), exponent >> 7 == 1);
        from.take(parts.saturating_sub(1))?;
        for _ in 0..if interim { 3 } else { 0 } {
            from.number(false)?;
        }
        let softening = if points > 0 { SOFTENING } else { 0 };
        from.take(VALUES + softening + POINT * points + STEPS)?;
        let [_, tables, dictionary] = [from.list()?, from.list()?, from.list()?];
        let start = from.at;
        let layers = from.byte()?;
        let levels = from.take(usize::from(layers & !SORTED))?.to_vec();
        let mut index = Self { start, tables, dictionary, levels, ..Self::default() };
        index.is_sorted = layers & SORTED > 0;
        let count = from.number(false)?;
        let mut ids = Vec::new();
        for c in 0..count {
            let chunk = Chunk {
                layer: from.byte()?,
                gaussians: from.number(false)?,
                cell: from.number(true)?,
                bounds: from.take(if count > 1 { BOUNDS } else { 0 })?.to_vec(),
            };
            let levels = index.levels.get(usize::from(chunk.layer))?;
            let has_interim = interim && usize::from(chunk.layer) + 1 < index.levels.len();
            let kinds = 1 + usize::from(*levels) + parts + usize::from(has_interim);
            ids.extend((0..u8::try_from(kinds).ok()?).map(|kind| (c, kind)));
            index.chunks.push(chunk);
        }
        for id in ids {
            let (chunk, kind) = if index.is_sorted { id } else { (from.number(false)?, from.byte()?) };
            let (length, at) = (from.number(false)?, from.at);
            index.ranges.push(Range { chunk, kind, length, sums: [from.sum()?, from.sum()?], at });
        }
        index.numbers = from.numbers;
        Some(index)
    }

    /// The bytes of the index.
    fn written(&self) -> Vec<u8> {
        let layers = u8::try_from(self.levels.len()).unwrap();
        let mut out = vec![if self.is_sorted { layers | SORTED } else { layers }];
        out.extend(&self.levels);
        out.extend(number(self.chunks.len() as u64));
        for chunk in &self.chunks {
            out.push(chunk.layer);
            out.extend([number(chunk.gaussians), number(chunk.cell), chunk.bounds.clone()].concat());
        }
        for range in &self.ranges {
            if !self.is_sorted {
                out.extend(number(range.chunk));
                out.push(range.kind);
            }
            out.extend(number(range.length));
            out.extend(range.sums.as_flattened());
        }
        out
    }

    /// Puts the index into the head of `parts`.
    fn put(&self, parts: &mut Parts) {
        let head = parts.tensor("packed.head").unwrap();
        head.truncate(self.start);
        head.extend(self.written());
        parts.fit_shapes();
    }

    /// Marks the index as sorted if its ranges are.
    fn fit_mark(&mut self) {
        self.is_sorted = self.ranges.is_sorted_by_key(|range| (range.chunk, range.kind));
    }

    /// Makes the checksums of all ranges of a file fit its data, as far as its head can be read. Changes nothing else.
    pub(crate) fn seal(parts: &mut Parts) {
        let data = parts.tensor("packed.data").cloned().unwrap_or_default();
        let Some(head) = parts.tensor("packed.head") else { return };
        let Some(index) = Self::read(head) else { return };
        let mut start = 0_usize;
        for range in &index.ranges {
            let length = usize::try_from(range.length).unwrap_or(usize::MAX);
            let bytes = data.get(start.min(data.len())..).unwrap_or_default();
            let sum = crc32fast::hash(&bytes[..length.min(bytes.len())]);
            head[range.at..][..SUM].copy_from_slice(&sum.to_le_bytes());
            start = start.saturating_add(length);
        }
    }

    /// Changes bytes of the head before the index, of which most are tables.
    pub(crate) fn change_head(&self, parts: &mut Parts, random: &mut Random) {
        let head = parts.tensor("packed.head").unwrap();
        let end = self.start;
        let several = 1 + random.below(4);
        for _ in 0..several {
            let (at, width) = (random.below(end), 1 + random.below(4));
            let noise = [random.byte(), 0, 0xff, 0x7f, 0x80][random.below(5)];
            match random.below(8) {
                0 => head[at] ^= 1 << random.below(8),
                1 => head[at] = random.byte(),
                2 => head[at] = head[at].wrapping_add(1),
                // The bytes that follow keep their order and move.
                3 if several == 1 => drop(head.drain(at..(at + width).min(end))),
                4 if several == 1 => drop(head.splice(at..at, vec![noise; width])),
                _ => head[at..(at + width).min(end)].fill(noise),
            }
        }
        parts.fit_shapes();
    }

    /// Changes bytes of some ranges.
    pub(crate) fn change_data(parts: &mut Parts, random: &mut Random) {
        let data = parts.tensor("packed.data").unwrap();
        match random.below(12) {
            0 => data.fill_with(|| random.byte()),
            1 => data.fill(0),
            2 => data.fill(0xff),
            3 => data.reverse(),
            _ => {
                for _ in 0..1 + random.below(3) {
                    let (at, several) = (random.below(data.len()), 1 + random.below(16));
                    data.iter_mut().skip(at).take(several).for_each(|b| *b ^= random.byte());
                }
            }
        }
    }

    /// Changes what the index says of layers, chunks and ranges.
    pub(crate) fn change_index(mut self, parts: &mut Parts, random: &mut Random) {
        let (a, b) = (random.below(self.ranges.len()), random.below(self.ranges.len()));
        let chunk = random.below(self.chunks.len());
        let noise: Vec<u8> = (0..1 + random.below(8)).map(|_| random.byte()).collect();
        let values = [0, 1, 2, 3, 7, 8, 59, 61, 1024, 8000, 32_769, 65_536, 65_537, u32::MAX];
        let value = u64::from(values[random.below(values.len())]);
        match random.below(14) {
            // Ids that are written although they are in order, or that no chunk has.
            0 => (self.ranges[a].chunk, self.is_sorted) = (value, false),
            1 => (self.ranges[a].kind, self.is_sorted) = (value.to_le_bytes()[0], false),
            2 => self.ranges[a].length = value,
            // Bytes of one range become those of another.
            3..=5 => {
                let most = usize::try_from(self.ranges[a].length / 2 + 1).unwrap();
                let moved = 2 * random.below(most) as u64;
                self.ranges[a].length -= moved;
                self.ranges[b].length += moved;
            }
            6 => {
                self.ranges.swap(a, b);
                self.fit_mark();
            }
            // Noise after the last range.
            7 => {
                self.ranges.last_mut().unwrap().length += noise.len() as u64;
                parts.tensor("packed.data").unwrap().extend(noise);
            }
            // Another number of Gaussians of a chunk, and of all.
            8 => {
                let old = std::mem::replace(&mut self.chunks[chunk].gaussians, value);
                let all: u64 = parts.metadata["gaussians"].as_str().unwrap().parse().unwrap();
                parts.metadata.insert("gaussians".to_owned(), Value::from((all - old + value).to_string()));
            }
            9 => match random.below(4) {
                0 => self.chunks[chunk].layer = noise[0],
                1 => self.chunks[chunk].cell ^= 1 << random.below(64),
                2 => self.chunks[chunk].cell = value,
                _ => self.chunks[chunk].bounds.iter_mut().zip(noise).for_each(|(byte, noise)| *byte = noise),
            },
            // Another number of layers or of their refinements.
            10 => match random.below(3) {
                0 => self.levels.push(noise[0] % 4),
                1 => drop(self.levels.pop()),
                _ => self.levels.fill(noise[0] % 4),
            },
            11 => return self.invert_mark(parts, random.below(2) == 0),
            12 => {
                let at = self.numbers[random.below(self.numbers.len())];
                return at.rewrite(parts, FORMS[random.below(FORMS.len())]);
            }
            _ => drop(self.chunks.swap_remove(chunk)),
        }
        self.put(parts);
    }

    /// Says that the ranges are sorted if they are not, and the other way round, with the ids that this asks for or as before.
    pub(crate) fn invert_mark(&mut self, parts: &mut Parts, with_ids: bool) {
        if with_ids {
            self.is_sorted = !self.is_sorted;
            self.put(parts);
        } else {
            parts.tensor("packed.head").unwrap()[self.start] ^= SORTED;
        }
    }

    /// Makes all ranges of a kind so long, and drops the bytes that they had beyond.
    pub(crate) fn shorten(&mut self, parts: &mut Parts, kind: u8, most: u64) {
        let data = parts.tensor("packed.data").unwrap();
        let mut rest = std::mem::take(data).into_iter();
        for range in &mut self.ranges {
            let bytes: Vec<u8> = rest.by_ref().take(usize::try_from(range.length).unwrap()).collect();
            if range.kind == kind {
                range.length = range.length.min(most);
            }
            data.extend(&bytes[..usize::try_from(range.length).unwrap()]);
        }
        self.put(parts);
        Self::seal(parts);
    }

    /// Says that all chunks have so many Gaussians.
    pub(crate) fn claim(mut self, parts: &mut Parts, gaussians: u64) {
        self.chunks.iter_mut().for_each(|chunk| chunk.gaussians = gaussians);
        self.put(parts);
        let all = self.chunks.len() as u64 * gaussians;
        parts.metadata.insert("gaussians".to_owned(), Value::from(all.to_string()));
    }

    /// Puts other tables and this many learned atoms into the head of a file.
    pub(crate) fn with_atoms(&self, parts: &mut Parts, tables: &[u8], atoms: usize, dictionary: &[u8]) {
        let head = parts.tensor("packed.head").unwrap();
        let count = self.numbers[0];
        let after = count.at + count.bytes;
        let before =
            self.numbers.iter().find(|number| number.at + number.bytes == self.tables.start).unwrap();
        let mut new = head[..count.at].to_vec();
        new.extend(number(atoms as u64));
        new.push(head[after] & !FIXED);
        new.extend(&head[after + 1..before.at]);
        for list in [tables, dictionary] {
            new.extend(number(list.len() as u64));
            new.extend(list);
        }
        new.extend(&head[self.dictionary.end..]);
        *head = new;
        parts.fit_shapes();
    }
}

impl Number {
    /// Writes the number in another form.
    pub(crate) fn rewrite(self, parts: &mut Parts, form: Form) {
        let mut new = number(self.value + if form == Form::Above { 1 << 32 } else { 0 });
        let zeros = match form {
            Form::Longer => 1,
            Form::Endless => 10,
            Form::Above => 0,
        };
        if zeros > 0 {
            *new.last_mut().unwrap() |= 0x80;
            new.extend(vec![0x80; zeros - 1]);
            // The last bit is one that 64 bits do not hold.
            new.push(u8::from(form == Form::Endless));
        }
        parts.tensor("packed.head").unwrap().splice(self.at..self.at + self.bytes, new);
        parts.fit_shapes();
    }
}
