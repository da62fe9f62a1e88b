"""A trained scene as arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from . import _native
from ._arguments import flag, text, wrong_type
from ._errors import ParameterError

FloatArray = npt.NDArray[np.float32]
#: ``log``: scales are logarithms and opacities logits, as trainers store them. ``linear``: both are activated.
Space = Literal["log", "linear"]

#: Opacities of exactly 0 and 1 become logits of this size: in float32 the sigmoid of it is 1 (``SURE_OPACITY``).
_SURE_OPACITY = 100.0
#: Least standard deviation of linear scales, whose logarithm is stored: the smallest normal float32.
_LEAST_SCALE = float(np.finfo(np.float32).tiny)
#: The arrays by gsplat's names.
NAMES = ("means", "scales", "quats", "opacities", "sh0", "shN")


@dataclass(eq=False)
class Splats:
    """A scene of N Gaussians with dense spherical harmonics (SH), by gsplat's names and shapes.

    Values are as trainers store them, before any activation. All arrays are float32; other types are converted, and
    torch tensors on the CPU are taken without a copy where that is possible. Arrays may be changed and replaced.

    Parameters
    ----------
    means : (N, 3)
        Centres, in world units. Those of a scene with an ``offset`` are relative to it.
    scales : (N, 3)
        Natural logarithms of the standard deviations along the three axes, in world units.
    quats : (N, 4)
        Quaternions (w, x, y, z), not necessarily of unit length.
    opacities : (N,)
        Opacities before the sigmoid.
    sh0 : (N, 1, 3)
        SH coefficient 0 of red, green and blue. The base colour is ``0.5 + 0.28209479 * sh0``.
    shN : (N, K, 3)
        The other SH coefficients; K is 0, 3, 8, 15 or 24 at degree 0 to 4. What :func:`load` gives is a view with
        strides, because files hold the channels apart; :meth:`to_dict` makes contiguous copies.
    normals : (N, 3), optional
        Normals, which no renderer uses.
    extras : dict of (N,) arrays
        Per-Gaussian properties that 3DGS does not define, under their own names.
    comments : list of str
        Comment lines of the file.
    antialiased : bool
        Whether the scene was trained with the anti-aliased (Mip-Splatting) dilation, and is drawn with it.
    offset : (3,), optional
        What is added to ``means`` to get to the world of the file, in float64: ``means.astype(float) + offset``. Files with
        double coordinates that are too far from the origin for float32 have one. It is kept in .lexi files, and put back by
        :func:`save` where the format can hold it. Cameras are in the world.
    """

    means: FloatArray
    scales: FloatArray
    quats: FloatArray
    opacities: FloatArray
    sh0: FloatArray
    shN: FloatArray
    normals: FloatArray | None = None
    extras: dict[str, npt.NDArray[Any]] = field(default_factory=dict)
    comments: list[str] = field(default_factory=list)
    antialiased: bool = False
    offset: npt.NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        self._checked()

    def _checked(self) -> Splats:
        """Brings every array to its type and shape, without a copy of those that have both."""
        self.means = _rows("means", self.means, 3)
        count = len(self.means)
        self.scales = _rows("scales", self.scales, 3, count)
        self.quats = _rows("quats", self.quats, 4, count)
        opacities = floats("opacities", self.opacities)
        if opacities.shape == (count, 1):
            opacities = opacities.reshape(count)
        self.opacities = _contiguous(_shaped("opacities", opacities, (count,)))
        sh0 = floats("sh0", self.sh0)
        self.sh0 = _contiguous(_shaped("sh0", sh0.reshape(count, 1, 3) if sh0.shape == (count, 3) else sh0, (count, 1, 3)))
        shN = floats("shN", self.shN)
        if shN.ndim != 3 or shN.shape[0] != count or shN.shape[1] not in (0, 3, 8, 15, 24) or shN.shape[2] != 3:
            raise _wrong_shape("shN", shN.shape, f"({count}, K, 3) with K of 0, 3, 8, 15 or 24")
        # The native part reads arrays of floats with strides of whole floats.
        self.shN = shN if _is_regular(shN) else shN.copy()
        if self.normals is not None:
            self.normals = _rows("normals", self.normals, 3, count)
        if not isinstance(self.extras, Mapping):
            raise wrong_type("extras", self.extras, "a dict of arrays by name")
        if self.offset is not None:
            self.offset = _shaped("offset", np.array(host(self.offset), np.float64), (3,))
        self.extras = {name: _contiguous(_shaped(name, np.asarray(v), (count,))) for name, v in self.extras.items()}
        self.comments = [text("comments", line) for line in self.comments]
        self.antialiased = flag("antialiased", self.antialiased)
        return self

    def __len__(self) -> int:
        return len(self.means)

    def __repr__(self) -> str:
        return f"Splats({len(self):,} Gaussians, SH degree {self.degree})"

    @property
    def degree(self) -> int:
        """SH degree, 0 to 4."""
        return int(math.isqrt(self.shN.shape[1] + 1)) - 1

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        arrays = [*self.to_dict(contiguous=False).values(), *self.extras.values()]
        return sum(array.nbytes for array in arrays) + (0 if self.normals is None else self.normals.nbytes)

    def __getitem__(self, which: Any) -> Splats:
        """The Gaussians that a slice, a mask or an array of numbers names."""
        if isinstance(which, (int, np.integer)):
            if not -len(self) <= which < len(self):
                raise IndexError(f"Gaussian {which} of {len(self)}")
            which = slice(which, None if which == -1 else which + 1)
        arrays = {name: getattr(self, name)[which] for name in NAMES}
        extras = {name: values[which] for name, values in self.extras.items()}
        normals = None if self.normals is None else self.normals[which]
        return Splats(
            **arrays,
            normals=normals,
            extras=extras,
            comments=[*self.comments],
            antialiased=self.antialiased,
            offset=self.offset,
        )

    def to_dict(self, space: Space = "log", *, contiguous: bool = True) -> dict[str, FloatArray]:
        """The six arrays by gsplat's names.

        Parameters
        ----------
        space : {"log", "linear"}
            ``"linear"`` gives standard deviations and opacities from 0 to 1, as gsplat's ``rasterization`` takes them.
        contiguous : bool
            Whether ``shN`` is copied if it has strides. The other arrays are not copied in ``"log"`` space.
        """
        arrays: dict[str, FloatArray] = {name: getattr(self, name) for name in NAMES}
        if contiguous and not self.shN.flags.c_contiguous:
            arrays["shN"] = _native.contiguous(self.shN)
        if _space(space) == "linear":
            with np.errstate(over="ignore"):
                arrays["scales"] = np.exp(self.scales)
                arrays["opacities"] = np.float32(1) / (np.float32(1) + np.exp(-self.opacities))
        return arrays

    def to_torch(self, space: Space = "log", *, contiguous: bool = True) -> dict[str, Any]:
        """:meth:`to_dict` as torch tensors on the CPU that share the memory of the arrays."""
        import torch  # type: ignore[import-not-found, unused-ignore]

        return {name: torch.from_dlpack(a) for name, a in self.to_dict(space, contiguous=contiguous).items()}

    @classmethod
    def from_dict(cls, arrays: Mapping[str, Any], space: Space = "log") -> Splats:
        """A scene of arrays or torch tensors by gsplat's names.

        Parameters
        ----------
        arrays : mapping
            ``means``, ``scales``, ``quats``, ``opacities`` and ``sh0``, and ``shN`` if there is view-dependent colour.
            Other keys are ignored.
        space : {"log", "linear"}
            What ``scales`` and ``opacities`` are. gsplat's trainers keep ``"log"``.
        """
        if not isinstance(arrays, Mapping):
            raise wrong_type("arrays", arrays, f"a dict of arrays with {', '.join(NAMES)}")
        missing = [name for name in NAMES[:-1] if name not in arrays]
        if missing:
            raise ParameterError(f"arrays = {sorted(map(str, arrays))}: {', '.join(missing)} missing")
        means, scales, quats, opacities, sh0 = (floats(name, arrays[name]) for name in NAMES[:-1])
        shN = floats("shN", arrays["shN"]) if "shN" in arrays else np.zeros((len(means), 0, 3), np.float32)
        if _space(space) == "linear":
            if scales.size and not scales.min() >= 0:
                raise ParameterError(f"scales = {scales.min()}: standard deviations of 0 or more in linear space")
            if opacities.size and not (opacities.min() >= 0 and opacities.max() <= 1):
                raise ParameterError("opacities: 0 to 1 in linear space")
            scales = np.log(np.maximum(scales, np.float32(_LEAST_SCALE)))
            with np.errstate(divide="ignore"):
                linear = opacities.astype(np.float64)
                logits = np.log(linear) - np.log1p(-linear)
            opacities = np.clip(logits, -_SURE_OPACITY, _SURE_OPACITY).astype(np.float32)
        return cls(means, scales, quats, opacities, sh0, shN)


def of_native(arrays: dict[str, Any]) -> Splats:
    """The scene of arrays that the native part made."""
    return Splats(**arrays)


def _space(space: str) -> str:
    if space not in ("log", "linear"):
        raise ParameterError(f"space = {space!r}: 'log' or 'linear'")
    return space


def host(values: Any) -> Any:
    """``values`` without gradients and in main memory, if they are a tensor."""
    return values.detach().cpu() if hasattr(values, "detach") else values


def floats(name: str, values: Any, dtype: Any = np.float32) -> npt.NDArray[Any]:
    """``values`` as floats of a type, sharing memory if they have it. Messages call them ``name``."""
    values = host(values)
    if not isinstance(values, np.ndarray) and hasattr(values, "__dlpack__"):
        values = np.from_dlpack(values)
    try:
        array = np.asarray(values)
        if array.dtype.kind in "fiub":
            return np.asarray(array, dtype)
    except (TypeError, ValueError):
        pass
    raise wrong_type(name, values, "an array of numbers")


def _contiguous(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    return np.require(values, requirements=["C", "A"])


def _is_regular(values: npt.NDArray[Any]) -> bool:
    return values.flags.aligned and all(stride % values.itemsize == 0 for stride in values.strides)


def _rows(name: str, values: Any, width: int, count: int | None = None) -> FloatArray:
    array = floats(name, values)
    expected = (len(array) if count is None and array.ndim else count or 0, width)
    return _contiguous(_shaped(name, array, expected))


def _shaped(name: str, array: npt.NDArray[Any], expected: Sequence[int]) -> npt.NDArray[Any]:
    if array.shape != tuple(expected):
        raise _wrong_shape(name, array.shape, str(tuple(expected)))
    return array


def _wrong_shape(name: str, found: Sequence[int], expected: str) -> ParameterError:
    error = ParameterError(f"{name} = an array of shape {tuple(found)}: expected {expected}")
    error.name = name
    return error
