"""Compressed scenes."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from . import _native
from ._arguments import checked, flag, limits, optional, path as path_of, text
from ._sources import Source, opened
from ._splats import FloatArray, Splats, of_native


class Codes(NamedTuple):
    """Sparse codes of SH-rest, one row a Gaussian, as the arrays of a CSR matrix.

    SH-rest of Gaussian i, channel-major, is the sum of ``values[k] * atoms[indices[k]]`` over ``k`` from ``indptr[i]`` to
    ``indptr[i + 1]``, where ``atoms`` is :attr:`Scene.dictionary`. Gaussians in ``escapes`` have no code: their rows are
    stored exactly.
    """

    #: Where the entries of each row begin; (N + 1,) of int64.
    indptr: npt.NDArray[np.int64]
    #: Numbers of atoms; int32.
    indices: npt.NDArray[np.int32]
    #: Values; float32.
    values: FloatArray
    #: Numbers of Gaussians that are stored exactly; uint32.
    escapes: npt.NDArray[np.uint32]
    #: Their rows; (escapes, 3 K).
    escape_rows: FloatArray

    def to_scipy(self, atoms: int) -> Any:
        """The codes as ``scipy.sparse.csr_array`` of (N, atoms). Rows of escapes are empty."""
        from scipy.sparse import csr_array  # type: ignore[import-untyped, unused-ignore]

        return csr_array((self.values, self.indices, self.indptr), shape=(len(self.indptr) - 1, atoms))


class Scene:
    """A compressed scene: the bytes of a .lexi file. :func:`compress` and :func:`open` make it.

    It is decoded, or drawn from its codes, when that is asked for. It never changes: copies share its bytes. Two scenes are
    equal if their bytes are. A pickle holds the bytes.
    """

    def __init__(self, native: _native.Scene, limit: dict[str, int] | None = None) -> None:
        self._native = native
        self._limit = limit
        self._info: dict[str, Any] | None = None

    def __eq__(self, other: object) -> bool:
        return self._native.equals(other._native) if isinstance(other, Scene) else NotImplemented

    def __hash__(self) -> int:
        return self._native.hash()

    def __copy__(self) -> Scene:
        return Scene(self._native, self._limit)

    def __deepcopy__(self, memo: object) -> Scene:
        return self.__copy__()

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (self.to_bytes(), self._native.name, self._native.report_json, self._limit)

    def __len__(self) -> int:
        return len(self._native)

    def __repr__(self) -> str:
        each = self.nbytes / max(1, len(self))
        return f"Scene({len(self):,} Gaussians, SH degree {self.degree}, {self.layout}, {self.nbytes:,} bytes, {each:.1f} each)"

    @property
    def nbytes(self) -> int:
        """Size of the file in bytes."""
        return self._native.nbytes

    @property
    def degree(self) -> int:
        """SH degree, 0 to 4."""
        return self._native.degree

    @property
    def layout(self) -> str:
        """``"packed"``, ``"f16"``, ``"f32"`` or ``"paper"``."""
        return self._native.layout

    @property
    def view(self) -> str | None:
        """The view from which viewers show the scene first, as the text of their links."""
        return self._native.view

    @property
    def offset(self) -> npt.NDArray[np.float64] | None:
        """What is added to positions to get to the world of the source, (3,); see :class:`Splats`."""
        offset = self._native.offset
        return None if offset is None else np.array(offset, np.float64)

    @property
    def report(self) -> dict[str, Any] | None:
        """What the compression did, by the keys of ``lexisplat compress --json``; ``None`` of a file that was opened."""
        report = self._native.report_json
        return None if report is None else dict(json.loads(report))

    @property
    def info(self) -> dict[str, Any]:
        """Facts about the file: errors, promises, bytes of each part, use of atoms. The whole file is decoded for them once."""
        if self._info is None:
            self._info = dict(json.loads(self._native.info_json()))
        return self._info

    @property
    def nbytes_by_part(self) -> dict[str, float]:
        """Bytes of each part of the file by name; they add up to :attr:`nbytes`. Parts of packed files share
        bytes: ``rounding`` is what their estimates differ by from whole bytes, and may be negative."""
        report = self.report
        return dict((report or self.info)["attribute_bytes"])

    @property
    def dictionary(self) -> FloatArray:
        """The atoms, (atoms, 3 K): channel-major, of unit norm."""
        return self._native.dictionary()

    def codes(self) -> Codes:
        """The sparse codes, in the order of the file."""
        return Codes(*self._native.codes())

    def decode(self) -> Splats:
        """The scene with dense SH. Its order is that of the source if the file holds it."""
        return of_native(self._native.decode())

    def chunks(self) -> Iterator[tuple[int, Splats]]:
        """Decodes part after part, in the order of the file: the number of the first Gaussian, and the part.

        Three parts are in memory at most: the one at hand and two that are ahead. A part has up to 65,536 Gaussians.
        """
        for start, arrays in self._native.chunks():
            yield start, of_native(arrays)

    @checked()
    def save(self, path: str | os.PathLike[str], *, overwrite: bool = True) -> None:
        """Writes the .lexi file. It appears when it is whole."""
        self._native.save(path_of("path", path), overwrite=flag("overwrite", overwrite))

    def to_bytes(self) -> bytes:
        """The bytes of the .lexi file."""
        return self._native.to_bytes()


@checked()
def open(
    source: Source, *, name: str | None = None, limit: Mapping[str, int | float | str] | None = None
) -> Scene:
    """Opens a .lexi file, its bytes, or a file object. The header is checked, and nothing is decoded yet.

    Raises
    ------
    IoError, FormatError, LimitError
    """
    allowed = limits(limit)
    file, name = opened("source", source, optional(text, "name", name))
    return Scene(_native.open_scene(file, name=name, report=None, limit=allowed), allowed)


def _restored(file: bytes, name: str, report: str | None, limit: dict[str, int] | None) -> Scene:
    """The scene of a pickle."""
    return Scene(_native.open_scene(file, name=name, report=report, limit=limit), limit)
