//! The rasteriser again, as plainly as it can be written, in f64: a pixel at a time, every Gaussian of
//! the pixel's tile. Shares no code with the crate; formulas from the 3DGS papers and INRIA's sources.

use glam::{DMat2, DMat3, DQuat, DVec2, DVec3};
use lexisplat::Splats;
use lexisplat_render::{Camera, Image};
use rayon::prelude::*;

struct Ellipse {
    /// Number of the Gaussian.
    gaussian: usize,
    centre: DVec2,
    conic: DMat2,
    opacity: f64,
    colour: DVec3,
    depth: f64,
    /// Left, top, right, bottom in tiles; the last two excluded.
    tiles: [i64; 4],
}

/// Returns the numbers of the Gaussians that show at each pixel, nearest first.
pub(crate) fn shown(splats: &Splats, camera: &Camera) -> Vec<Vec<usize>> {
    let mut ellipses: Vec<Ellipse> = (0..splats.len()).filter_map(|i| project(splats, camera, i)).collect();
    ellipses.sort_by(|a, b| a.depth.total_cmp(&b.depth));
    let (width, height) = (i64::from(camera.width), i64::from(camera.height));
    let of = |p: i64| {
        let (x, y) = (p % width, p / width);
        let covers = |e: &&Ellipse| {
            let [left, top, right, bottom] = e.tiles;
            (left..right).contains(&(x / 16)) && (top..bottom).contains(&(y / 16))
        };
        let list: Vec<&Ellipse> = ellipses.iter().filter(covers).collect();
        let mut shown = Vec::new();
        pixel(&list, DVec2::new(x as f64, y as f64), DVec3::ZERO, |e| shown.push(e.gaussian));
        shown
    };
    (0..width * height).map(of).collect()
}

/// Returns the mean over pixels of the squared errors beside `target`, summed over channels. The Gaussians of `shown` show at
/// each pixel, whatever their opacity there is.
pub(crate) fn loss(splats: &Splats, camera: &Camera, shown: &[Vec<usize>], target: &Image) -> f64 {
    let ellipses: Vec<Option<Ellipse>> = (0..splats.len()).map(|i| project(splats, camera, i)).collect();
    let width = target.width as usize;
    let of = |p: usize| {
        let at = DVec2::new((p % width) as f64, (p / width) as f64);
        let (mut colour, mut transmittance) = (DVec3::ZERO, 1.0);
        for e in shown[p].iter().filter_map(|&i| ellipses[i].as_ref()) {
            let d = e.centre - at;
            let alpha = (e.opacity * (-0.5 * d.dot(e.conic * d)).exp()).min(0.99);
            colour += e.colour * alpha * transmittance;
            transmittance *= 1.0 - alpha;
        }
        let background = DVec3::from_array(camera.background.unwrap_or_default().map(f64::from));
        colour += transmittance * background;
        let target = DVec3::from_array(target.pixels[p].map(f64::from));
        (colour.clamp(DVec3::ZERO, DVec3::ONE) - target.clamp(DVec3::ZERO, DVec3::ONE)).length_squared()
    };
    (0..shown.len()).map(of).sum::<f64>() / shown.len() as f64
}

pub(crate) fn render(splats: &Splats, camera: &Camera, background: [f32; 3]) -> Image {
    let mut ellipses: Vec<Ellipse> = (0..splats.len()).filter_map(|i| project(splats, camera, i)).collect();
    ellipses.sort_by(|a, b| a.depth.total_cmp(&b.depth));
    let background = DVec3::from_array(background.map(f64::from));
    let (width, height) = (i64::from(camera.width), i64::from(camera.height));
    let columns = (width + 15) / 16;
    let tiles: Vec<Vec<[f32; 3]>> = (0..columns * ((height + 15) / 16))
        .into_par_iter()
        .map(|tile| {
            let (column, row) = (tile % columns, tile / columns);
            let list: Vec<&Ellipse> = ellipses
                .iter()
                .filter(|e| {
                    let [left, top, right, bottom] = e.tiles;
                    (left..right).contains(&column) && (top..bottom).contains(&row)
                })
                .collect();
            (0..256)
                .map(|k| {
                    pixel(
                        &list,
                        DVec2::new((column * 16 + k % 16) as f64, (row * 16 + k / 16) as f64),
                        background,
                        |_| (),
                    )
                })
                .collect()
        })
        .collect();
    let pixels = (0..width * height)
        .map(|p| {
            let (x, y) = (p % width, p / width);
            tiles[(y / 16 * columns + x / 16) as usize][(y % 16 * 16 + x % 16) as usize]
        })
        .collect();
    Image { width: camera.width, height: camera.height, pixels }
}

/// Returns the colour of a pixel, and calls `show` for each Gaussian that shows there.
fn pixel(ellipses: &[&Ellipse], at: DVec2, background: DVec3, mut show: impl FnMut(&Ellipse)) -> [f32; 3] {
    let mut colour = DVec3::ZERO;
    let mut transmittance = 1.0;
    for e in ellipses {
        let d = e.centre - at;
        let power = -0.5 * d.dot(e.conic * d);
        if power > 0.0 {
            continue;
        }
        let alpha = (e.opacity * power.exp()).min(0.99);
        if alpha < 1.0 / 255.0 {
            continue;
        }
        let next = transmittance * (1.0 - alpha);
        if next < 0.0001 {
            break;
        }
        show(e);
        colour += e.colour * alpha * transmittance;
        transmittance = next;
    }
    (colour + transmittance * background).to_array().map(|v| v as f32)
}

