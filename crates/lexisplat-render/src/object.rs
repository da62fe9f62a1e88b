//! Views of the subject of a scene without cameras.

use lexisplat::Geometry;

use crate::camera::Camera;
use crate::near::near_plane;
use crate::orbit::ring;
use crate::subject::subject;

/// Returns `count` cameras on a ring around the [`subject`] of `geometry`. The ring and the names of the cameras are like
/// those of [`crate::orbit`], which goes around the bulk.
#[must_use]
pub fn object(geometry: &Geometry, count: usize, width: u32, height: u32) -> Vec<Camera> {
    ring(subject(geometry), count, [width, height], near_plane(geometry))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bulk::bulk;

    /// A ball of 500 small Gaussians of radius 1 around (5, -2, 7), and as many large ones `far` away from it.
    fn before(far: f64) -> Geometry {
        let mut g = Geometry::default();
        for i in 0..1000_u16 {
            let t = f64::from(i);
            let y = 1.0 - (2.0 * t + 1.0) / 1000.0;
            let around = (1.0 - y * y).sqrt();
            let (radius, scale) = if i % 2 == 0 { (1.0, -4.0) } else { (far, 0.0) };
            let p = glam::DVec3::new(around * (t * 2.4).cos(), y, around * (t * 2.4).sin()) * radius;
            g.positions.push((p + glam::DVec3::new(5.0, -2.0, 7.0)).to_array().map(crate::camera::single));
            g.scales.push([scale; 3]);
            g.opacities.push(2.0);
            g.rotations.push([1.0, 0.0, 0.0, 0.0]);
        }
        g
    }

    #[test]
    fn an_object_before_a_background_is_the_subject() {
        let near = |centre: [f64; 3]| {
            centre.iter().zip([5.0, -2.0, 7.0]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 0.2
        };
        let (centre, radius) = subject(&before(60.0));
        assert!(near(centre) && radius > 1.0 && radius < 2.5, "{centre:?} {radius}");
        for camera in object(&before(60.0), 6, 90, 60) {
            camera.validate().unwrap();
            let [x, y, z] = camera.to_view([5.0, -2.0, 7.0]);
            assert!(z > 2.0 && z < 6.0 && x.abs() < 0.3 && y.abs() < 0.3, "{x} {y} {z}");
        }
        // Where all of it is the object.
        let alone = before(1.5);
        assert_eq!(subject(&alone), bulk(&alone));
        assert_eq!(object(&alone, 4, 90, 60), crate::orbit(&alone, 4, 90, 60));
    }

    #[test]
    fn degenerate_scenes_still_give_cameras() {
        let all_equal = Geometry { positions: vec![[1.0; 3]; 40], ..before(1.0) };
        let one = Geometry {
            positions: vec![[1.0, f32::NAN, 3.0]],
            opacities: vec![f32::NAN],
            scales: vec![[f32::INFINITY; 3]],
            ..Geometry::default()
        };
        for geometry in [Geometry::default(), one, all_equal] {
            for camera in object(&geometry, 3, 0, 10) {
                camera.validate().unwrap();
            }
        }
    }
}
