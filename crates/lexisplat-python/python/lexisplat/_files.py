"""Reading and writing scenes of any format."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Mapping, Sequence
from typing import Literal, Union

from . import _native
from ._cameras import native
from ._errors import LexisplatWarning
from ._progress import Progress, reporter
from ._scene import Scene
from ._splats import Splats, of_native

#: A path, or the bytes of a file.
Source = Union[str, "os.PathLike[str]", bytes]
Format = Literal["ply", "lexi", "spz", "sog", "compressed.ply", "splat", "glb"]


def load(
    source: Source,
    *,
    name: str | None = None,
    contiguous: bool = False,
    drop_invalid: bool = False,
    drop_extras: bool = False,
    limit: Mapping[str, int] | None = None,
) -> Splats:
    """Reads a scene with dense SH from a file of any format: PLY, .lexi, SPZ, SOG, compressed.ply, .splat, .ksplat, glTF.

    The content of the file tells its format. Oddities are told as :class:`LexisplatWarning`.

    Parameters
    ----------
    source : path or bytes
        The file. A SOG may be a folder with ``meta.json``.
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
        ``header_bytes``, ``properties``. Lower them for files of strangers.

    Raises
    ------
    IoError, FormatError, LimitError
    """
    arrays, told = _native.load(
        source,
        name=name,
        contiguous=contiguous,
        drop_invalid=drop_invalid,
        drop_extras=drop_extras,
        limit=None if limit is None else dict(limit),
    )
    warn(told, source if name is None else name)
    return of_native(arrays)


def save(
    path: str | os.PathLike[str],
    scene: Splats | Scene,
    *,
    format: Format | None = None,
    spz_version: int = 4,
    sh_bits: Sequence[int] = (5, 4),
    sog_palette: int = 1 << 16,
    glb_spz: bool = False,
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
    overwrite : bool
        Whether a file that exists is replaced. Otherwise it is refused.
    progress : callable or bool, optional
        As :func:`compress`.

    Returns
    -------
    dict
        What the file lacks of the scene: ``sh_degree``, ``extras``, ``normals``, ``antialiased``, ``precision`` and
        ``limited``; empty for .lexi.

    Raises
    ------
    IoError, ParameterError
    """
    is_lexi = format == "lexi" or (format is None and os.fspath(path).lower().endswith(".lexi"))
    if isinstance(scene, Scene):
        if is_lexi:
            scene.save(path, overwrite=overwrite)
            return {}
        scene = scene.decode()
    lost = _native.save(
        path,
        native(scene),
        format=format,
        spz_version=spz_version,
        sh_bits=tuple(sh_bits),
        sog_palette=sog_palette,
        glb_spz=glb_spz,
        overwrite=overwrite,
        progress=reporter(progress),
    )
    return dict(json.loads(lost) or {})


def warn(told: Sequence[str], file: object) -> None:
    """Tells oddities of a file."""
    where = "bytes" if isinstance(file, bytes) else file
    for sentence in told:
        warnings.warn(f"{where}: {sentence}", LexisplatWarning, stacklevel=3)
