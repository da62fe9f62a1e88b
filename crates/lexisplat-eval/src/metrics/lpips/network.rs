//! The networks whose features LPIPS compares.

use std::fmt;

use super::conv::ConvShape;

/// A network whose features are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Network {
    /// VGG16 (torchvision `vgg16`).
    Vgg,
    /// AlexNet (torchvision `alexnet`).
    Alex,
}

/// A pooling layer before a stage.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pool {
    pub(super) side: usize,
    pub(super) stride: usize,
}

/// Layers of a network. The output of the last layer is compared.
#[derive(Debug)]
pub(super) struct Stage {
    pub(super) pool: Option<Pool>,
    pub(super) convs: Vec<ConvShape>,
}

/// Number of stages of either network.
pub(super) const STAGES: usize = 5;
/// Channels of a picture.
pub(super) const COLOURS: usize = 3;

impl Network {
    /// Both networks.
    pub const ALL: [Self; 2] = [Self::Vgg, Self::Alex];

    /// Returns the name in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Vgg => "vgg",
            Self::Alex => "alex",
        }
    }

    /// Returns the stages in order (torchvision `models/vgg.py`, configuration D, and
    /// `models/alexnet.py`; cut as in `lpips/pretrained_networks.py`).
    pub(super) fn stages(self) -> [Stage; STAGES] {
        match self {
            Self::Vgg => vgg(),
            Self::Alex => alex(),
        }
    }

    /// Returns the smallest width and height of a picture that reaches the last stage, in pixels.
    #[must_use]
    pub fn min_size(self) -> u32 {
        match self {
            // Halved by four pools.
            Self::Vgg => 16,
            // The first convolution has windows of 11, 4 apart: (31 + 4 - 11) / 4 + 1 is 7. Pools of 3, 2 apart, reduce 7
            // to 3 and 3 to 1.
            Self::Alex => 31,
        }
    }
}

impl fmt::Display for Network {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Vgg => "VGG16",
            Self::Alex => "AlexNet",
        })
    }
}

fn vgg() -> [Stage; STAGES] {
    let (mut inputs, mut index) = (COLOURS, 0);
    [(2, 64), (2, 128), (3, 256), (3, 512), (3, 512)].map(|(count, outputs)| {
        let pool = (index > 0).then_some(Pool { side: 2, stride: 2 });
        let convs = (0..count)
            .map(|_| {
                let conv = ConvShape { index, inputs, outputs, side: 3, stride: 1, padding: 1 };
                // Convolution and ReLU.
                index += 2;
                inputs = outputs;
                conv
            })
            .collect();
        // The pool after it.
        index += 1;
        Stage { pool, convs }
    })
}

fn alex() -> [Stage; STAGES] {
    let pool = Some(Pool { side: 3, stride: 2 });
    let small = ConvShape { index: 0, inputs: 0, outputs: 0, side: 3, stride: 1, padding: 1 };
    let stage = |pool, conv| Stage { pool, convs: vec![conv] };
    [
        stage(None, ConvShape { index: 0, inputs: COLOURS, outputs: 64, side: 11, stride: 4, padding: 2 }),
        stage(pool, ConvShape { index: 3, inputs: 64, outputs: 192, side: 5, stride: 1, padding: 2 }),
        stage(pool, ConvShape { index: 6, inputs: 192, outputs: 384, ..small }),
        stage(None, ConvShape { index: 8, inputs: 384, outputs: 256, ..small }),
        stage(None, ConvShape { index: 10, inputs: 256, outputs: 256, ..small }),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_are_torchvisions() {
        let indices = |network: Network| -> Vec<usize> {
            network.stages().iter().flat_map(|s| &s.convs).map(|c| c.index).collect()
        };
        assert_eq!(indices(Network::Vgg), [0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28]);
        assert_eq!(indices(Network::Alex), [0, 3, 6, 8, 10]);
        let parameters = |network: Network| -> usize {
            let stages = network.stages();
            let convs = stages.iter().flat_map(|s| &s.convs);
            convs.map(|c| c.weight_shape().iter().product::<usize>() + c.outputs).sum()
        };
        // Of `sum(p.numel() for p in torchvision.models.vgg16().features.parameters())`, and alexnet's.
        assert_eq!(parameters(Network::Vgg), 14_714_688);
        assert_eq!(parameters(Network::Alex), 2_469_696);
    }
}
