"""Reading and writing scenes of any format."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Mapping, Sequence
from typing import Literal

from . import _native
from ._arguments import BYTE, MOST_32, checked, count, flag, limits, optional, several, text, wrong, wrong_type
from ._arguments import path as path_of
from ._cameras import native
from ._errors import LexisplatWarning
from ._progress import Progress, reporter
from ._scene import Scene
from ._sources import Source, is_source, opened, shown
from ._splats import Splats, of_native

Format = Literal["ply", "lexi", "spz", "sog", "compressed.ply", "splat", "glb"]


@checked()
def load(
    source: Source,
    *,
    name: str | None = None,
    contiguous: bool = False,
    drop_invalid: bool = False,
    drop_extras: bool = False,
    limit: Mapping[str, int | float | str] | None = None,
) -> Splats:
    """Reads a scene with dense SH from a file of any format: PLY, .lexi, SPZ, SOG, compressed.ply, .splat, .ksplat, glTF.

    The content of the file tells its format. Oddities are told as :class:`LexisplatWarning`.

    Parameters
    ----------
    source : path, bytes or file object
        The file. A SOG may be a folder with ``meta.json``. A file object is open for reading in binary.
    name : str, optional
        What messages call the file, if it is not its path.
    contiguous : bool
        Whether ``shN`` is contiguous, which takes a pass over it in place. Otherwise it is a view with strides.
    drop_invalid : bool
        Whether Gaussians with NaN or infinite values are left out. Otherwise such a file is refused. Sizes of zero
        (scales of -inf) and infinite opacities are always read.
    drop_extras : bool
        Whether properties that 3DGS does not define are left out.
    limit : mapping of str to int, optional
        Limits on what the file may ask for: ``gaussians``, ``atoms``, ``nonzeros``, ``bytes``, ``expansion``,
        ``header_bytes``, ``properties``. Lower them for files of strangers. Sizes may be texts, as ``"4GB"``.

    Raises
    ------
    IoError, FormatError, LimitError
    """
    options = {
        "contiguous": flag("contiguous", contiguous),
        "drop_invalid": flag("drop_invalid", drop_invalid),
        "drop_extras": flag("drop_extras", drop_extras),
    }
    allowed = limits(limit)
    file, name = opened("source", source, optional(text, "name", name))
    arrays, told = _native.load(file, name=name, limit=allowed, **options)
    warn(told, shown(file, name))
    return of_native(arrays)


@checked()
def save(
    path: str | os.PathLike[str],
    scene: Splats | Scene,
    *,
    format: Format | None = None,
    spz_version: int = 4,
    sh_bits: Sequence[int] = (5, 4),
    sog_palette: int = 1 << 16,
    glb_spz: bool = False,
    drop_invalid: bool = False,
    overwrite: bool = True,
    progress: Progress = None,
) -> dict[str, object]:
    """Writes a scene in the format that ``format`` or the extension of ``path`` names. The file appears when it is whole.

    A .lexi is compressed as :func:`compress` does by default; a :class:`Scene` is written as it is.

    Parameters
    ----------
    path : path
        The file.
    scene : Splats or Scene
        What is written. A :class:`Scene` is decoded for formats other than .lexi.
    format : str, optional
        ``"ply"``, ``"lexi"``, ``"spz"``, ``"sog"``, ``"compressed.ply"``, ``"splat"`` or ``"glb"``.
    spz_version : int
        2, 3 or 4.
    sh_bits : two ints
        Bits of SPZ's SH coefficients of degree 1, and of higher degrees, 1 to 8 each.
    sog_palette : int
        Most entries of SOG's palette of SH; 0 leaves SH out.
    glb_spz : bool
        Whether the splats of a glb are an SPZ and not floats.
    drop_invalid : bool
        Whether Gaussians with NaN or infinite values are left out. Otherwise such a scene is refused.
    overwrite : bool
        Whether a file that exists is replaced. Otherwise it is refused.
    progress : callable or bool, optional
        As :func:`compress`.

    Returns
    -------
    dict
        What the file lacks of the scene: ``sh_degree``, ``extras``, ``normals``, ``antialiased``, ``offset``, ``precision``
        and ``limited``; of a .lexi also ``removed``, the number of Gaussians that were left out because they hardly show.
        Empty for a :class:`Scene` that is written as it is. Roundings that are coarse against the sizes of Gaussians are
        warned of.

    Raises
    ------
    IoError, ParameterError
    """
    if isinstance(path, (Splats, Scene)):
        raise wrong_type("path", path, "save(path, scene) takes the path first" if is_source(scene) else "a path")
    path_of("path", path)
    native(scene)
    kind = optional(text, "format", format)
    name = (os.fspath(path) if kind is None else f".{kind}").lower()
    if name.endswith(".gltf"):
        raise wrong("path" if kind is None else "format", path if kind is None else kind, "glTF is written as one file, .glb")
    bits = several(count, "sh_bits", sh_bits, 2, BYTE)
    replace = flag("overwrite", overwrite)
    if isinstance(scene, Scene):
        if name.endswith(".lexi"):
            scene.save(path, overwrite=replace)
            return {}
        scene = scene.decode()
    lost, told = _native.save(
        path,
        native(scene),
        format=kind,
        spz_version=count("spz_version", spz_version, BYTE),
        sh_bits=bits,
        sog_palette=count("sog_palette", sog_palette, MOST_32),
        glb_spz=flag("glb_spz", glb_spz),
        drop_invalid=flag("drop_invalid", drop_invalid),
        overwrite=replace,
        progress=reporter(progress),
    )
    warn(told, "the scene")
    found = dict(json.loads(lost) or {})
    warn(found.pop("coarse", []), path)
    return found


def warn(told: Sequence[str], file: object) -> None:
    """Tells oddities of a file to who called the public function that calls this."""
    for sentence in told:
        warnings.warn(f"{file}: {sentence}", LexisplatWarning, stacklevel=4)
