"""Scores of two pictures, as the field measures them.

A picture is an array of (height, width, 3): floats from 0 to 1, or uint8. Values are clipped to 0..1 first.
"""

from __future__ import annotations

import math
import os
from typing import Any

import numpy as np

from . import _native
from ._errors import ParameterError
from ._splats import host

__all__ = ["flip", "lpips", "psnr", "score", "ssim"]


def _picture(values: Any) -> Any:
    picture = np.asarray(host(values))
    if picture.dtype == np.uint8:
        return picture.astype(np.float32) / np.float32(255)
    if picture.dtype.kind != "f" or picture.ndim != 3 or picture.shape[2] != 3:
        found = f"an array of {picture.dtype} of shape {picture.shape}"
        raise ParameterError(f"picture = {found}: (height, width, 3) of floats from 0 to 1, or uint8")
    return np.require(picture, np.float32, ["C", "A"])


def score(a: Any, b: Any, *, flip: bool = False, lpips: str | os.PathLike[str] | bytes | None = None) -> dict[str, float]:
    """All scores of picture ``b`` against ``a``: ``psnr`` (infinite if they are identical) and ``ssim``.

    Parameters
    ----------
    flip : bool
        Also FLIP at 67 pixels a degree.
    lpips : path or bytes, optional
        Weights that ``scripts/lpips_weights.py`` of the project converts; adds LPIPS in both ranges of values.
    """
    scores = dict(_native.score(_picture(a), _picture(b), flip=flip, lpips=lpips))
    scores.setdefault("psnr", math.inf)
    return scores


def psnr(a: Any, b: Any) -> float:
    """Peak signal-to-noise ratio in dB for a peak of 1; infinite if the pictures are identical."""
    return score(a, b)["psnr"]


def ssim(a: Any, b: Any) -> float:
    """Structural similarity as the 3DGS authors compute it: window of 11, sigma 1.5, zero padding."""
    return score(a, b)["ssim"]


def flip(a: Any, b: Any) -> float:
    """Mean FLIP at 67 pixels a degree: 0 for identical pictures, at most 1."""
    return score(a, b, flip=True)["flip"]


def lpips(a: Any, b: Any, weights: str | os.PathLike[str] | bytes) -> dict[str, float]:
    """LPIPS by the network of ``weights``, with pictures from -1 to 1 and, as the 3DGS authors call it, from 0 to 1."""
    return {name: value for name, value in score(a, b, lpips=weights).items() if name.startswith("lpips")}
