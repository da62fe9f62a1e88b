"""What a caller gives as tiles, and where their files go."""

from __future__ import annotations

import errno
import glob
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Union

import numpy as np

from .._errors import ParameterError, os_error
from .._splats import Splats

if TYPE_CHECKING:
    import ray.data

#: Extensions that a folder of tiles is searched for.
EXTENSIONS = (".ply", ".spz", ".splat", ".ksplat", ".sog", ".glb", ".gltf")
#: Columns of a dataset: of each Gaussian the attribute of :class:`lexisplat.Splats` of that name.
COLUMNS = ("means", "scales", "quats", "opacities", "sh0", "shN")

Paths = Union[str, "os.PathLike[str]", Sequence[Union[str, "os.PathLike[str]"]]]


class Tile(NamedTuple):
    """A tile: its name in messages, and a path, or a reference to a block of a dataset."""

    name: str
    given: Any


def tiles_of(given: Paths | ray.data.Dataset) -> list[Tile]:
    """The tiles that ``given`` means, in order."""
    if hasattr(given, "to_numpy_refs"):
        dataset: Any = given
        # Otherwise blocks come in the order in which they were made.
        dataset.context.execution_options.preserve_order = True
        return [Tile(f"block {k}", ref) for k, ref in enumerate(dataset.to_numpy_refs())]
    if isinstance(given, (str, os.PathLike)):
        found = _paths(os.fspath(given))
    else:
        found = [path for each in given for path in _paths(os.fspath(each))]
    if not found:
        raise _parameter("tiles", given, "a folder or a pattern with tiles in it")
    # Tasks may run in other folders.
    tiles: dict[str, Tile] = {}
    for path in map(os.path.realpath, found):
        if path in tiles:
            raise _parameter("tiles", path, "each tile once")
        tiles[path] = Tile(path, path)
    return list(tiles.values())


def _paths(path: str) -> list[str]:
    if os.path.isdir(path):
        names = sorted(name for name in os.listdir(path) if name.lower().endswith(EXTENSIONS))
        return [os.path.join(path, name) for name in names]
    if glob.has_magic(path) and not os.path.exists(path):
        return sorted(glob.glob(path))
    return [path]


def loaded(tile: Tile, given: Any) -> tuple[str, Any]:
    """The tile for the native part: its name, and a path as it is or a block of a dataset as :class:`lexisplat.Splats`."""
    if isinstance(given, str):
        return tile.name, given
    missing = [name for name in COLUMNS if name not in given]
    if missing:
        raise _parameter(tile.name, ", ".join(sorted(given)), f"a dataset with the columns {', '.join(COLUMNS)}")
    try:
        return tile.name, Splats.from_dict({name: _dense(given[name]) for name in COLUMNS})._checked()
    except (ValueError, TypeError) as error:
        raise _parameter(tile.name, "columns that do not fit", str(error)) from None


def _dense(column: Any) -> np.ndarray[Any, Any]:
    column = np.asarray(column)
    # Columns of unequal rows come as arrays of arrays.
    dense = np.stack(list(column)) if column.dtype == object else column
    return np.ascontiguousarray(dense, np.float32)


def outputs(tiles: Sequence[Tile], out: str | os.PathLike[str], one_each: bool, overwrite: bool) -> list[str]:
    """The files to write. Refuses names that two files would have, and files that are there or are read."""
    out = os.path.realpath(out)
    if not one_each:
        wanted = [out]
        if os.path.isdir(out):
            raise _parameter("out", out, "the file to write; one_each=True writes a file for each tile into a folder")
    else:
        if os.path.exists(out) and not os.path.isdir(out):
            raise _parameter("out", out, "a folder, for one file for each tile")
        wanted = [os.path.join(out, Path(tile.name).stem + ".lexi") for tile in tiles]
        _refuse_twice(wanted, [tile.name for tile in tiles])
    read = {tile.given for tile in tiles if isinstance(tile.given, str)}
    for path in wanted:
        if path in read:
            raise _parameter("out", path, "another file than the tiles")
        if os.path.exists(path) and not overwrite:
            raise os_error(errno.EEXIST, "it is there already, and overwrite=True was not given", path)
    if not one_each and not os.path.isdir(os.path.dirname(out)):
        raise _parameter("out", out, "a file in a folder that is there")
    return wanted


def _refuse_twice(wanted: Iterable[str], names: Sequence[str]) -> None:
    first: dict[str, str] = {}
    for path, name in zip(wanted, names):
        if path in first:
            raise _parameter("out", path, f"a name of its own for each tile: {first[path]} and {name} have one")
        first[path] = name


def _parameter(name: str, value: object, expected: str) -> ParameterError:
    error = ParameterError(f"{name} = {value}: {expected}")
    error.name, error.value = name, str(value)
    return error
