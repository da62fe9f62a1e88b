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
from ._arguments import MOST_32, MOST_COUNT, checked, number, optional, text, wrong_type
from ._arguments import count as whole
from ._arguments import path as path_of
from ._errors import LexisplatWarning, ParameterError
from ._progress import Progress, reporter
from ._scene import Scene
from ._splats import Splats, floats, host

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
    near : float
        Distance of the near plane, in world units. Gaussians nearer than it are not drawn. The default is the trainer's.
        Cameras that :func:`orbit` and :func:`photographs` make have one of the scene's own size.
    """

    width: int
    height: int
    fx: float
    fy: float
    position: npt.NDArray[np.float64]
    rotation: npt.NDArray[np.float32]
    name: str = ""
    split: Literal["train", "test"] | None = None
    near: float = 0.2

    def __post_init__(self) -> None:
        self._checked()

    def _checked(self) -> Camera:
        """Brings every field to its type and shape."""
        self.width, self.height = whole("width", self.width, MOST_32), whole("height", self.height, MOST_32)
        self.fx, self.fy = number("fx", self.fx), number("fy", self.fy)
        self.near = number("near", self.near)
        self.name = text("name", self.name)
        optional(text, "split", self.split, ("train", "test"))
        self.position = floats("position", self.position, np.float64)
        self.rotation = floats("rotation", self.rotation)
        if self.position.shape != (3,) or self.rotation.shape != (3, 3):
            raise ParameterError("camera: expected a position of shape (3,) and a rotation of shape (3, 3)")
        return self

    @classmethod
    def from_viewmat(cls, viewmat: Any, K: Any, width: int, height: int, name: str = "") -> Camera:
        """A camera as gsplat describes it: ``viewmat`` (4, 4) from world to camera, ``K`` (3, 3)."""
        view, intrinsics = floats("viewmat", viewmat, np.float64), floats("K", K, np.float64)
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
        return Camera(self.width, self.height, self.fx, self.fy, position, self.rotation, self.name, self.split, self.near)

    def resized(self, width: int) -> Camera:
        """The camera with pictures of this width, of the same field of view."""
        height = max(1, round(self.height * width / self.width))
        focal = self.fx * width / self.width, self.fy * height / self.height
        return Camera(width, height, *focal, self.position, self.rotation, self.name, self.split, self.near)


@checked()
def cameras(path: str | os.PathLike[str]) -> list[Camera]:
    """Reads cameras: INRIA's ``cameras.json``, ``transforms.json``, a COLMAP folder, or a folder that has one of them.

    Raises
    ------
    IoError, FormatError, LimitError
    """
    found, told = _native.read_cameras(path_of("path", path))
    for sentence in told:
        warnings.warn(f"{path}: {sentence}", LexisplatWarning, stacklevel=3)
    return [_of_tuple(camera) for camera in found]


@checked()
def orbit(scene: Splats | Scene, count: int = 24, *, width: int = 960, height: int = 640) -> list[Camera]:
    """Cameras on a circle around the scene."""
    sides = whole("width", width, MOST_32), whole("height", height, MOST_32)
    return [_of_tuple(camera) for camera in _native.orbit(native(scene), whole("count", count, MOST_COUNT), *sides)]


@checked()
def photographs(scene: Splats | Scene, count: int = 8, *, progress: Progress = None) -> list[Camera]:
    """Views of the scene that are like photographs. :func:`compress` judges by such views where no cameras are given."""
    found = _native.photographs(native(scene), whole("count", count, MOST_COUNT), progress=reporter(progress))
    return [_of_tuple(camera) for camera in found]


def native(scene: Splats | Scene, name: str = "scene") -> Any:
    """What the native part takes for a scene."""
    if isinstance(scene, Scene):
        return scene._native
    if isinstance(scene, Splats):
        return scene._checked()
    expected = "Splats or a Scene; Splats.from_dict takes a dict of arrays, lexisplat.load a path"
    raise wrong_type(name, scene, expected)


def as_tuples(cameras: Iterable[Camera]) -> list[_native.CameraTuple]:
    """What the native part takes for cameras."""
    expected = "a Camera, Cameras, or the path of a file that lexisplat.cameras reads"
    if not isinstance(cameras, Iterable) or isinstance(cameras, (bytes, dict)):
        raise wrong_type("cameras", cameras, expected)
    tuples = []
    for index, c in enumerate(cameras):
        if not isinstance(c, Camera):
            raise wrong_type(f"cameras[{index}]", c, "a Camera")
        c._checked()
        pose = c.position.tolist(), c.rotation.tolist()
        tuples.append((c.name, c.width, c.height, c.fx, c.fy, *pose, c.near, c.split))
    return tuples


def _of_tuple(camera: _native.CameraTuple) -> Camera:
    name, width, height, fx, fy, position, rotation, near, split = camera
    pose = np.array(position, np.float64), np.array(rotation, np.float32)
    return Camera(width, height, fx, fy, *pose, name, split, near)

