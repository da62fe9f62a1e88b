"""Pinhole cameras."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from . import _native
from ._errors import LexisplatWarning, ParameterError
from ._progress import Progress, reporter
from ._scene import Scene
from ._splats import Splats, host

#: A principal point farther than this from the centre, in pixels, is told, because it is not drawn.
_CENTRE_SLACK = 0.5


@dataclass(eq=False)
class Camera:
    """A pinhole camera whose optical axis meets the picture in its centre.

    Parameters
    ----------
    width, height : int
        Of the picture, in pixels.
    fx, fy : float
        Focal lengths, in pixels.
    position : (3,)
        Centre of the camera, in the world, in float64. The offset of a scene is subtracted when it is drawn.
    rotation : (3, 3)
        Camera to world. The columns are the camera's right, down and forward directions in the world.
    name : str
        Name of the photo or the view.
    split : {"train", "test"}, optional
        Which part of a data set it belongs to.
    """

    width: int
    height: int
    fx: float
    fy: float
    position: npt.NDArray[np.float64]
    rotation: npt.NDArray[np.float32]
    name: str = ""
    split: Literal["train", "test"] | None = None

    def __post_init__(self) -> None:
        self.position = np.asarray(self.position, np.float64)
        self.rotation = np.asarray(self.rotation, np.float32)
        if self.position.shape != (3,) or self.rotation.shape != (3, 3):
            raise ParameterError("camera: expected a position of shape (3,) and a rotation of shape (3, 3)")

    @classmethod
    def from_viewmat(cls, viewmat: Any, K: Any, width: int, height: int, name: str = "") -> Camera:
        """A camera as gsplat describes it: ``viewmat`` (4, 4) from world to camera, ``K`` (3, 3)."""
        view, intrinsics = (np.asarray(host(m), np.float64) for m in (viewmat, K))
        if view.shape != (4, 4) or intrinsics.shape != (3, 3):
            raise ParameterError("camera: expected a viewmat of shape (4, 4) and a K of shape (3, 3)")
        off = np.abs(intrinsics[:2, 2] - np.array([width, height]) / 2).max()
        if off > _CENTRE_SLACK:
            told = f"the principal point is {off:.1f} pixels off the centre; it is ignored"
            warnings.warn(told, LexisplatWarning, stacklevel=2)
        rotation = view[:3, :3].T
        position = -rotation @ view[:3, 3]
        focal = float(intrinsics[0, 0]), float(intrinsics[1, 1])
        return cls(width, height, *focal, position, rotation.astype(np.float32), name)

    @property
    def viewmat(self) -> npt.NDArray[np.float32]:
        """(4, 4), from world to camera."""
        view = np.eye(4, dtype=np.float32)
        view[:3, :3] = self.rotation.T
        view[:3, 3] = -self.rotation.T.astype(np.float64) @ self.position
        return view

    @property
    def K(self) -> npt.NDArray[np.float32]:
        """(3, 3), the intrinsics."""
        half = self.width / 2, self.height / 2
        return np.array([[self.fx, 0, half[0]], [0, self.fy, half[1]], [0, 0, 1]], np.float32)

    def relative_to(self, offset: Any) -> Camera:
        """The camera beside ``means`` that are relative to ``offset``, for other renderers; ``None`` changes nothing."""
        position = self.position if offset is None else self.position - np.asarray(host(offset), np.float64)
        return Camera(self.width, self.height, self.fx, self.fy, position, self.rotation, self.name, self.split)

    def resized(self, width: int) -> Camera:
        """The camera with pictures of this width, of the same field of view."""
        height = max(1, round(self.height * width / self.width))
        focal = self.fx * width / self.width, self.fy * height / self.height
        return Camera(width, height, *focal, self.position, self.rotation, self.name, self.split)


def cameras(path: str | os.PathLike[str]) -> list[Camera]:
    """Reads cameras: INRIA's ``cameras.json``, ``transforms.json``, a COLMAP folder, or a folder that has one of them.

    Raises
    ------
    IoError, FormatError, LimitError
    """
    found, told = _native.read_cameras(path)
    for sentence in told:
        warnings.warn(f"{path}: {sentence}", LexisplatWarning, stacklevel=2)
    return [_of_tuple(camera) for camera in found]


def orbit(scene: Splats | Scene, count: int = 24, *, width: int = 960, height: int = 640) -> list[Camera]:
    """Cameras on a circle around the scene."""
    return [_of_tuple(camera) for camera in _native.orbit(native(scene), count, width, height)]


def photographs(scene: Splats | Scene, count: int = 8, *, progress: Progress = None) -> list[Camera]:
    """Views of the scene that are like photographs. :func:`compress` judges by such views where no cameras are given."""
    found = _native.photographs(native(scene), count, progress=reporter(progress))
    return [_of_tuple(camera) for camera in found]


def native(scene: Splats | Scene) -> Any:
    """What the native part takes for a scene."""
    if isinstance(scene, Scene):
        return scene._native
    if isinstance(scene, Splats):
        return scene._checked()
    kind = type(scene).__name__
    raise TypeError(f"{kind}: expected Splats or a Scene; Splats.from_dict takes a dict of arrays, lexisplat.load a path")


def as_tuples(cameras: Iterable[Camera]) -> list[_native.CameraTuple]:
    """What the native part takes for cameras."""
    return [
        (c.name, c.width, c.height, c.fx, c.fy, c.position.tolist(), c.rotation.tolist(), c.split) for c in cameras
    ]


def _of_tuple(camera: _native.CameraTuple) -> Camera:
    name, width, height, fx, fy, position, rotation, split = camera
    return Camera(width, height, fx, fy, np.array(position, np.float64), np.array(rotation, np.float32), name, split)

