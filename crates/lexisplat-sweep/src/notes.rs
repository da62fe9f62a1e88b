//! What the paper's numbers count, where that is not what one would think.

/// One thing to know before comparing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Note {
    /// In a few words.
    pub title: &'static str,
    /// The whole.
    pub text: &'static str,
}

/// What differs between the paper's way of counting and ours. Plain text.
pub const NOTES: [Note; 8] = [
    Note {
        title: "The paper's Comp Ratio counts coefficients, not bytes",
        text: "45 over its ratio gives 11.7 nonzeros a Gaussian for 3DGS, the number that the paper's own cost \
               model uses. Indices, pointers, the dictionary and everything that is not SH-rest are left out. \
               With 32-bit values and indices, as its bandwidth model has them, SH-rest would shrink 1.85 times and \
               the whole model 1.54 times. Here the coefficient ratio is printed for comparison, and beside it \
               the ratio of whole files, every byte counted.",
    },
    Note {
        title: "The tolerance is the un-squared L2 norm",
        text: "The paper does not say whether tol is squared or relative. Its PSNR falls by 5.5 to 6.2 dB each \
               time tol doubles (MCMC, Pixel-GS); a squared one would fall by 3 dB. Here tol bounds the \
               length of a Gaussian's SH-rest error, absolutely.",
    },
    Note {
        title: "The paper's 3DGS rows have a floor of about 44 dB",
        text: "Its 3DGS PSNR against the original follows MSE = 3.8e-5 + 0.0063 tol^2; the first term does not \
               come from compression, and its MCMC and Pixel-GS rows do not have it. Two slightly different \
               renderers would explain it. Here original and compressed are drawn by one renderer, so the MCMC \
               and Pixel-GS rows are the ones to compare with.",
    },
    Note {
        title: "Some printed means do not follow from their rows",
        text: "FPS(-Comp) of 3DGS is printed as 169.3, its columns average 177.0; of MCMC 113.0, columns 120.8. \
               So the speedups are 17.9 % and 16.3 %, not 23.3 % and 24.3 %. Against photos, LPIPS of compressed \
               MCMC is printed as 0.1677, columns 0.1667; SSIM of EAGLES 0.8689, columns 0.8535. SSIM of \
               compressed Pixel-GS (0.8619, columns 0.8618) is a matter of rounding. Means of the paper are \
               taken from its columns here.",
    },
    Note {
        title: "LPIPS is computed in two ways",
        text: "The 3DGS repository feeds LPIPS pictures in 0..1 where the network expects -1..1. Tables of 3DGS \
               papers print that value, and so probably this paper does; it does not say. LPIPS (VGG, as 3DGS) \
               is the one to compare with, LPIPS (VGG) is the standard one.",
    },
    Note {
        title: "FPS are of another device",
        text: "The paper's FPS were measured on an NVIDIA RTX 4090, at a resolution that it does not name. Ours are of the device \
               named beside them, at the picture size named in the list of models. Only the change from dense to \
               sparse can be compared, and on a CPU not even that.",
    },
    Note {
        title: "The paper's models are its own",
        text: "Its baselines against photos are above the usual ones for some scenes (garden 28.15 dB, usually \
               27.3), so they were trained otherwise or scored at another resolution. Models of the same scene and \
               trainer from elsewhere need not have the same nonzeros.",
    },
    Note {
        title: "The paper's table against photos names no tolerance",
        text: "It is set beside tolerance 0.1 here, which its main table has.",
    },
];