fn project(splats: &Splats, camera: &Camera, i: usize) -> Option<Ellipse> {
    let g = &splats.geometry;
    let vector = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
    let focal = DVec2::new(f64::from(camera.fx), f64::from(camera.fy));
    let to_world =
        DMat3::from_cols(vector(camera.rotation[0]), vector(camera.rotation[1]), vector(camera.rotation[2]))
            .transpose();
    let to_view = to_world.transpose();
    let offset = vector(g.positions[i]) - vector(camera.position);
    let view = to_view * offset;
    if view.z <= f64::from(0.2_f32) {
        return None;
    }
    let tan = size / (2.0 * focal);
    let ndc = DVec2::new(view.x / tan.x, view.y / tan.y) / (view.z + 1e-7);
    let centre = ((ndc + 1.0) * size - 1.0) / 2.0;

    let [w, x, y, z] = g.rotations[i].map(f64::from);
    let quaternion = DQuat::from_xyzw(x, y, z, w);
    let rotation = match quaternion.length() {
        0.0 => DMat3::IDENTITY,
        length => DMat3::from_quat(quaternion / length),
    };
    let scale = DMat3::from_diagonal(vector(g.scales[i]).exp());
    let half = rotation * scale;
    let covariance = half * half.transpose();
    let limit = 1.3 * tan;
    let t = DVec2::new(view.x / view.z, view.y / view.z).clamp(-limit, limit);
    let jacobian = DMat3::from_cols(
        DVec3::new(focal.x / view.z, 0.0, 0.0),
        DVec3::new(0.0, focal.y / view.z, 0.0),
        DVec3::new(-focal.x * t.x / view.z, -focal.y * t.y / view.z, 0.0),
    );
    let on_screen = jacobian * to_view * covariance * to_view.transpose() * jacobian.transpose();
    let before = DMat2::from_cols(on_screen.x_axis.truncate(), on_screen.y_axis.truncate());
    let after = before + DMat2::from_diagonal(DVec2::splat(0.3));
    if after.determinant() == 0.0 || !after.determinant().is_finite() {
        return None;
    }
    let mut opacity = 1.0 / (1.0 + (-f64::from(g.opacities[i])).exp());
    if splats.meta.antialiased {
        opacity *= (before.determinant() / after.determinant()).max(0.000_025).sqrt();
    }
    let mid = 0.5 * (after.x_axis.x + after.y_axis.y);
    let longest = mid + (mid * mid - after.determinant()).max(0.1).sqrt();
    let radius = (3.0 * longest.sqrt()).ceil();
    let grid = DVec2::new((size.x / 16.0).ceil(), (size.y / 16.0).ceil());
    let low = ((centre - radius) / 16.0).trunc().clamp(DVec2::ZERO, grid);
    let high = ((centre + radius + 15.0) / 16.0).trunc().clamp(DVec2::ZERO, grid);
    let tiles = [low.x as i64, low.y as i64, high.x as i64, high.y as i64];

    let basis = basis(offset.normalize());
    let per_channel = splats.degree.rest_per_channel();
    let mut colour = DVec3::ZERO;
    for c in 0..3 {
        let rest = &splats.rest(i)[c * per_channel..(c + 1) * per_channel];
        let sum: f64 = rest.iter().zip(&basis[1..]).map(|(&v, b)| f64::from(v) * b).sum();
        colour[c] = (0.5 + basis[0] * f64::from(g.dc[i][c]) + sum).max(0.0);
    }
    Some(Ellipse { gaussian: i, centre, conic: after.inverse(), opacity, colour, depth: view.z, tiles })
}

/// Real spherical harmonics from their definition: associated Legendre functions with the
/// Condon-Shortley phase, order m from -l to l.
fn basis(d: DVec3) -> [f64; 25] {
    let mut values = [0.0; 25];
    let azimuth = d.y.atan2(d.x);
    for l in 0..=4_i32 {
        for m in -l..=l {
            let k = m.unsigned_abs();
            let ratio = factorial(l.unsigned_abs() - k) / factorial(l.unsigned_abs() + k);
            let norm = ((2 * l + 1) as f64 / (4.0 * std::f64::consts::PI) * ratio).sqrt();
            let angle = f64::from(k) * azimuth;
            let factor = match m {
                0 => 1.0,
                m if m > 0 => std::f64::consts::SQRT_2 * angle.cos(),
                _ => std::f64::consts::SQRT_2 * angle.sin(),
            };
            values[(l * (l + 1) + m) as usize] = norm * factor * legendre(l.unsigned_abs(), k, d.z);
        }
    }
    values
}

fn factorial(n: u32) -> f64 {
    (1..=n).map(f64::from).product()
}

/// `P_l^m(x)` with the Condon-Shortley phase, by the usual recurrence.
fn legendre(l: u32, m: u32, x: f64) -> f64 {
    let mut previous = 0.0;
    let mut value: f64 = (1..=m).map(|k| -f64::from(2 * k - 1) * (1.0 - x * x).max(0.0).sqrt()).product();
    for n in m + 1..=l {
        let next = (f64::from(2 * n - 1) * x * value - f64::from(n + m - 1) * previous) / f64::from(n - m);
        (previous, value) = (value, next);
    }
    value
}
