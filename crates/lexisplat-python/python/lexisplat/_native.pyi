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
    str, int, int, float, float, list[float], list[list[float]], Literal["train", "test"] | None
]

@final
class Chunks:
    def __iter__(self) -> Iterator[tuple[int, dict[str, Any]]]: ...
    def __next__(self) -> tuple[int, dict[str, Any]]: ...

@final
class Scene:
    def __len__(self) -> int: ...
    @property
    def nbytes(self) -> int: ...
    @property
    def degree(self) -> int: ...
    @property
    def layout(self) -> str: ...
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
    overwrite: bool,
    progress: _Progress,
) -> str: ...
def open_scene(source: _Source, *, name: str | None, limit: dict[str, int] | None) -> Scene: ...
def compress(
    source: Any,
    choices: dict[str, Any],
    *,
    dictionary: Any,
    drop_invalid: bool,
    drop_extras: bool,
    limit: dict[str, int] | None,
    progress: _Progress,
) -> Scene: ...
def read_cameras(path: str | os.PathLike[str]) -> tuple[list[CameraTuple], list[str]]: ...
def orbit(scene: Any, count: int, width: int, height: int) -> list[CameraTuple]: ...
def photographs(scene: Any, count: int, *, progress: _Progress) -> list[CameraTuple]: ...
def render(
    scene: Any,
    views: list[CameraTuple],
    *,
    background: tuple[float, float, float],
    max_degree: int | None,
    device_name: str,
    progress: _Progress,
) -> list[_Floats]: ...
def compare(
    a: Any,
    b: Any,
    views: list[CameraTuple] | None,
    *,
    count: int,
    background: tuple[float, float, float],
    eight_bit: bool,
    device_name: str,
    progress: _Progress,
) -> str: ...
def score(a: _Floats, b: _Floats, *, flip: bool, lpips: _Source | None) -> dict[str, float]: ...

_Rule = tuple[float | None, int | None, str]

@final
class Statistics:
    @staticmethod
    def of(components: _Floats, rows: _Floats, *, rule: _Rule, progress: _Progress) -> Statistics: ...
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
    rows: _Floats, *, atoms: int | None, rule: _Rule, seed: int, sample: int, progress: _Progress
) -> tuple[_Floats, int, int, float]: ...
def encode_rows(
    components: _Floats, rows: _Floats, *, rule: _Rule, progress: _Progress
) -> tuple[
    npt.NDArray[np.int64], npt.NDArray[np.int32], _Floats, npt.NDArray[np.float64], npt.NDArray[np.int64]
]: ...
