//! An order of Gaussians in which neighbours in space follow one another.

use super::canonical::Grid;
use crate::scene::splats::Geometry;

/// Returns the indices of the Gaussians of `geometry` in the order of packed files, along a Morton curve. Gaussians that
/// follow one another are near one another in space, so pictures of a scene in this order are drawn faster.
#[must_use]
pub fn curve_order(geometry: &Geometry) -> Vec<u32> {
    let mut keys = Grid::fit(&geometry.positions).keys(geometry);
    keys.sort_unstable();
    keys.iter().map(|key| key.source).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaussians_are_put_in_order_and_back() {
        let splats = crate::support::testing::scene(500, 3);
        let order = curve_order(&splats.geometry);
        let ordered = splats.gathered(&order);
        let apart = |geometry: &Geometry| {
            let pairs = geometry.positions.windows(2);
            pairs.map(|p| (0..3).map(|k| (p[0][k] - p[1][k]).abs()).sum::<f32>()).sum::<f32>()
        };
        assert!(apart(&ordered.geometry) < 0.5 * apart(&splats.geometry));
        let mut back = vec![0; order.len()];
        (0..).zip(&order).for_each(|(k, &i)| back[i as usize] = k);
        assert_eq!(ordered.gathered(&back), splats);
        let sensitivity = crate::Sensitivity::guess(&splats.geometry);
        let of_ordered = crate::Sensitivity::guess(&ordered.geometry);
        let scattered = of_ordered.scattered(&order);
        let close = |(a, b): (&f32, &f32)| (a - b).abs() <= 1e-4 * b.abs();
        assert!(scattered.colour.iter().zip(&sensitivity.colour).all(close));
        let flat = |s: &crate::Sensitivity| s.position.as_flattened().to_vec();
        assert!(flat(&scattered).iter().zip(&flat(&sensitivity)).all(close));
    }
}
