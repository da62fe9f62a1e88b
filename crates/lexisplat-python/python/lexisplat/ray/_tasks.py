"""What Ray runs: each step of the library as a task. What they take and give are bytes."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, Union

import ray

from .. import _native
from .._device import quiet
from ._tiles import Tile, loaded

#: A range of rows.
Rows = tuple[int, int]
#: Of a bucket: numbers of tiles, the tiles, and the rows to look in.
Reads = list[tuple[int, Tile, list[Rows]]]
#: The same, or references to pieces that were scattered.
Pieces = Union[Reads, list[Any]]


class Context:
    """What all tasks of a scene take beside their own arguments."""

    def __init__(self, choices: dict[str, Any], limit: dict[str, int] | None, threads: int) -> None:
        self.choices, self.limit, self.threads = choices, limit, threads

    def begin(self) -> None:
        """Limits the threads of this process, which begin with the first work that it does. Processes that work on several threads
        are started with the limit (:class:`Work`)."""
        os.environ.setdefault("RAYON_NUM_THREADS", str(self.threads))


def _here(tile: Tile) -> tuple[str, Any]:
    """A tile as the native part reads it."""
    return loaded(tile, ray.get(tile.given) if isinstance(tile.given, ray.ObjectRef) else tile.given)


def _pieces(pieces: Pieces) -> Any:
    if pieces and isinstance(pieces[0], ray.ObjectRef):
        return [piece for piece in ray.get(list(pieces)) if piece is not None]
    return [(number, _here(tile), rows) for number, tile, rows in pieces]


def open_tile(context: Context, tile: Tile) -> tuple[int, int, list[str]]:
    """Number of Gaussians, bytes and warnings of a tile."""
    context.begin()
    return _native.tile_open(_here(tile), context.choices, context.limit)


def survey(context: Context, tile: Tile, rows: Rows) -> bytes:
    context.begin()
    return _native.tile_survey(_here(tile), rows, context.choices, context.limit)


def count(context: Context, plan: bytes, number: int, tile: Tile, rows: Rows) -> list[tuple[int, list[Rows]]]:
    context.begin()
    return _native.tile_runs(plan, number, _here(tile), rows, context.choices, context.limit)


def scatter(context: Context, plan: bytes, number: int, tile: Tile, rows: Rows, buckets: int) -> Any:
    context.begin()
    found = dict(_native.tile_scatter(plan, number, _here(tile), rows, context.choices, context.limit))
    pieces = [found.get(bucket) for bucket in range(buckets)]
    return pieces[0] if buckets == 1 else pieces


class Look(NamedTuple):
    """What is known of a bucket that was looked at."""

    statistics: bytes
    #: Length of what is remembered.
    remembered: int
    #: The GPU that looked.
    gpu: str | None
    #: The result of refining, as JSON.
    refined: str | None


def look(context: Context, plan: bytes, bucket: int, pieces: Pieces) -> tuple[Look, bytes]:
    """What is known of a bucket, and what is remembered."""
    context.begin()
    with quiet(context.choices["device"]):
        statistics, looked, gpu, refined = _native.tile_look(plan, bucket, _pieces(pieces), context.choices, context.limit)
    return Look(statistics, len(looked), gpu, refined), looked


class Draw(NamedTuple):
    """The buckets that a sample is drawn from: of each its pieces, and a reference to what is remembered of it."""

    buckets: Sequence[int]
    pieces: Sequence[Pieces]
    looked: Sequence[Any]


def sample(context: Context, plan: bytes, steps: bytes, draw: Draw) -> bytes:
    """Sums over the sample of a group of buckets, which are read one after the other."""
    context.begin()
    drawn = _native.TileSample(plan)
    for bucket, own, ref in zip(draw.buckets, draw.pieces, draw.looked):
        drawn.add(bucket, _pieces(own), ray.get(ref), context.choices, context.limit)
    return drawn.statistics(steps)


def code(
    context: Context, plan: bytes, coding: bytes, bucket: int, pieces: Pieces, looked: bytes
) -> tuple[tuple[bytes, int], bytes]:
    """Counts, and the length of the coded bucket; the coded bucket."""
    context.begin()
    choices, limit = context.choices, context.limit
    counts, coded = _native.tile_code(plan, coding, bucket, _pieces(pieces), looked, choices, limit)
    return (counts, len(coded)), coded


def finish(context: Context, plan: bytes, coding: bytes, tables: bytes, coded: bytes) -> bytes:
    context.begin()
    return _native.tile_finish(plan, coding, tables, coded)


def blocks(gaussians: int) -> Iterator[Rows]:
    """The blocks of rows of a tile. One without Gaussians has an empty one."""
    size = _native.TILE_BLOCK
    return ((start, min(gaussians, start + size)) for start in range(0, max(gaussians, 1), size))
