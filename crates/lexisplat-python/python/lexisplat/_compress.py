"""Compression."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Literal, Union

import numpy as np

from . import _native
from ._cameras import Camera, as_tuples, cameras as read_cameras
from ._device import quiet
from ._files import Source, warn
from ._progress import Progress, reporter
from ._scene import Scene
from ._splats import FloatArray, Splats

Preset = Literal["small", "balanced", "high", "archive"]
Layout = Literal["packed", "f16", "f32", "paper"]
#: Cameras, or the path of a file or folder that :func:`lexisplat.cameras` reads.
Cameras = Union[Sequence[Camera], str, "os.PathLike[str]"]

#: What names a file, or is one.
_FILE = (str, bytes, os.PathLike)
#: Memory that packing a whole scene may take before it is packed in parts, as the program's default (2 GiB).
DEFAULT_MEMORY = 2 << 30


def compress(
    scene: Splats | Source,
    *,
    preset: Preset | None = None,
    psnr: float | None = None,
    min_psnr: float | None = None,
    size: int | None = None,
    ratio: float | None = None,
    tol: float | None = None,
    cameras: Cameras | None = None,
    views: Literal["auto", "object", "room"] | None = None,
    layout: Layout | None = None,
    atoms: int | None = None,
    pursuit: Literal["omp", "ols"] | None = None,
    max_nonzeros: int | None = None,
    dictionary: FloatArray | Source | None = None,
    sample: int | None = None,
    seed: int = 0,
    keep_order: bool = False,
    keep_all: bool = False,
    max_gaussians: int | None = None,
    guess: bool = False,
    memory: int = DEFAULT_MEMORY,
    device: str = "cpu",
    drop_invalid: bool = False,
    drop_extras: bool = False,
    limit: Mapping[str, int] | None = None,
    progress: Progress = None,
) -> Scene:
    """Compresses a scene. Needs no photos and no training. Same input, options and seed give the same bytes as the program.

    Parameters
    ----------
    scene : Splats, path or bytes
        The scene, or a file of any format that :func:`load` reads but .lexi. A file is read part by part where that is
        enough, and need not fit into memory.
    preset : {"small", "balanced", "high", "archive"}, optional
        About 35, 40, 45 or 54 dB of PSNR. ``"balanced"`` if no other target is given.
    psnr, min_psnr : float, optional
        The smallest file whose pictures have this PSNR in dB on average, or each of them.
    size : int, optional
        The best file of at most this many bytes.
    ratio : float, optional
        The best file that is this many times smaller than the source. Of arrays the source is their bytes.
    tol : float, optional
        Largest L2 norm (not squared) of the error of a Gaussian's SH vector, verified for every Gaussian. Geometry is
        then kept exactly, unless ``layout="packed"``.
    cameras : sequence of Camera, or path, optional
        What pictures are judged from. Otherwise views like photographs are looked for.
    views : {"auto", "object", "room"}, optional
        Where generated views are taken from.
    layout : {"packed", "f16", "f32", "paper"}, optional
        ``"packed"`` quantises and entropy-codes everything. The others keep geometry exactly.
    atoms : int, optional
        Atoms of the dictionary, 1 to 1024.
    pursuit, max_nonzeros, dictionary, sample
        For layouts with exact geometry: ``"omp"`` or ``"ols"``; most nonzeros a Gaussian; a dictionary to use, as an array
        of (atoms, 3 K) or a file; most Gaussians to learn from.
    seed : int
        Seed of the choice of Gaussians that the dictionary is learned from.
    keep_order : bool
        Whether packed files hold the order of the source.
    keep_all : bool
        Whether no Gaussian may be left out.
    max_gaussians : int, optional
        Most Gaussians in the file.
    guess : bool
        Whether what shows is estimated without drawing: several times faster, for larger files.
    memory : int
        Bytes that packing a whole scene may take, about. A scene that needs more is packed in parts.
    device : {"cpu", "gpu", "auto"} or a number as text
        What draws. With ``"cpu"`` the bytes are the same on every machine.
    drop_invalid, drop_extras, limit
        For files, as :func:`load`.
    progress : callable or bool, optional
        Called as ``progress(stage, done, total)``; ``True`` shows bars by tqdm. Ctrl-C ends the work.

    Raises
    ------
    ParameterError
        An option is out of range, two do not go together, or a target cannot be met.
    IoError, FormatError, LimitError, GpuError
    """
    choices = {
        "preset": preset,
        "psnr": psnr,
        "min_psnr": min_psnr,
        "size": size,
        "ratio": ratio,
        "tol": tol,
        "max_nonzeros": max_nonzeros,
        "atoms": atoms,
        "pursuit": pursuit,
        "layout": layout,
        "sample": sample,
        "seed": seed,
        "cameras": None if cameras is None else as_tuples(views_of(cameras)),
        "scene": views,
        "keep_order": keep_order,
        "keep_all": keep_all,
        "max_gaussians": max_gaussians,
        "guess": guess,
        "memory": memory,
        "device": device,
    }
    with quiet(device):
        made = _native.compress(
            scene if isinstance(scene, _FILE) else _splats(scene),
            choices,
            dictionary=dictionary if isinstance(dictionary, _FILE) else _atoms(dictionary),
            drop_invalid=drop_invalid,
            drop_extras=drop_extras,
            limit=None if limit is None else dict(limit),
            progress=reporter(progress),
        )
    result = Scene(made)
    warn((result.report or {})["warnings"], "the scene" if isinstance(scene, Splats) else scene)
    return result


def _splats(scene: object) -> object:
    if isinstance(scene, Splats):
        return scene._checked()
    kind = type(scene).__name__
    raise TypeError(f"{kind}: expected Splats, a path or bytes; Splats.from_dict takes a dict of arrays")


def _atoms(dictionary: object) -> object:
    return None if dictionary is None else np.require(dictionary, np.float32, ["C", "A"])


def views_of(cameras: Cameras | Camera) -> Sequence[Camera]:
    """The cameras that ``cameras`` means."""
    if isinstance(cameras, Camera):
        return [cameras]
    return read_cameras(cameras) if isinstance(cameras, (str, os.PathLike)) else cameras
