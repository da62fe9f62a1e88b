"""The native part of the package. It is private: the modules beside it document and check what they pass on."""

import os
from collections.abc import Callable, Iterator
from typing import Any, Literal, final

import numpy as np
import numpy.typing as npt

__version__: str

_Source = str | os.PathLike[str] | bytes
_Progress = Callable[[str, int, int], object] | None
_Floats = npt.NDArray[np.float32]
CameraTuple = tuple[
    str, int, int, float, float, list[float], list[list[float]], float, Literal["train", "test"] | None
]

@final
class Chunks:
    def __iter__(self) -> Iterator[tuple[int, dict[str, Any]]]: ...
    def __next__(self) -> tuple[int, dict[str, Any]]: ...

@final
class Scene:
    def __len__(self) -> int: ...
    @property
    def name(self) -> str: ...
    def equals(self, other: Scene) -> bool: ...
    def hash(self) -> int: ...
    @property
    def nbytes(self) -> int: ...
    @property
    def degree(self) -> int: ...
    @property
    def layout(self) -> str: ...
    @property
    def offset(self) -> list[float] | None: ...
    @property
    def view(self) -> str | None: ...
    @property
    def report_json(self) -> str | None: ...
    def dictionary(self) -> _Floats: ...
    def info_json(self) -> str: ...
    def decode(self) -> dict[str, Any]: ...
    def codes(
        self,
    ) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int32], _Floats, npt.NDArray[np.uint32], _Floats]: ...
    def chunks(self) -> Chunks: ...
    def save(self, path: str | os.PathLike[str], *, overwrite: bool) -> None: ...
    def to_bytes(self) -> bytes: ...

def contiguous(values: _Floats) -> _Floats: ...
def load(
    source: _Source,
    *,
    name: str | None,
    contiguous: bool,
    drop_invalid: bool,
    drop_extras: bool,
    limit: dict[str, int] | None,
) -> tuple[dict[str, Any], list[str]]: ...
def save(
    path: str | os.PathLike[str],
    splats: Any,
    *,
    format: str | None,
    spz_version: int,
    sh_bits: tuple[int, ...],
    sog_palette: int,
    glb_spz: bool,
    drop_invalid: bool,
    overwrite: bool,
    progress: _Progress,
) -> tuple[str, list[str]]: ...
def open_scene(source: _Source, *, name: str | None, report: str | None, limit: dict[str, int] | None) -> Scene: ...
def compress(
    source: Any,
    choices: dict[str, Any],
    *,
    dictionary: Any,
    drop_invalid: bool,
    drop_extras: bool,
    limit: dict[str, int] | None,
    progress: _Progress,
) -> tuple[Scene, list[str]]: ...
def read_cameras(path: str | os.PathLike[str]) -> tuple[list[CameraTuple], list[str]]: ...
def orbit(scene: Any, count: int, width: int, height: int) -> list[CameraTuple]: ...
def photographs(scene: Any, count: int, *, progress: _Progress) -> list[CameraTuple]: ...
def render(
    scene: Any,
    views: list[CameraTuple],
    *,
    background: tuple[float, ...],
    max_degree: int | None,
    device_name: str,
    drop_invalid: bool,
    progress: _Progress,
) -> tuple[list[_Floats], list[str]]: ...
def compare(
    a: Any,
    b: Any,
    views: list[CameraTuple] | None,
    *,
    count: int,
    background: tuple[float, ...],
    eight_bit: bool,
    device_name: str,
    drop_invalid: bool,
    progress: _Progress,
) -> tuple[str, list[str]]: ...
def score(
    a: _Floats, b: _Floats, *, flip: bool, lpips: _Source | None
) -> tuple[dict[str, float], list[list[float] | None]]: ...

#: Rows, and values of codes of the same type.
_Rows64 = _Floats | npt.NDArray[np.float64]
_Rule = tuple[float | None, int | None, str]

@final
class Statistics:
    @staticmethod
    def of(components: _Floats, rows: _Rows64, *, rule: _Rule, progress: _Progress) -> Statistics: ...
    def plus(self, other: Statistics) -> Statistics: ...
    def scaled(self, factor: float) -> Statistics: ...
    def update(self, components: _Floats) -> _Floats: ...
    @property
    def rows(self) -> float: ...
    @property
    def nonzeros(self) -> float: ...
    @property
    def squared_error(self) -> float: ...
    def to_bytes(self) -> bytes: ...
    @staticmethod
    def from_bytes(bytes: bytes) -> Statistics: ...

def learn_rows(
    rows: _Rows64, *, atoms: int | None, rule: _Rule, seed: int, sample: int, progress: _Progress
) -> tuple[_Floats, int, int, float]: ...
def encode_rows(
    components: _Floats, rows: _Rows64, *, rule: _Rule, progress: _Progress
) -> tuple[
    npt.NDArray[np.int64], npt.NDArray[np.int32], _Rows64, npt.NDArray[np.float64], npt.NDArray[np.int64]
]: ...

# The steps of packing in tiles. Bytes pass between them.
TILE_BLOCK: int

_Rows = tuple[int, int]
_Limit = dict[str, int] | None
_Tile = tuple[str, Any]
_Pieces = list[tuple[int, _Tile, list[_Rows]]] | list[bytes]

@final
class TileSample:
    def __new__(cls, plan: bytes) -> TileSample: ...
    def add(self, bucket: int, pieces: _Pieces, looked: bytes, choices: dict[str, Any], limit: _Limit) -> None: ...
    def statistics(self, steps: bytes) -> bytes: ...

def tile_choices(choices: dict[str, Any], limit: _Limit) -> None: ...
def tile_open(tile: _Tile, choices: dict[str, Any], limit: _Limit) -> tuple[int, int, list[str]]: ...
def tile_survey(tile: _Tile, rows: _Rows, choices: dict[str, Any], limit: _Limit) -> bytes: ...
def tile_check(name: str, own: bytes, first: bytes | None) -> None: ...
def tile_plan(
    surveys: list[tuple[str, list[bytes]]], choices: dict[str, Any], one_each: bool
) -> tuple[bytes, int, list[list[int]], list[_Rows]]: ...
def tile_runs(
    plan: bytes, number: int, tile: _Tile, rows: _Rows, choices: dict[str, Any], limit: _Limit
) -> list[tuple[int, list[_Rows]]]: ...
def tile_scatter(
    plan: bytes, number: int, tile: _Tile, rows: _Rows, choices: dict[str, Any], limit: _Limit
) -> list[tuple[int, bytes]]: ...
def tile_look(
    plan: bytes, bucket: int, pieces: _Pieces, choices: dict[str, Any], limit: _Limit
) -> tuple[bytes, bytes, str | None, str | None]: ...
def tile_steps(plan: bytes, buckets: list[bytes]) -> bytes: ...
def tile_coding(plan: bytes, steps: bytes, groups: list[bytes]) -> bytes: ...
def tile_code(
    plan: bytes,
    coding: bytes,
    bucket: int,
    pieces: _Pieces,
    looked: bytes,
    choices: dict[str, Any],
    limit: _Limit,
) -> tuple[bytes, bytes]: ...
def tile_tables(counts: list[bytes]) -> bytes: ...
def tile_finish(plan: bytes, coding: bytes, tables: bytes, coded: bytes) -> bytes: ...
def tile_assemble(
    plan: bytes,
    coding: bytes,
    tables: bytes,
    file: int,
    next: Iterator[bytes],
    counts: list[bytes],
    refined: list[str],
    path: str | os.PathLike[str],
    *,
    source_bytes: int,
    overwrite: bool,
    guess: bool,
    gpu: str | None,
) -> str: ...
