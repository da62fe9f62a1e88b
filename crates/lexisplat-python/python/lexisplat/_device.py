"""Opening what draws, without the noise of its drivers."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

_FOLDER = "XDG_RUNTIME_DIR"


@contextmanager
def quiet(device: str) -> Iterator[None]:
    """Names a folder for the sockets of desktops while GPUs are listed, where none is named.

    Mesa's Vulkan layer asks libwayland for a display, which prints an error where no folder is named. It says nothing
    of a folder that is not there.
    """
    if device == "cpu" or _FOLDER in os.environ:
        yield
        return
    nowhere = os.path.abspath(os.path.join(os.sep, "nonexistent"))
    os.environ[_FOLDER] = nowhere
    try:
        yield
    finally:
        if os.environ.get(_FOLDER) == nowhere:
            del os.environ[_FOLDER]
