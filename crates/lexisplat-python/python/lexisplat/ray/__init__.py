"""Compression of scenes of many tiles on many workers, by Ray. ``pip install "lexisplat[ray]"``.

    import lexisplat.ray
    report = lexisplat.ray.compress("city/*.ply", "city.lexi")

Ray runs the steps of the library in its tasks, keeps what passes between them in its object store, and runs the tasks of a lost
worker again. Any number of workers makes the same bytes, and so does ``lexisplat compress`` of the same tiles. docs/SCALE.md
says what it costs. The command is ``lexisplat-ray``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ._compress import compress

__all__ = ["compress"]


def __getattr__(name: str) -> object:
    # The command says in one line that Ray is missing, so Ray is imported when it is needed.
    if name != "compress":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from ._compress import compress

    return compress


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
