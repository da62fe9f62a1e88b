"""Scores of two pictures, as the field measures them.

A picture is an array of (height, width, 3): floats from 0 to 1, or uint8. Values outside are clipped, and a
:class:`lexisplat.LexisplatWarning` says so. Pictures with NaN are refused.
"""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np

from . import _native
from ._arguments import checked, flag
from ._errors import LexisplatWarning, ParameterError
from ._sources import Source, opened
from ._splats import host

__all__ = ["flip", "lpips", "psnr", "score", "ssim"]


#: Largest values that pictures from 0 to 255 are told by.
_BYTES = 2.0


def _picture(name: str, values: Any) -> Any:
    picture = np.asarray(host(values))
    if picture.ndim != 3 or picture.shape[2] != 3 or (picture.dtype.kind != "f" and picture.dtype != np.uint8):
        found = f"an array of {picture.dtype} of shape {picture.shape}"
        error = ParameterError(f"picture {name} = {found}: (height, width, 3) of floats from 0 to 1, or uint8")
        error.name = name
        raise error
    if picture.dtype == np.uint8:
        return picture.astype(np.float32) / np.float32(255)
    return np.require(picture, np.float32, ["C", "A"])


def _score(a: Any, b: Any, flip: bool = False, lpips: Any = None) -> dict[str, float]:
    """The scores, for a public function that calls this."""
    pictures = _picture("a", a), _picture("b", b)
    weights = None if lpips is None else opened("lpips", lpips)[0]
    scores, outside = _native.score(*pictures, flip=flag("flip", flip), lpips=weights)
    for name, ends in zip("ab", outside):
        if ends is not None:
            hint = "; divide by 255, or pass uint8" if ends[1] > _BYTES else ""
            told = f"picture {name}: values from {ends[0]:g} to {ends[1]:g} are clipped to 0..1{hint}"
            warnings.warn(told, LexisplatWarning, stacklevel=4)
    return {"psnr": math.inf, **scores}


@checked()
def score(a: Any, b: Any, *, flip: bool = False, lpips: Source | None = None) -> dict[str, float]:
    """All scores of picture ``b`` against ``a``: ``psnr`` (infinite if they are identical) and ``ssim``.

    Parameters
    ----------
    flip : bool
        Also FLIP at 67 pixels a degree.
    lpips : path, bytes or file object, optional
        Weights that ``scripts/lpips_weights.py`` of the project converts; adds LPIPS in both ranges of values.

    Raises
    ------
    ParameterError
        The pictures differ in size, or one has NaN or another type.
    """
    return _score(a, b, flip, lpips)


@checked()
def psnr(a: Any, b: Any) -> float:
    """Peak signal-to-noise ratio in dB for a peak of 1; infinite if the pictures are identical."""
    return _score(a, b)["psnr"]


@checked()
def ssim(a: Any, b: Any) -> float:
    """Structural similarity as the 3DGS authors compute it: window of 11, sigma 1.5, zero padding."""
    return _score(a, b)["ssim"]


@checked()
def flip(a: Any, b: Any) -> float:
    """Mean FLIP at 67 pixels a degree: 0 for identical pictures, at most 1."""
    return _score(a, b, flip=True)["flip"]


@checked()
def lpips(a: Any, b: Any, weights: Source) -> dict[str, float]:
    """LPIPS by the network of ``weights``, with pictures from -1 to 1 and, as the 3DGS authors call it, from 0 to 1."""
    return {name: value for name, value in _score(a, b, lpips=weights).items() if name.startswith("lpips")}
