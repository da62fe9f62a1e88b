//! Builds PLY files value by value.

#![allow(dead_code, clippy::expect_used, reason = "test helpers; two test binaries use different parts")]

use lexisplat::ply::{Format, ScalarType};
use lexisplat::{ExtraValues, Geometry, SceneMeta, ShDegree, Splats};
use lexisplat_testing::Random;

pub(crate) const TYPES: [ScalarType; 8] = [
    ScalarType::I8,
    ScalarType::U8,
    ScalarType::I16,
    ScalarType::U16,
    ScalarType::I32,
    ScalarType::U32,
    ScalarType::F32,
    ScalarType::F64,
];

/// One column of the vertex element. Values are given as f64 and stored as `ty`.
#[derive(Debug, Clone)]
pub(crate) struct Column {
    pub(crate) name: String,
    pub(crate) ty: ScalarType,
    pub(crate) values: Vec<f64>,
}

/// A PLY to be.
#[derive(Debug, Clone)]
pub(crate) struct File {
    pub(crate) format: Format,
    pub(crate) comments: Vec<String>,
    /// Header lines and data of elements before the vertices.
    pub(crate) before: (String, Vec<u8>),
    pub(crate) columns: Vec<Column>,
    /// Header lines and data of elements after the vertices.
    pub(crate) after: (String, Vec<u8>),
}

impl File {
    pub(crate) fn new(columns: Vec<Column>) -> Self {
        Self {
            format: Format::BinaryLittleEndian,
            comments: Vec::new(),
            before: (String::new(), Vec::new()),
            columns,
            after: (String::new(), Vec::new()),
        }
    }

    pub(crate) fn column(&mut self, name: &str) -> &mut Column {
        self.columns.iter_mut().find(|c| c.name == name).unwrap_or_else(|| panic!("no column {name}"))
    }

    pub(crate) fn without(mut self, names: &[&str]) -> Self {
        self.columns.retain(|c| !names.contains(&c.name.as_str()));
        self
    }

    pub(crate) fn header(&self) -> String {
        let format = match self.format {
            Format::Ascii => "ascii",
            Format::BinaryLittleEndian => "binary_little_endian",
            Format::BinaryBigEndian => "binary_big_endian",
        };
        let mut text = format!("ply\nformat {format} 1.0\n");
        for comment in &self.comments {
            text += &format!("comment {comment}\n");
        }
        text += &self.before.0;
        text += &format!("element vertex {}\n", self.columns.first().map_or(0, |c| c.values.len()));
        for column in &self.columns {
            text += &format!("property {} {}\n", column.ty.name(), column.name);
        }
        text + &self.after.0 + "end_header\n"
    }

    pub(crate) fn bytes(&self) -> Vec<u8> {
        let mut out = self.header().into_bytes();
        out.extend(&self.before.1);
        for row in 0..self.columns.first().map_or(0, |c| c.values.len()) {
            for column in &self.columns {
                push(&mut out, column.ty, column.values[row], self.format);
            }
            if self.format == Format::Ascii {
                out.pop();
                out.push(b'\n');
            }
        }
        out.extend(&self.after.1);
        out
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "tests give values that fit")]
fn push(out: &mut Vec<u8>, ty: ScalarType, value: f64, format: Format) {
    macro_rules! put {
        ($ty:ty) => {
            match format {
                Format::Ascii => out.extend(format!("{} ", value as $ty).bytes()),
                Format::BinaryLittleEndian => out.extend((value as $ty).to_le_bytes()),
                Format::BinaryBigEndian => out.extend((value as $ty).to_be_bytes()),
            }
        };
    }
    match ty {
        ScalarType::I8 => put!(i8),
        ScalarType::U8 => put!(u8),
        ScalarType::I16 => put!(i16),
        ScalarType::U16 => put!(u16),
        ScalarType::I32 => put!(i32),
        ScalarType::U32 => put!(u32),
        ScalarType::F32 => put!(f32),
        ScalarType::F64 => put!(f64),
    }
}

