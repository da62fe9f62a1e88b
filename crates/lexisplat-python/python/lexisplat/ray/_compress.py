"""Compression of scenes of many tiles."""

from __future__ import annotations

import json
import os
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from .. import _native
from .._arguments import checked, count, flag
from .._arguments import device as device_of
from .._arguments import limits as limits_of
from .._compress import Preset, options_of
from .._errors import Error, LexisplatWarning, ParameterError
from .._progress import Progress, reporter

try:
    import ray
except ImportError:
    raise ImportError('lexisplat.ray needs Ray: pip install "lexisplat[ray]"') from None

from . import _tasks as tasks
from ._tiles import Paths, Tile, outputs, tiles_of
from ._work import Work

if TYPE_CHECKING:
    import ray.data

#: Rows that buckets may read for each row of the scene. If tiles lie all over the scene, they are scattered instead.
MOST_READ = 6.0


@checked()
def compress(
    tiles: Paths | ray.data.Dataset,
    out: str | os.PathLike[str],
    *,
    preset: Preset | None = None,
    psnr: float | None = None,
    tol: float | None = None,
    atoms: int | None = None,
    seed: int = 0,
    keep_order: bool = False,
    keep_all: bool = False,
    lod: bool = False,
    refine: Literal["quick", "thorough"] | float | None = None,
    guess: bool = False,
    device: str = "cpu",
    one_each: bool = False,
    skip_bad: bool = False,
    drop_invalid: bool = False,
    drop_extras: bool = False,
    limit: Mapping[str, int | float | str] | None = None,
    overwrite: bool = False,
    threads: int = 1,
    progress: Progress = None,
) -> dict[str, Any]:
    """Compresses the tiles of a scene on all workers of Ray, into one file or one a tile.

    Uses the cluster that ``ray.init`` connected to, or starts Ray on this machine. The file is that of the program's
    ``lexisplat compress`` of the same tiles in parts, on any number of workers.

    Parameters
    ----------
    tiles : path, pattern, folder, sequence of these, or Ray dataset
        Files of any format that :func:`lexisplat.load` reads but .lexi, which all workers can read under these names; one large file
        too. They may overlap. Of a dataset each block is a tile, with the columns ``means``, ``scales``, ``quats``,
        ``opacities``, ``sh0`` and ``shN`` as the attributes of :class:`lexisplat.Splats`.
    out : path
        The file to write, by the process that calls; with ``one_each`` a folder, where each tile's file has its name.
    preset, psnr, tol, atoms, seed, keep_order, keep_all, lod, refine, guess, device
        As :func:`lexisplat.compress`. ``device`` is that of the workers. All parts together take the minutes of ``refine``, on one
        thread.
    one_each : bool
        Whether each tile becomes a file of its own. All have the dictionary, the steps and the tables of the whole scene.
    skip_bad : bool
        Whether tiles that cannot be read, have no Gaussians or do not go together with the first are left out. The report lists
        them under ``"skipped"``. Otherwise they are errors.
    drop_invalid, drop_extras, limit
        As :func:`lexisplat.load`.
    overwrite : bool
        Whether files that are there are replaced.
    threads : int
        Threads and processors of a task.
    progress : callable or bool, optional
        As :func:`lexisplat.compress`.

    Returns
    -------
    dict
        The program's report, with ``"skipped"``, ``"traffic"`` (bytes that passed between processes), ``"seconds"`` and
        ``"stages"`` (seconds of each). With
        ``one_each`` the reports are under ``"files"``.

    Raises
    ------
    ParameterError, FormatError, IoError, LimitError, GpuError
        They name the tile. No file is then written, or with ``one_each`` none but whole ones.
    """
    started = time.monotonic()
    flags = {"one_each": one_each, "skip_bad": skip_bad, "overwrite": overwrite}
    reading = {"drop_invalid": drop_invalid, "drop_extras": drop_extras}
    for name, value in {**flags, **reading}.items():
        flag(name, value)
    asked: dict[str, Any] = {"preset": preset, "psnr": psnr, "tol": tol, "atoms": atoms, "seed": seed}
    asked.update(keep_order=keep_order, keep_all=keep_all, lod=lod, refine=refine, guess=guess)
    choices = {**options_of(asked), **reading, "device": device_of(device)}
    limits, threads = limits_of(limit), count("threads", threads)
    listed = tiles_of(tiles)
    outputs(listed, out, one_each, overwrite)
    _native.tile_choices(choices, limits)
    if device == "auto":
        raise ParameterError("device = auto: cpu or gpu, which is the same on all workers")
    if not ray.is_initialized():
        ray.init(log_to_driver=False, include_dashboard=False)
    most = max((int(node["Resources"].get("CPU", 0)) for node in ray.nodes() if node["Alive"]), default=0)
    if not 1 <= threads <= most:
        raise ParameterError(f"threads = {threads}: 1 to {most}, the processors of the largest machine")
    context = tasks.Context(choices, limits, threads)
    work = Work(context, reporter(progress))
    try:
        scene = _Scene(work, choices, listed, one_each, skip_bad)
        wanted = outputs(scene.tiles, out, one_each, overwrite)
        report = scene.compressed(wanted, overwrite)
    finally:
        work.cancel()
    work.end_stage()
    report["skipped"] = scene.skipped
    report["stages"] = {stage: round(seconds, 3) for stage, seconds in work.stages.items()}
    report["traffic"] = dict(work.traffic)
    report["seconds"] = time.monotonic() - started
    return report


