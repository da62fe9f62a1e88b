//! A naive reader, one value at a time, against the fast one on random files.

use std::collections::HashMap;

use lexisplat::ply::{self, Format, ReadOptions, ScalarType};
use lexisplat::{Extra, ExtraValues, Geometry, Offset, SceneMeta, ShDegree, Splats};
use lexisplat_testing::Random;
use proptest::prelude::*;

use super::support::{Column, File, TYPES, assert_same, columns, scene};

/// A value in its own type, as text that loses nothing for integers and as bits for floats.
#[derive(Clone, Copy)]
enum Value {
    Int(i64),
    F32(f32),
    F64(f64),
}

impl Value {
    #[expect(clippy::cast_possible_truncation, reason = "the nearest f32 is the specified result")]
    fn f32(self) -> f32 {
        match self {
            Self::Int(v) => v as f32,
            Self::F32(v) => v,
            Self::F64(v) => v as f32,
        }
    }

    #[expect(clippy::cast_precision_loss, reason = "integers have 32 bits")]
    fn f64(self) -> f64 {
        match self {
            Self::Int(v) => v as f64,
            Self::F32(v) => f64::from(v),
            Self::F64(v) => v,
        }
    }
}

/// `(type, name)` of the properties, and the values of each row by name.
type Table = (Vec<(String, String)>, Vec<HashMap<String, Value>>);

/// Reads a file made by [`File`] with no other elements: a table of every value by name and row.
fn naive(bytes: &[u8]) -> Table {
    let end = b"end_header\n";
    let data = bytes.windows(end.len()).position(|w| w == end).expect("an end") + end.len();
    let header = std::str::from_utf8(&bytes[..data]).expect("text");
    let (mut properties, mut count, mut format) = (Vec::new(), 0, "");
    for line in header.lines() {
        let words: Vec<&str> = line.split(' ').collect();
        match words[0] {
            "format" => format = words[1],
            "element" => count = words[2].parse().expect("a count"),
            "property" => properties.push((words[1].to_owned(), words[2].to_owned())),
            _ => {}
        }
    }
    let text = String::from_utf8_lossy(&bytes[data..]);
    let mut words = text.split_whitespace();
    let mut at = data;
    let mut rows = Vec::new();
    for _ in 0..count {
        let mut row = HashMap::new();
        for (ty, name) in &properties {
            macro_rules! value {
                ($ty:ty, $wrap:expr) => {{
                    const SIZE: usize = size_of::<$ty>();
                    if format == "ascii" {
                        $wrap(words.next().expect("a word").parse::<$ty>().expect("a number"))
                    } else {
                        let mut raw: [u8; SIZE] = bytes[at..at + SIZE].try_into().expect("enough bytes");
                        at += SIZE;
                        if format == "binary_big_endian" {
                            raw.reverse();
                        }
                        $wrap(<$ty>::from_le_bytes(raw))
                    }
                }};
            }
            let value = match ty.as_str() {
                "char" => value!(i8, |v| Value::Int(i64::from(v))),
                "uchar" => value!(u8, |v| Value::Int(i64::from(v))),
                "short" => value!(i16, |v| Value::Int(i64::from(v))),
                "ushort" => value!(u16, |v| Value::Int(i64::from(v))),
                "int" => value!(i32, |v| Value::Int(i64::from(v))),
                "uint" => value!(u32, |v| Value::Int(i64::from(v))),
                "float" => value!(f32, Value::F32),
                "double" => value!(f64, Value::F64),
                other => panic!("type {other}"),
            };
            row.insert(name.clone(), value);
        }
        rows.push(row);
    }
    (properties, rows)
}

