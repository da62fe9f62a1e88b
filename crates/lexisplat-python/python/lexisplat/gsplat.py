"""Compression of checkpoints in the manner of gsplat's ``PngCompression``."""

from __future__ import annotations

import inspect
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ._arguments import check_names, checked, wrong_type
from ._arguments import path as path_of
from ._compress import compress, options_of
from ._errors import ParameterError
from ._scene import open as open_scene
from ._splats import NAMES, Splats

__all__ = ["LexiCompression"]

_FILE = "scene.lexi"
_META = "meta.json"


class LexiCompression:
    """Compresses gsplat's splats to a folder, and reads them back.

    Use it where gsplat's ``simple_trainer`` uses ``PngCompression``. The order of the Gaussians is not kept unless
    ``keep_order=True`` is given; Gaussians that hardly show are left out unless ``keep_all=True`` is given.

    Parameters
    ----------
    **options
        What :func:`lexisplat.compress` takes, such as ``preset``, ``psnr``, ``tol`` or ``cameras``.
    """

    def __init__(self, **options: Any) -> None:
        known = [name for name in inspect.signature(compress).parameters if name != "scene"]
        check_names("LexiCompression", known, options)
        options_of(options)
        self.options = options

    @checked()
    def compress(self, compress_dir: str | os.PathLike[str], splats: Mapping[str, Any]) -> None:
        """Writes ``scene.lexi`` and ``meta.json`` to a folder, which is made if it is missing.

        Parameters
        ----------
        compress_dir : path
            The folder.
        splats : mapping of tensors or arrays
            ``means``, ``scales`` (logarithms), ``quats``, ``opacities`` (logits), ``sh0``, ``shN``. Other keys are
            refused, because a .lexi cannot hold them.
        """
        if isinstance(compress_dir, Mapping):
            raise wrong_type("compress_dir", compress_dir, "a path: compress(compress_dir, splats) takes the folder first")
        if not isinstance(splats, Mapping):
            raise wrong_type("splats", splats, "a dict of tensors or arrays")
        path_of("compress_dir", compress_dir)
        other = sorted(set(splats) - set(NAMES))
        if other:
            raise ParameterError(f"splats = {', '.join(other)}: only {', '.join(NAMES)} can be compressed")
        folder = Path(compress_dir)
        folder.mkdir(parents=True, exist_ok=True)
        scene = compress(Splats.from_dict(splats), **self.options)
        scene.save(folder / _FILE)
        report = scene.report or {}
        (folder / _META).write_text(json.dumps({"file": _FILE, "report": report}, indent=1))

    @checked()
    def decompress(self, compress_dir: str | os.PathLike[str]) -> dict[str, Any]:
        """Reads what :meth:`compress` wrote: torch tensors where torch is installed, else arrays."""
        splats = open_scene(Path(path_of("compress_dir", compress_dir)) / _FILE).decode()
        try:
            import torch  # type: ignore[import-not-found, unused-ignore]  # noqa: F401
        except ImportError:
            return dict(splats.to_dict())
        return splats.to_torch()
