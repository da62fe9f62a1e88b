//! Ten thousand damaged PLY files, read whole and a part at a time: no panic, no memory beyond a multiple of the
//! file, and one answer.

use lexisplat::ply::{self, Format, PlySource, ReadOptions};
use lexisplat::{Silent, SplatSource};

use crate::allocator::{alone, counted};
use crate::ply_support::{File, columns, scene};
use lexisplat_testing::Random;

/// Damaged files read.
const INPUTS: usize = 10_000;
/// Most bytes allocated at any time while reading, as a multiple of the file. The arrays themselves
/// can reach 4 (one-byte properties become f32); a header of short comments is the worst at 5.3.
const FACTOR: usize = 6;
/// Most bytes beyond that: hash tables, thread hand-over, messages.
const CONSTANT: usize = 64 << 10;

/// Small files of every kind, good ones first.
fn seeds() -> Vec<Vec<u8>> {
    let mut out = Vec::new();
    for (degree, format) in [
        (0, Format::BinaryLittleEndian),
        (1, Format::BinaryBigEndian),
        (0, Format::Ascii),
        (3, Format::BinaryLittleEndian),
    ] {
        let mut file = File::new(columns(&scene(degree, 5, 1)));
        file.format = format;
        file.comments = vec!["SplatRenderMode: mip".to_owned()];
        file.columns[7].ty = ply::ScalarType::U8;
        file.columns[8].ty = ply::ScalarType::F64;
        file.columns[3].name = "extra".to_owned();
        if format != Format::Ascii {
            let header = "element face 2\nproperty list uchar short v\nproperty char c\n".to_owned();
            let one = [[2, 1, 1, 2, 2, 9], [1, 1, 1, 0, 0, 0]];
            file.before = (header, [&one[0][..], &one[1][..4]].concat());
        }
        out.push(file.bytes());
    }
    out
}

/// Replaces a word of the header by something else.
fn edit_header(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    const WORDS: [&str; 22] = [
        "0",
        "-1",
        "1",
        "6",
        "255",
        "4294967295",
        "18446744073709551615",
        "99999999999999999999",
        "float",
        "double",
        "uchar",
        "list",
        "list uint double",
        "x",
        "opacity",
        "f_rest_0",
        "f_rest_8",
        "vertex",
        "element e 18446744073709551615\n",
        "ascii",
        "binary_big_endian",
        "\n",
    ];
    let end = bytes.windows(10).position(|w| w == b"end_header").unwrap_or(bytes.len());
    let is_break = |b: &u8| b.is_ascii_whitespace();
    let start = random.below(end.max(1));
    let from = bytes[..start].iter().rposition(is_break).map_or(0, |i| i + 1);
    let to = bytes[start..].iter().position(is_break).map_or(bytes.len(), |i| start + i);
    let mut out = bytes.to_vec();
    match random.below(4) {
        // Drop or repeat a line, else another word.
        0 => {
            let line = bytes[start..].iter().position(|&b| b == b'\n').map_or(bytes.len(), |i| start + i + 1);
            let first = bytes[..start].iter().rposition(|&b| b == b'\n').map_or(0, |i| i + 1);
            let repeat = bytes[first..line].repeat(random.below(3) * random.below(4));
            out.splice(first..line, repeat);
        }
        _ => {
            let word = WORDS[random.below(WORDS.len())];
            out.splice(from..to.max(from), word.bytes());
        }
    }
    out
}

fn flip_bits(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut out = bytes.to_vec();
    for _ in 0..=random.below(4) {
        let at = random.below(out.len());
        out[at] ^= 1 << random.below(8);
    }
    out
}

