//! Made-up scenes and cameras for tests, the same for the same seed.
#![allow(dead_code, reason = "each test file uses a part")]

use lexisplat::{
    Dictionary, Escapes, Geometry, Indices, Model, Pursuit, Record, SceneMeta, ShDegree, SparseCodes, Splats,
    Values,
};
use lexisplat_render::Camera;
pub(crate) use lexisplat_testing::Random;

/// `count` Gaussians around the origin; every tenth is odd in one way: huge, a point, a needle, far
/// off, without rotation, opaque, or invisible.
pub(crate) fn scene(seed: u64, count: usize, degree: ShDegree, antialiased: bool) -> Splats {
    let mut random = Random::new(seed);
    let mut g = Geometry::default();
    for i in 0..count {
        g.positions.push(std::array::from_fn(|_| random.within(-2.0, 2.0)));
        g.dc.push(std::array::from_fn(|_| random.within(-1.5, 1.5)));
        g.opacities.push(random.within(-4.0, 5.0));
        g.scales.push(std::array::from_fn(|_| random.within(-5.0, -1.0)));
        g.rotations.push(std::array::from_fn(|_| random.within(-1.0, 1.0)));
        match i % 70 {
            10 => g.scales[i] = [random.within(0.0, 3.0); 3],
            20 => g.scales[i] = [-30.0; 3],
            30 => g.scales[i] = [1.0, -9.0, -9.0],
            40 => g.positions[i] = g.positions[i].map(|v| v * 30.0),
            50 => g.rotations[i] = [0.0; 4],
            60 => g.opacities[i] = 20.0,
            69 => g.opacities[i] = -20.0,
            _ => {}
        }
    }
    let sh_rest = (0..count * degree.rest()).map(|_| random.within(-0.3, 0.3)).collect();
    Splats { geometry: g, degree, sh_rest, meta: SceneMeta { antialiased, ..SceneMeta::default() } }
}

/// A camera at the origin that looks along z.
pub(crate) fn straight(width: u32, height: u32, focal: f32) -> Camera {
    Camera {
        name: "straight".into(),
        width,
        height,
        fx: focal,
        fy: focal,
        position: [0.0; 3],
        rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        near: 0.2,
        split: None,
        tiles: None,
        background: None,
    }
}

/// A camera a few units from the origin, looking about there, turned in all three axes.
pub(crate) fn camera(seed: u64, width: u32, height: u32) -> Camera {
    let mut random = Random::new(seed ^ 0xcafe);
    let mut angle = || f64::from(random.within(-3.0, 3.0));
    let rotation = glam::DMat3::from_euler(glam::EulerRot::ZYX, angle(), angle(), angle());
    let position = rotation * glam::DVec3::new(0.1, -0.2, -4.0);
    let rows = rotation.transpose();
    let row = |v: glam::DVec3| v.to_array().map(|v| v as f32);
    Camera {
        position: row(position),
        rotation: [row(rows.x_axis), row(rows.y_axis), row(rows.z_axis)],
        fy: 120.0,
        ..straight(width, height, 130.0)
    }
}

/// A model with random atoms and codes; every 17th Gaussian is an escape, every 13th has no code.
pub(crate) fn model(degree: ShDegree, atoms: usize, half: bool) -> Model {
    model_of(scene(9, 400, degree, false), atoms, half)
}

/// [`model`] with the geometry, and the escapes' SH-rest, of `splats`.
pub(crate) fn model_of(splats: Splats, atoms: usize, half: bool) -> Model {
    let (count, degree) = (splats.len(), splats.degree);
    let mut random = Random::new(77);
    let dim = degree.rest();
    let mut values: Vec<f32> = (0..atoms * dim).map(|_| random.within(-1.0, 1.0)).collect();
    for atom in values.chunks_exact_mut(dim.max(1)) {
        let norm = atom.iter().map(|v| v * v).sum::<f32>().sqrt();
        atom.iter_mut().for_each(|v| *v /= norm);
    }
    let dictionary = Dictionary::new(degree, values).unwrap();
    let mut counts = Vec::new();
    let mut picked: Vec<usize> = Vec::new();
    let mut escapes = Escapes::default();
    for i in 0..count {
        if dim > 0 && i % 17 == 0 {
            escapes.gaussians.push(u32::try_from(i).unwrap());
            escapes.rows.extend_from_slice(splats.rest(i));
        }
        let empty = dim == 0 || i % 17 == 0 || i % 13 == 0;
        let chosen: Vec<usize> =
            (0..atoms).filter(|_| random.unit() * (atoms as f32) < 8.0).take(dim).collect();
        let chosen = if empty { Vec::new() } else { chosen };
        counts.push(u8::try_from(chosen.len()).unwrap());
        picked.extend(chosen);
    }
    let indices = if atoms <= 256 {
        Indices::U8(picked.iter().map(|&j| u8::try_from(j).unwrap()).collect())
    } else {
        Indices::U16(picked.iter().map(|&j| u16::try_from(j).unwrap()).collect())
    };
    let values: Vec<f32> = picked.iter().map(|_| random.within(-0.8, 0.8)).collect();
    let values = if half {
        Values::F16(values.into_iter().map(half::f16::from_f32).collect())
    } else {
        Values::F32(values)
    };
    let codes = SparseCodes::new(&dictionary, counts, indices, values, escapes).unwrap();
    let record = Record {
        tolerance: None,
        max_nonzeros: None,
        pursuit: Some(Pursuit::Ols),
        seed: 0,
        max_residual: 0.0,
        rms_residual: 0.0,
        over_tolerance: 0,
    };
    Model::new(splats.geometry, splats.meta, dictionary, codes, record).unwrap()
}
