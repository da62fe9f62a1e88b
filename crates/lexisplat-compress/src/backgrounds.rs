//! Black and white behind the scene.
//!
//! Viewers choose the colour behind a scene, and behind a part of a scene are other parts. Over black a dark Gaussian shows as
//! much as nothing, so it would be left out, and over white there would be a hole (docs/METHOD.md, "Backgrounds").

use lexisplat_render::Camera;

/// The colours behind the scene.
const BLACK: [f32; 3] = [0.0; 3];
const WHITE: [f32; 3] = [1.0; 3];

/// 2^32 over the golden ratio. Multiples of it spread evenly over 32 bits, and so does every second or third of them.
const GOLDEN: u32 = 0x9e37_79b9;

/// Gives each of `cameras` black or white as its background: white to about half of them, and to about half of every second or third.
pub(crate) fn black_and_white(cameras: &mut [Camera]) {
    for (i, camera) in (0_u32..).zip(cameras) {
        camera.background = Some(if i.wrapping_mul(GOLDEN) > u32::MAX / 2 { WHITE } else { BLACK });
    }
}

/// Returns white for black, and black for white.
pub(crate) fn opposite(background: [f32; 3]) -> [f32; 3] {
    background.map(|v| 1.0 - v)
}

#[cfg(test)]
mod tests {
    use lexisplat::packed::{PackOptions, Packer, Preset};
    use lexisplat::sh::C0;
    use lexisplat::{Silent, Splats};
    use lexisplat_render::{Renderer, orbit};
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;
    use crate::Judge;
    use crate::packing_views::Looked;
    use crate::parts::Parts;
    use crate::refit::{Fit, Refitting};
    use crate::views::Viewpoints;

    /// A scene one side of which is black.
    fn half_black() -> Splats {
        let mut splats = scene(&SampleOptions::new(1200, 3));
        splats.sh_rest.fill(0.0);
        let g = &mut splats.geometry;
        let left = g.dc.iter_mut().zip(&g.positions).filter(|(_, position)| position[0] < 0.0);
        left.for_each(|(dc, _)| *dc = [-0.5 / C0; 3]);
        splats
    }

    /// The quality of a file of `splats` over white, in dB, in views that nothing was fitted to.
    fn over_white(splats: &Splats, packed: &Splats) -> f64 {
        let mut views = orbit(&splats.geometry, 7, 96, 72);
        views.iter_mut().for_each(|view| view.background = Some(WHITE));
        let mut judge = Judge::new(Renderer::cpu(), splats, &views, true, &Silent).unwrap();
        judge.score(packed, &Silent).unwrap().mean
    }

    #[test]
    fn black_gaussians_stay() {
        let splats = half_black();
        let options = PackOptions::default();
        let views = orbit(&splats.geometry, 24, 96, 72);
        for cameras in [None, Some(&views[..])] {
            let Looked { views, sensitivity } =
                Looked::at(&mut Renderer::cpu(), &splats, cameras, Viewpoints::Auto, &Silent).unwrap();
            let fit = Fit::to(&splats, views.fitting(&splats), views.are_given(), &Silent).unwrap();
            let refitting = Refitting::new(Packer::new(&splats, &sensitivity, &options).unwrap(), Some(fit));
            let step = refitting.step_for(Preset::Balanced.decibels());
            let packed = refitting.pack(step, true, &Silent).unwrap().0.unpack().unwrap().into_splats();
            let quality = over_white(&splats, &packed);
            assert!(quality > 32.0, "{quality} {}", packed.len());
        }
        // They also stay in a part, since other parts may be behind it.
        let parts = Parts { options: &options, decibels: 40.0, refine: None, gaussians: splats.len() };
        let observed = parts.observe(&mut Renderer::cpu(), &splats, &Silent).unwrap().0;
        let packer = Packer::new(&splats, &observed.sensitivity, &options).unwrap();
        let packed = packer.pack(observed.step_factor * packer.step_for(40.0), &Silent).unwrap().0;
        let quality = over_white(&splats, &packed.unpack().unwrap().into_splats());
        assert!(quality > 33.0, "{quality}");
    }

    #[test]
    fn any_stride_has_both() {
        let mut cameras = orbit(&half_black().geometry, 48, 8, 8);
        black_and_white(&mut cameras);
        for stride in 1..=6 {
            let white = cameras.iter().step_by(stride).filter(|camera| camera.background == Some(WHITE));
            let (white, all) = (white.count(), 48_usize.div_ceil(stride));
            assert!(white * 4 > all && white * 4 < 3 * all, "{stride}: {white} of {all}");
        }
        assert_eq!(opposite(BLACK), WHITE);
    }
}