/// A scene of `n` Gaussians without normals, extras or comments.
pub(crate) fn scene(degree: u8, n: usize, seed: u64) -> Splats {
    let mut random = Random::new(seed);
    let degree = ShDegree::new(degree).expect("a degree");
    let mut triple = |scale: f32| [0; 3].map(|_| random.signed() * scale);
    let positions = (0..n).map(|_| triple(10.0)).collect();
    let dc = (0..n).map(|_| triple(1.0)).collect();
    let scales = (0..n).map(|_| triple(5.0)).collect();
    Splats {
        geometry: Geometry {
            positions,
            normals: Vec::new(),
            dc,
            opacities: (0..n).map(|_| random.signed() * 4.0).collect(),
            scales,
            rotations: (0..n).map(|_| [0; 4].map(|_| random.signed())).collect(),
            extras: Vec::new(),
        },
        degree,
        sh_rest: (0..n * degree.rest()).map(|_| random.signed() * 0.25).collect(),
        meta: SceneMeta::default(),
    }
}

/// Columns of a scene in the INRIA order, all float, normals zero if it has none.
pub(crate) fn columns(splats: &Splats) -> Vec<Column> {
    let g = &splats.geometry;
    let n = splats.len();
    let mut out = Vec::new();
    let mut add = |name: String, value: &dyn Fn(usize) -> f32| {
        let values = (0..n).map(|i| f64::from(value(i))).collect();
        out.push(Column { name, ty: ScalarType::F32, values });
    };
    for (k, name) in ["x", "y", "z"].into_iter().enumerate() {
        add(name.to_owned(), &|i| g.positions[i][k]);
    }
    for (k, name) in ["nx", "ny", "nz"].into_iter().enumerate() {
        add(name.to_owned(), &|i| g.normals.get(i).map_or(0.0, |v| v[k]));
    }
    for k in 0..3 {
        add(format!("f_dc_{k}"), &|i| g.dc[i][k]);
    }
    for k in 0..splats.degree.rest() {
        add(format!("f_rest_{k}"), &|i| splats.rest(i)[k]);
    }
    add("opacity".to_owned(), &|i| g.opacities[i]);
    for k in 0..3 {
        add(format!("scale_{k}"), &|i| g.scales[i][k]);
    }
    for k in 0..4 {
        add(format!("rot_{k}"), &|i| g.rotations[i][k]);
    }
    out
}

/// Asserts that two scenes agree to the last bit; `==` would take -0 for 0 and never NaN for NaN.
pub(crate) fn assert_same(a: &Splats, b: &Splats, what: &str) {
    fn bits(values: &[f32]) -> Vec<u32> {
        values.iter().map(|v| v.to_bits()).collect()
    }
    let arrays = |s: &Splats| {
        let g = &s.geometry;
        [
            ("positions", bits(g.positions.as_flattened())),
            ("normals", bits(g.normals.as_flattened())),
            ("dc", bits(g.dc.as_flattened())),
            ("sh_rest", bits(&s.sh_rest)),
            ("opacities", bits(&g.opacities)),
            ("scales", bits(g.scales.as_flattened())),
            ("rotations", bits(g.rotations.as_flattened())),
        ]
    };
    for ((name, a), (_, b)) in arrays(a).into_iter().zip(arrays(b)) {
        assert!(a == b, "{what}: {name} differ");
    }
    assert_eq!(a.degree, b.degree, "{what}");
    assert_eq!(a.meta, b.meta, "{what}");
    let extras = |s: &Splats| -> Vec<(String, String)> {
        s.geometry.extras.iter().map(|e| (e.name.clone(), extra_bits(&e.values))).collect()
    };
    assert_eq!(extras(a), extras(b), "{what}");
}

fn extra_bits(values: &ExtraValues) -> String {
    match values {
        ExtraValues::F32(v) => format!("f32 {:?}", v.iter().map(|v| v.to_bits()).collect::<Vec<_>>()),
        ExtraValues::F64(v) => format!("f64 {:?}", v.iter().map(|v| v.to_bits()).collect::<Vec<_>>()),
        other => format!("{other:?}"),
    }
}