class _Scene:
    """A scene whose tiles are surveyed."""

    def __init__(
        self, work: Work, choices: dict[str, Any], listed: Sequence[Tile], one_each: bool, skip_bad: bool
    ) -> None:
        self._work, self._choices, self._one_each = work, choices, one_each
        #: Tiles that were left out, and why.
        self.skipped: list[dict[str, str]] = []
        self.tiles: list[Tile] = []
        self._lengths: list[int] = []
        self._bytes: list[int] = []
        # Every task that draws has a GPU of its own.
        self._drawing = {} if choices["device"] == "cpu" or choices["guess"] else {"num_gpus": 1}
        self._surveys: list[tuple[str, list[bytes]]] = []
        opened = self._good(skip_bad, listed, [work.start(tasks.open_tile, tile) for tile in listed])
        started = [
            [work.start(tasks.survey, tile, rows) for rows in tasks.blocks(facts[0])]
            for tile, facts in opened
        ]
        total, done = sum(len(own) for own in started), 0
        first: bytes | None = None
        for (tile, (gaussians, size, odd)), own in zip(opened, started):
            done += len(own)
            try:
                found = [work.get(ref) for ref in own]
                _native.tile_check(tile.name, found[0], first)
            except Error as error:
                self._skip(skip_bad, tile, error)
                continue
            finally:
                work.tell("survey", done, total)
            first = first or found[0]
            work.traffic["statistics"] += sum(map(len, found))
            self.tiles.append(tile)
            self._lengths.append(gaussians)
            self._bytes.append(size)
            self._surveys.append((tile.name, found))
            for text in odd:
                warnings.warn(f"{tile.name}: {text}", LexisplatWarning, stacklevel=3)
        if not self.tiles:
            raise ParameterError(f"tiles = {len(listed)} tiles: at least one that is not skipped")

    def _good(self, skip_bad: bool, listed: Sequence[Tile], refs: Sequence[Any]) -> list[tuple[Tile, Any]]:
        """The tiles whose tasks did not fail, and what these gave."""
        good = []
        for done, (tile, ref) in enumerate(zip(listed, refs)):
            self._work.tell("open", done, len(listed))
            try:
                good.append((tile, self._work.get(ref)))
            except Error as error:
                self._skip(skip_bad, tile, error)
        self._work.tell("open", len(listed), len(listed))
        return good

    def _skip(self, skip_bad: bool, tile: Tile, error: Error) -> None:
        if not skip_bad:
            raise error
        self.skipped.append({"tile": tile.name, "error": str(error)})

    def compressed(self, wanted: Sequence[str], overwrite: bool) -> dict[str, Any]:
        """Writes the files. Returns the report."""
        work = self._work
        plan, gaussians, groups, files = _native.tile_plan(self._surveys, self._choices, self._one_each)
        self._surveys = []
        self._plan = work.shared(plan)
        buckets = files[-1][1]
        pieces = self._read_by(buckets, gaussians)
        looks = [
            work.start(tasks.look, self._plan, bucket, own, returns=2, **self._drawing)
            for bucket, own in enumerate(pieces)
        ]
        seen: list[tasks.Look] = work.results("look", [look[0] for look in looks])
        looked = [look[1] for look in looks]
        work.traffic["statistics"] += sum(len(own.statistics) for own in seen)
        work.traffic["state"] += sum(own.remembered for own in seen)
        gpu = next((own.gpu for own in seen if own.gpu is not None), None)
        steps = _native.tile_steps(plan, [own.statistics for own in seen])
        coding = self._learned(plan, steps, groups, pieces, looked)
        shared = work.shared(coding)
        codes = [
            work.start(tasks.code, self._plan, shared, bucket, own, looked[bucket], returns=2)
            for bucket, own in enumerate(pieces)
        ]
        found = work.results("code", [code[0] for code in codes])
        counts = [own[0] for own in found]
        work.traffic["statistics"] += sum(map(len, counts))
        work.traffic["results"] += sum(own[1] for own in found)
        del looks, looked, pieces
        tables = _native.tile_tables(counts)
        common = work.shared(tables)
        ends = [work.start(tasks.finish, self._plan, shared, common, code[1]) for code in codes]
        del codes
        reports = []
        for number, (path, (start, stop)) in enumerate(zip(wanted, files)):
            os.makedirs(os.path.dirname(path), exist_ok=True)
            text = _native.tile_assemble(
                plan,
                coding,
                tables,
                number,
                self._coded(ends, start, stop),
                counts[start:stop],
                [own.refined for own in seen[start:stop] if own.refined is not None],
                path,
                source_bytes=self._bytes[number] if self._one_each else sum(self._bytes),
                overwrite=overwrite,
                guess=self._choices["guess"],
                gpu=gpu,
            )
            reports.append({**json.loads(text), "output": path})
        return {"files": reports} if self._one_each else reports[0]

    def _coded(self, ends: list[Any], start: int, stop: int) -> Iterator[bytes]:
        for bucket in range(start, stop):
            coded = self._work.get(ends[bucket])
            ends[bucket] = None
            self._work.traffic["results"] += len(coded)
            self._work.tell("write", bucket + 1, len(ends))
            yield coded

    def _read_by(self, buckets: int, gaussians: int) -> list[tasks.Pieces]:
        """What each bucket is read from."""
        work = self._work
        blocks = [(n, tile, rows) for n, tile in enumerate(self.tiles) for rows in tasks.blocks(self._lengths[n])]
        found = work.results("count", [work.start(tasks.count, self._plan, *block) for block in blocks])
        reads: list[tasks.Reads] = [[] for _ in range(buckets)]
        read = 0
        for (number, tile, _), own in zip(blocks, found):
            for bucket, rows in own:
                work.traffic["statistics"] += 8 * len(rows)
                read += sum(stop - start for start, stop in rows)
                reads[bucket].append((number, tile, rows))
        if read <= MOST_READ * gaussians:
            return list(reads)
        scattered = [work.start(tasks.scatter, self._plan, *block, buckets, returns=buckets) for block in blocks]
        work.traffic["scattered"] += sum(self._bytes)
        refs = [own if buckets > 1 else [own] for own in scattered]
        return [[own[bucket] for own in refs] for bucket in range(buckets)]

    def _learned(
        self,
        plan: bytes,
        steps: bytes,
        groups: Sequence[Sequence[int]],
        pieces: Sequence[tasks.Pieces],
        looked: Sequence[Any],
    ) -> bytes:
        work = self._work
        shared = work.shared(steps)
        draws = [tasks.Draw(own, [pieces[b] for b in own], [looked[b] for b in own]) for own in groups]
        found = [work.get(ref) for ref in [work.start(tasks.sample, self._plan, shared, draw) for draw in draws]]
        work.traffic["statistics"] += sum(map(len, found))
        work.tell("learn", 0, 1)
        return _native.tile_coding(plan, steps, found)