/// Returns the scene that the fast reader should make of `bytes`, if it decides on `offset`.
#[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
fn expected(bytes: &[u8], offset: Option<Offset>) -> Splats {
    let (properties, rows) = naive(bytes);
    let has = |name: &str| properties.iter().any(|(_, n)| n == name);
    let rest = (0..).take_while(|k| has(&format!("f_rest_{k}"))).count();
    let get = |row: &HashMap<String, Value>, name: &str| row[name].f32();
    let triple = |names: [&str; 3]| rows.iter().map(|r| names.map(|n| get(r, n))).collect::<Vec<[f32; 3]>>();
    let mut normals = if has("nx") { triple(["nx", "ny", "nz"]) } else { Vec::new() };
    if normals.iter().flatten().all(|v| v.to_bits() == 0) {
        normals.clear();
    }
    let extras = properties.iter().filter(|(_, n)| n.starts_with("extra")).map(|(ty, name)| {
        macro_rules! ints {
            ($variant:ident) => {
                ExtraValues::$variant(
                    rows.iter()
                        .map(|r| match r[name] {
                            Value::Int(v) => v.try_into().expect("in range"),
                            _ => panic!("a float"),
                        })
                        .collect(),
                )
            };
        }
        macro_rules! floats {
            ($variant:ident) => {
                ExtraValues::$variant(
                    rows.iter()
                        .map(|r| if let Value::$variant(v) = r[name] { v } else { panic!("other") })
                        .collect(),
                )
            };
        }
        let values = match ty.as_str() {
            "char" => ints!(I8),
            "uchar" => ints!(U8),
            "short" => ints!(I16),
            "ushort" => ints!(U16),
            "int" => ints!(I32),
            "uint" => ints!(U32),
            "float" => floats!(F32),
            _ => floats!(F64),
        };
        Extra { name: name.clone(), values }
    });
    Splats {
        geometry: Geometry {
            positions: match offset.map(Offset::get) {
                None => triple(["x", "y", "z"]),
                Some([x, y, z]) => {
                    let less = |r: &HashMap<String, Value>, name: &str, by: f64| (r[name].f64() - by) as f32;
                    rows.iter().map(|r| [less(r, "x", x), less(r, "y", y), less(r, "z", z)]).collect()
                }
            },
            normals,
            dc: triple(["f_dc_0", "f_dc_1", "f_dc_2"]),
            opacities: rows.iter().map(|r| get(r, "opacity")).collect(),
            scales: triple(["scale_0", "scale_1", "scale_2"]),
            rotations: rows.iter().map(|r| ["rot_0", "rot_1", "rot_2", "rot_3"].map(|n| get(r, n))).collect(),
            extras: extras.collect(),
        },
        degree: ShDegree::from_rest(rest).expect("a degree"),
        sh_rest: rows.iter().flat_map(|r| (0..rest).map(|k| get(r, &format!("f_rest_{k}")))).collect(),
        meta: SceneMeta { offset, ..SceneMeta::default() },
    }
}

/// Any finite value of `ty`, with many bit patterns for floats.
fn any_value(ty: ScalarType, random: &mut Random) -> f64 {
    let bits = random.bits();
    let [a, b, c, d, e, f, g, h] = bits.to_le_bytes();
    match ty {
        ScalarType::I8 => f64::from(i8::from_le_bytes([a])),
        ScalarType::U8 => f64::from(a),
        ScalarType::I16 => f64::from(i16::from_le_bytes([a, b])),
        ScalarType::U16 => f64::from(u16::from_le_bytes([a, b])),
        ScalarType::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
        ScalarType::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
        ScalarType::F32 => {
            let value = f32::from_le_bytes([a, b, c, d]);
            if value.is_finite() { f64::from(value) } else { -0.0 }
        }
        // Within f32's range, but with digits it does not have.
        ScalarType::F64 => f64::from_bits(
            u64::from_le_bytes([a, b, c, d, e, f, g, h]) & !(0x7ff << 52) | (0x3f0 + u64::from(a & 31)) << 52,
        ),
    }
}

fn random_file(degree: u8, rows: usize, normals: u8, extras: usize, format: Format, seed: u64) -> File {
    let mut random = Random::new(seed);
    let mut file = File::new(columns(&scene(degree, rows, seed)));
    file.format = format;
    if normals == 0 {
        file = file.without(&["nx", "ny", "nz"]);
    }
    for k in 0..extras {
        file.columns.push(Column { name: format!("extra{k}"), ty: ScalarType::F32, values: vec![0.0; rows] });
    }
    // Half the files keep most columns float, so that long runs occur as well.
    let mostly_float = random.below(2) == 0;
    for column in &mut file.columns {
        if !(mostly_float && random.below(8) != 0) {
            column.ty = TYPES[random.below(TYPES.len())];
        }
        let zero = normals == 1 && ["nx", "ny", "nz"].contains(&column.name.as_str());
        for value in &mut column.values {
            *value = if zero { 0.0 } else { any_value(column.ty, &mut random) };
        }
    }
    if random.below(4) != 0 {
        for i in (1..file.columns.len()).rev() {
            file.columns.swap(i, random.below(i + 1));
        }
    }
    file
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn the_fast_reader_agrees_with_the_naive_one(
        degree in 0_u8..=4,
        rows in prop_oneof![4 => 0_usize..40, 1 => 1020_usize..1030, 1 => Just(2049_usize)],
        normals in 0_u8..3,
        extras in 0_usize..4,
        format in prop_oneof![
            Just(Format::BinaryLittleEndian), Just(Format::BinaryBigEndian), Just(Format::Ascii)
        ],
        seed in any::<u64>(),
    ) {
        let bytes = random_file(degree, rows, normals, extras, format, seed).bytes();
        let found = ply::read_bytes("t.ply", &bytes, &ReadOptions::default()).unwrap();
        assert_same(&found.splats, &expected(&bytes, found.splats.meta.offset), "naive");
    }
}
