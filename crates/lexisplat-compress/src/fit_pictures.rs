//! The pictures that refining fits to.

use lexisplat::{Progress, Splats};
use lexisplat_render::conventions::TILE;
use lexisplat_render::{Camera, Image, Renderer, Scene, TileSet};

use crate::drawing::{DrawOptions, draw_each};
use crate::error::Result;

/// Pixels of a tile.
const TILE_PIXELS: usize = TILE * TILE;

/// Draws the picture of `splats` from each of `cameras`, of 8 bits. Cameras that differ in their tiles alone are drawn together,
/// because Gaussians are projected for each drawing.
///
/// # Errors
/// Errors of drawing; [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`].
pub(crate) fn fit_pictures(
    splats: &Splats,
    cameras: &[Camera],
    progress: &dyn Progress,
) -> Result<Vec<Vec<[u8; 3]>>> {
    // Each group has the camera without its tiles.
    let mut groups: Vec<(Camera, Vec<usize>)> = Vec::new();
    for (k, camera) in cameras.iter().enumerate() {
        let whole = camera.clone().with_tiles(None);
        match groups.iter_mut().find(|(known, _)| *known == whole) {
            Some((_, group)) => group.push(k),
            None => groups.push((whole, vec![k])),
        }
    }
    let together = |(whole, group): &(Camera, Vec<usize>)| {
        let sets: Option<Vec<&TileSet>> = group.iter().map(|&k| cameras[k].tiles.as_ref()).collect();
        let all = sets.and_then(|sets| sets.into_iter().cloned().reduce(|all, own| all.with(&own)));
        whole.clone().with_tiles(all)
    };
    let drawn: Vec<Camera> = groups.iter().map(together).collect();
    let mut pictures = vec![Vec::new(); cameras.len()];
    let mut next = drawn.iter().zip(&groups);
    let split = |image: Image| {
        let picture = image.to_8bit();
        let Some((camera, (_, group))) = next.next() else { return };
        for &k in group {
            pictures[k] = match (&camera.tiles, &cameras[k].tiles) {
                (Some(all), Some(own)) => tiles_of(&picture, all, own),
                _ => picture.clone(),
            };
        }
    };
    let (mut cpu, options) = (Renderer::cpu(), DrawOptions::default());
    draw_each(&mut cpu, &Scene::from(splats), &drawn, &options, split, progress)?;
    Ok(pictures)
}

/// Returns the picture of the tiles `own` of a `picture` of the tiles `all`, which has them. A picture has its tiles below one another.
fn tiles_of(picture: &[[u8; 3]], all: &TileSet, own: &TileSet) -> Vec<[u8; 3]> {
    let tile = |tile| {
        let k = all.tiles().binary_search(tile).unwrap_or_default();
        &picture[k * TILE_PIXELS..(k + 1) * TILE_PIXELS]
    };
    own.tiles().iter().flat_map(tile).copied().collect()
}

#[cfg(test)]
mod tests {
    use lexisplat::Silent;
    use lexisplat_render::orbit;
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;

    #[test]
    fn pictures_are_those_that_are_drawn_one_by_one() {
        let splats = scene(&SampleOptions::new(300, 3));
        let some = |camera: &Camera, k: u32| {
            let set = TileSet::new(camera.width, camera.height, |x, y| (x + 2 * y) % 3 == k);
            camera.clone().with_tiles(set)
        };
        let [a, b, mut white]: [Camera; 3] = orbit(&splats.geometry, 3, 70, 50).try_into().unwrap();
        white.background = Some([1.0; 3]);
        let black = Camera { background: None, ..white.clone() };
        let cameras = [some(&a, 0), b.clone(), some(&white, 1), some(&a, 2), some(&a, 0), some(&black, 1), b];
        let pictures = fit_pictures(&splats, &cameras, &Silent).unwrap();
        let (mut cpu, options) = (Renderer::cpu(), DrawOptions::default());
        let bytes = |image: Image| image.to_8bit();
        let alone = draw_each(&mut cpu, &Scene::from(&splats), &cameras, &options, bytes, &Silent).unwrap();
        assert!(pictures == alone && pictures[2] != pictures[5]);
    }
}
