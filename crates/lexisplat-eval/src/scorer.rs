//! Scores two pictures by several metrics.

use std::collections::BTreeMap;
use std::sync::Arc;

use lexisplat_render::Image;

use crate::metrics::lpips::{Network, PixelRange};
use crate::metrics::{Lpips, Metric, flip, psnr, ssim};
use crate::scores::ViewScore;
use lexisplat_compress::Result;

/// Scores pictures by PSNR and SSIM, and by more metrics if they are added. Clones share the weights of networks.
#[derive(Debug, Clone, Default)]
pub struct Scorer {
    flip: bool,
    lpips: Vec<Arc<Lpips>>,
}

impl Scorer {
    /// Returns a scorer by PSNR and SSIM.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds FLIP.
    #[must_use]
    pub fn with_flip(mut self) -> Self {
        self.flip = true;
        self
    }

    /// Adds LPIPS by this network, with pictures in both ranges. A network of the same kind is replaced.
    #[must_use]
    pub fn with_lpips(mut self, lpips: Lpips) -> Self {
        self.lpips.retain(|other| other.network() != lpips.network());
        self.lpips.push(Arc::new(lpips));
        self
    }

    /// Returns the metrics that are measured, in the order of tables.
    #[must_use]
    pub fn metrics(&self) -> Vec<Metric> {
        let mut metrics = vec![Metric::Psnr, Metric::Ssim];
        metrics.extend(self.flip.then_some(Metric::Flip));
        metrics.extend(
            self.lpips.iter().flat_map(|lpips| lpips_metrics(lpips.network())).map(|(metric, _)| metric),
        );
        metrics.sort_unstable();
        metrics
    }

    /// Scores picture `b` against `a`. The score is called `name`.
    ///
    /// # Errors
    /// [`lexisplat_compress::Error::Parameter`] if the sizes of the pictures differ or are too small for a network, or if
    /// a picture has NaN.
    pub fn score(&self, name: &str, a: &Image, b: &Image) -> Result<ViewScore> {
        let psnr = psnr(a, b)?;
        let identical = psnr.is_none();
        let mut more = BTreeMap::new();
        if self.flip {
            more.insert(Metric::Flip, if identical { 0.0 } else { flip(a, b)? });
        }
        for lpips in &self.lpips {
            for (metric, range) in lpips_metrics(lpips.network()) {
                more.insert(metric, if identical { 0.0 } else { lpips.distance(a, b, range)? });
            }
        }
        let ssim = if identical { 1.0 } else { ssim(a, b)? };
        Ok(ViewScore::new(name, [a.width, a.height], psnr, ssim, more))
    }
}

/// Returns the metrics of a network, each with its range of pixel values.
fn lpips_metrics(network: Network) -> [(Metric, PixelRange); 2] {
    match network {
        Network::Vgg => {
            [(Metric::LpipsVgg, PixelRange::Standard), (Metric::LpipsVggInria, PixelRange::Inria)]
        }
        Network::Alex => {
            [(Metric::LpipsAlex, PixelRange::Standard), (Metric::LpipsAlexInria, PixelRange::Inria)]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::lpips::testing::random;
    use crate::metrics::testing::picture;

    #[test]
    fn a_score_has_what_was_asked_for() {
        let (a, b) = (picture(40, 32, 1), picture(40, 32, 2));
        let basic = Scorer::new();
        assert_eq!(basic.metrics(), [Metric::Psnr, Metric::Ssim]);
        assert!(basic.score("view", &a, &b).unwrap().more.is_empty());

        let lpips = random(Network::Alex, 1);
        let expected =
            [PixelRange::Standard, PixelRange::Inria].map(|range| lpips.distance(&a, &b, range).unwrap());
        let scorer = Scorer::new().with_lpips(random(Network::Alex, 2)).with_lpips(lpips).with_flip();
        let metrics = [Metric::Psnr, Metric::Ssim, Metric::Flip, Metric::LpipsAlex, Metric::LpipsAlexInria];
        assert_eq!(scorer.metrics(), metrics);
        let found = scorer.score("view", &a, &b).unwrap();
        assert!(metrics.iter().all(|&metric| found.get(metric).is_some()));
        assert_eq!(found.more.len(), 3);
        assert_eq!(found.get(Metric::Flip), Some(flip(&a, &b).unwrap()));
        assert_eq!(found.get(Metric::LpipsAlex), Some(expected[0]));
        assert_eq!(found.get(Metric::LpipsAlexInria), Some(expected[1]));
        assert!(expected[0] != expected[1] && expected[0] > 0.0);
    }

    #[test]
    fn identical_pictures_need_no_network() {
        // The picture is too small for the network.
        let a = picture(12, 12, 1);
        let scorer = Scorer::new().with_flip().with_lpips(random(Network::Alex, 1));
        let found = scorer.score("same", &a, &a).unwrap();
        assert!(found.identical && found.psnr.is_none());
        assert_eq!(found.get(Metric::Ssim), Some(1.0));
        for metric in [Metric::Flip, Metric::LpipsAlex, Metric::LpipsAlexInria] {
            assert_eq!(found.get(metric), Some(0.0));
        }
        assert!(scorer.score("other", &a, &picture(12, 12, 2)).is_err());
    }
}
