"""Makes trained 3D Gaussian Splatting scenes small, and keeps them fast and faithful.

    import lexisplat as lx

    splats = lx.load("point_cloud.ply")
    scene = lx.compress(splats, preset="balanced")
    scene.save("scene.lexi")
    print(scene, lx.compare(splats, scene)["psnr"])
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from . import metrics
from ._cameras import Camera, cameras, orbit, photographs
from ._compress import compress
from ._draw import compare, render
from ._errors import (
    Error,
    FormatError,
    GpuError,
    IoError,
    LexisplatWarning,
    LimitError,
    ParameterError,
    WrongTypeError,
)
from ._files import load, save
from ._native import __version__
from ._scene import Codes, Scene, open
from ._splats import Splats

if TYPE_CHECKING:
    from .gsplat import LexiCompression
    from .learn import DictionaryLearner

__all__ = [
    "Camera",
    "Codes",
    "DictionaryLearner",
    "Error",
    "FormatError",
    "GpuError",
    "IoError",
    "LexiCompression",
    "LexisplatWarning",
    "LimitError",
    "ParameterError",
    "Scene",
    "Splats",
    "WrongTypeError",
    "__version__",
    "cameras",
    "compare",
    "compress",
    "load",
    "metrics",
    "open",
    "orbit",
    "photographs",
    "render",
    "save",
]


def __getattr__(name: str) -> object:
    # scikit-learn takes a second to import, where it is installed.
    if name == "DictionaryLearner":
        from .learn import DictionaryLearner

        return DictionaryLearner
    if name == "LexiCompression":
        from .gsplat import LexiCompression

        return LexiCompression
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