/// Reads damaged bytes; the reader must answer, in one line, within its memory.
fn survive(bytes: &[u8], drop_invalid: bool) -> bool {
    let options = ReadOptions::default().with_drop_invalid(drop_invalid);
    let (result, used) = counted(|| ply::read_bytes("t.ply", bytes, &options));
    assert!(used <= FACTOR * bytes.len() + CONSTANT, "{used} bytes for {} of input", bytes.len());
    let (opened, used) = counted(|| PlySource::open("t.ply", bytes, &options, &Silent));
    assert!(used <= FACTOR * bytes.len() + CONSTANT, "{used} bytes for {} of input, in parts", bytes.len());
    match result {
        Ok(read) => {
            assert!(read.splats.validate().is_ok());
            let chunks = opened.unwrap_or_else(|error| panic!("refused in parts only: {error}"));
            assert_eq!(chunks.warnings(), read.warnings);
            let (mut part, half) = (chunks.empty(), chunks.len() / 2);
            let mut parts = Vec::new();
            for range in [0..half, half..chunks.len()] {
                assert!(chunks.read(range, &mut part).is_ok());
                parts.extend_from_slice(&part.geometry.positions);
            }
            assert_eq!(parts, read.splats.geometry.positions);
            true
        }
        Err(error) => {
            let said = error.to_string();
            assert_eq!(opened.err().map(|e| e.to_string()), Some(said.clone()));
            assert!(!said.contains('\n') && said.len() < 600, "{said:?}");
            false
        }
    }
}

/// One test only: the counters are the whole process's.
#[test]
fn damaged_files_are_refused_quietly() {
    let _alone = alone();
    let seeds = seeds();
    // Starts the thread pool, whose own memory is not the reader's.
    let warm = File::new(columns(&scene(3, 5000, 1))).bytes();
    assert!(survive(&warm, false));
    for bytes in &seeds {
        assert!(survive(bytes, false), "{:?}", ply::read_bytes("seed", bytes, &ReadOptions::default()).err());
    }
    // Many rows and many bad values: bounds must hold at scale as well. One-byte properties are the
    // worst case, 4 bytes out for 1 byte in.
    let mut bytes_only = File::new(columns(&scene(3, 20_000, 1)));
    bytes_only.columns.iter_mut().for_each(|c| c.ty = ply::ScalarType::U8);
    assert!(survive(&bytes_only.bytes(), false));
    let mut all_bad = File::new(columns(&scene(0, 20_000, 1)));
    all_bad.column("x").values.fill(f64::NAN);
    assert!(survive(&all_bad.bytes(), true));
    all_bad.format = Format::Ascii;
    assert!(survive(&all_bad.bytes(), true));
    // Headers that are all table.
    for line in ["comment \n", "element e 0\n", "property char a\n", "obj_info\n", "comment \u{1}\n"] {
        let text = format!("ply\nformat ascii 1.0\nelement e 0\n{}end_header\n", line.repeat(50_000));
        survive(text.as_bytes(), false);
    }
    let wide = format!("element e 0\n{}", "property char a\n".repeat(4000)).repeat(12);
    survive(format!("ply\nformat ascii 1.0\n{wide}end_header\n").as_bytes(), false);

    let mut random = Random::new(0x1e15);
    let (mut read, mut accepted) = (0, 0);
    for bytes in &seeds[..3] {
        for length in 0..bytes.len() {
            // A text file cut inside its last number still is a file; any other cut must show.
            let last_number = bytes.starts_with(b"ply\nformat ascii") && !bytes[length..].contains(&b' ');
            assert!(!survive(&bytes[..length], read % 2 == 0) || last_number, "cut at {length}");
            read += 1;
        }
    }
    while read < INPUTS {
        let bytes = &seeds[random.below(seeds.len())];
        let mut damaged = bytes.clone();
        for _ in 0..=random.below(2) {
            damaged = match random.below(3) {
                0 => flip_bits(&damaged, &mut random),
                1 => edit_header(&damaged, &mut random),
                _ => damaged[..random.below(damaged.len() + 1)].to_vec(),
            };
            if damaged.is_empty() {
                break;
            }
        }
        accepted += usize::from(survive(&damaged, random.below(2) == 0));
        read += 1;
    }
    // Both answers must occur, or the damage is too coarse or too slight to test anything.
    assert!((INPUTS / 50..INPUTS * 9 / 10).contains(&accepted), "{accepted} of {read} accepted");
}
