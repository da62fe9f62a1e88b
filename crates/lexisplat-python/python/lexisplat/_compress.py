"""Compression."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, TypeGuard, Union

import numpy as np

from . import _native
from ._arguments import BYTE, MOST_SEED, checked, count, flag, limits, number, optional, size as bytes_of, text, wrong_type
from ._arguments import device as device_of
from ._cameras import Camera, as_tuples
from ._cameras import cameras as read_cameras
from ._device import quiet
from ._files import warn
from ._progress import Progress, reporter
from ._scene import Scene
from ._sources import Source, is_source, opened, shown
from ._splats import FloatArray, Splats, floats

Preset = Literal["small", "balanced", "high", "archive"]
Layout = Literal["packed", "f16", "f32", "paper"]
#: Cameras, or the path of a file or folder that :func:`lexisplat.cameras` reads.
Cameras = Union[Sequence[Camera], str, "os.PathLike[str]"]

#: Memory that packing a whole scene may take before it is packed in parts, as the program's default (4 GiB).
DEFAULT_MEMORY = 4 << 30


def _seed(name: str, value: object) -> int:
    return count(name, value, MOST_SEED)


#: The check of each option of :func:`compress` that the native part has, but for cameras.
_OPTIONS: dict[str, Callable[[str, Any], object]] = {
    **dict.fromkeys(["preset", "pursuit", "views", "view", "layout"], text),
    **dict.fromkeys(["psnr", "min_psnr", "ratio", "tol"], number),
    **dict.fromkeys(["size", "memory"], bytes_of),
    **dict.fromkeys(["atoms", "sample", "max_gaussians"], count),
    "refine": lambda name, value: text(name, value) if isinstance(value, str) else repr(float(number(name, value))),
    **dict.fromkeys(["keep_order", "keep_all", "lod", "guess"], flag),
    "max_nonzeros": lambda name, value: count(name, value, BYTE),
    "seed": _seed,
}
#: The options that may not be ``None``.
_NEEDED = ("seed", "keep_order", "keep_all", "lod", "guess", "memory")


def options_of(given: Mapping[str, Any]) -> dict[str, Any]:
    """Options of :func:`compress` as the native part takes them."""
    return {
        name: check(name, given[name]) if name in _NEEDED else optional(check, name, given[name])
        for name, check in _OPTIONS.items()
        if name in given
    }


@checked()
def compress(
    scene: Splats | Source,
    *,
    preset: Preset | None = None,
    psnr: float | None = None,
    min_psnr: float | None = None,
    size: int | float | str | None = None,
    ratio: float | None = None,
    tol: float | None = None,
    cameras: Cameras | None = "auto",
    views: Literal["auto", "object", "room"] | None = None,
    view: str | None = "auto",
    layout: Layout | None = None,
    atoms: int | None = None,
    pursuit: Literal["omp", "ols"] | None = None,
    max_nonzeros: int | None = None,
    dictionary: FloatArray | Source | None = None,
    sample: int | None = None,
    seed: int = 0,
    keep_order: bool = False,
    keep_all: bool = False,
    lod: bool = False,
    max_gaussians: int | None = None,
    refine: Literal["quick", "thorough"] | float | None = None,
    guess: bool = False,
    memory: int | float | str = DEFAULT_MEMORY,
    device: str | int = "cpu",
    drop_invalid: bool = False,
    drop_extras: bool = False,
    limit: Mapping[str, int | float | str] | None = None,
    progress: Progress = None,
) -> Scene:
    """Compresses a scene. Needs no photos and no training. Same input, options and seed give the same bytes as the program.

    Parameters
    ----------
    scene : Splats, path, bytes or file object
        The scene, or a file of any format that :func:`load` reads but .lexi. A file is read part by part where that is
        enough, and need not fit into memory.
    preset : {"small", "balanced", "high", "archive"}, optional
        About 35, 40, 45 or 54 dB of PSNR. ``"balanced"`` if no other target is given.
    psnr, min_psnr : float, optional
        The smallest file whose pictures have this PSNR in dB on average, or each of them.
    size : int or str, optional
        The best file of at most this many bytes: ``2_000_000``, ``2e6``, ``"2MB"`` or ``"2MiB"``.
    ratio : float, optional
        The best file that is this many times smaller than the source. Of arrays the source is their bytes.
    tol : float, optional
        Largest L2 norm (not squared) of the error of a Gaussian's SH vector, verified for every Gaussian. Geometry is
        then kept exactly, unless ``layout="packed"``.
    cameras : "auto", sequence of Camera, or path, optional
        What pictures are judged from. With ``"auto"``, the cameras that lie beside the scene's file or one folder above, or
        where INRIA's trainer leaves them, if they seem to belong to it: ``cameras.json``, ``transforms.json`` or COLMAP's
        ``sparse/0``. Otherwise, and with ``None``, views like photographs are looked for.
    views : {"auto", "object", "room"}, optional
        Where generated views are taken from.
    view : "auto" or str, optional
        The view from which viewers show the scene first: a link that a viewer copied, or its part after ``view=``. With
        ``"auto"`` it is the best of the cameras, or of generated views; with ``guess`` there is none.
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
    lod : bool
        Whether a large scene has levels of detail: layers of fewer Gaussians, of which readers draw far parts. Each takes
        0.15 to 0.25 % more bytes.
    max_gaussians : int, optional
        Most Gaussians in the file.
    refine : {"quick", "thorough"} or float, optional
        Remove and merge more Gaussians, and fit the others to pictures of the scene: positions, shapes, colours and
        opacities. At the same quality the file is about a quarter smaller with cameras, and a tenth without. A number is
        about the minutes that the fit takes on one thread.
    guess : bool
        Whether what shows is estimated without drawing: several times faster, for larger files.
    memory : int or str
        Bytes that packing a whole scene may take, about. A scene that needs more is packed in parts, and so is
        one of more than 786,432 Gaussians without cameras, or of more than 262,144 with ``refine``.
    device : {"cpu", "gpu", "auto"} or a number as text
        What draws. With ``"cpu"`` the bytes are the same on every machine.
    drop_invalid : bool
        Whether Gaussians with NaN or infinite values are left out. Otherwise such a scene is refused.
    drop_extras, limit
        For files, as :func:`load`.
    progress : callable or bool, optional
        Called as ``progress(stage, done, total)``; ``True`` shows bars by tqdm. Ctrl-C ends the work.

    Raises
    ------
    ParameterError
        An option is out of range, two do not go together, or a target cannot be met. An option of a wrong type, or that does
        not exist, is a :class:`WrongTypeError`.
    IoError, FormatError, LimitError, GpuError
    """
    given = locals()
    choices = options_of(given)
    choices["device"] = device = device_of(device)
    kept = {name: flag(name, given[name]) for name in ("drop_invalid", "drop_extras")}
    allowed, report = limits(limit), reporter(progress)
    choices["cameras"] = None if cameras is None or _is_auto(cameras) else as_tuples(views_of(cameras))
    choices["beside"] = os.fsdecode(scene) if _is_auto(cameras) and views is None and _is_path(scene) else None
    source, name = opened("scene", scene) if is_source(scene) else (_splats(scene), "the scene")
    atoms_of = opened("dictionary", dictionary)[0] if is_source(dictionary) else _atoms(dictionary)
    with quiet(device):
        made, told = _native.compress(source, choices, dictionary=atoms_of, limit=allowed, progress=report, **kept)
    result = Scene(made, allowed)
    warn([*told, *(result.report or {})["warnings"]], shown(scene, name))
    return result


def _is_auto(cameras: object) -> bool:
    return isinstance(cameras, str) and cameras == "auto"


def _is_path(scene: object) -> TypeGuard[str | os.PathLike[str]]:
    return isinstance(scene, (str, os.PathLike))


def _splats(scene: object) -> object:
    if isinstance(scene, Splats):
        return scene._checked()
    expected = "Splats, a path, bytes or a file object; Splats.from_dict takes a dict of arrays"
    if isinstance(scene, Scene):
        expected = "Splats, a path, bytes or a file object; it is compressed already, and decode() gives its Splats"
    raise wrong_type("scene", scene, expected)


def _atoms(dictionary: object) -> object:
    return None if dictionary is None else np.require(floats("dictionary", dictionary), requirements=["C", "A"])


def views_of(cameras: Cameras | Camera) -> Sequence[Camera]:
    """The cameras that ``cameras`` means."""
    if isinstance(cameras, Camera):
        return [cameras]
    return read_cameras(cameras) if isinstance(cameras, (str, os.PathLike)) else cameras
