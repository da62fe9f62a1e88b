"""Pictures, and comparisons by pictures."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from typing import Any, overload

from . import _native
from ._arguments import BYTE, checked, count as whole, device as device_of, flag, number, optional, several, wrong_type
from ._cameras import Camera, as_tuples, native
from ._compress import Cameras, views_of
from ._device import quiet
from ._files import warn
from ._progress import Progress, reporter
from ._scene import Scene
from ._splats import FloatArray, Splats

Colour = Sequence[float]


@overload
def render(
    scene: Splats | Scene,
    camera: Camera,
    *,
    background: Colour = ...,
    max_degree: int | None = ...,
    device: str | int = ...,
    drop_invalid: bool = ...,
    progress: Progress = ...,
) -> FloatArray: ...
@overload
def render(
    scene: Splats | Scene,
    camera: Sequence[Camera] | str | os.PathLike[str],
    *,
    background: Colour = ...,
    max_degree: int | None = ...,
    device: str | int = ...,
    drop_invalid: bool = ...,
    progress: Progress = ...,
) -> list[FloatArray]: ...
@checked()
def render(
    scene: Splats | Scene,
    camera: Camera | Cameras,
    *,
    background: Colour = (0.0, 0.0, 0.0),
    max_degree: int | None = None,
    device: str | int = "auto",
    drop_invalid: bool = False,
    progress: Progress = None,
) -> FloatArray | list[FloatArray]:
    """Draws a scene by the rules of the 3DGS authors' rasteriser; a :class:`Scene` straight from its sparse codes.

    Parameters
    ----------
    scene : Splats or Scene
        What is drawn.
    camera : Camera, sequence of Camera, or path
        Where it is drawn from.
    background : three floats
        Colour behind the scene, 0 to 1.
    max_degree : int, optional
        Highest SH degree that is drawn.
    device : {"auto", "cpu", "gpu"} or a number as text
        ``"cpu"`` gives the same bits on every machine; ``"auto"`` takes a GPU if there is one.
    drop_invalid : bool
        Whether Gaussians of ``Splats`` with NaN or infinite values are left out. Otherwise such a scene is refused.
    progress : callable or bool, optional
        As :func:`compress`.

    Returns
    -------
    (height, width, 3) of float32, or a list of them
        0 is black and 1 is white; values are not clipped.

    Raises
    ------
    ParameterError, GpuError
    """
    if isinstance(scene, Camera):
        raise wrong_type("scene", scene, "Splats or a Scene: render(scene, camera) takes the scene first")
    drawn, name = native(scene), device_of(device)
    alone = isinstance(camera, Camera)
    views = as_tuples(views_of(camera))
    with quiet(name):
        pictures, told = _native.render(
            drawn,
            views,
            background=several(number, "background", background, 3),
            max_degree=optional(whole, "max_degree", max_degree, BYTE),
            device_name=name,
            drop_invalid=flag("drop_invalid", drop_invalid),
            progress=reporter(progress),
        )
    warn(told, "the scene")
    return pictures[0] if alone else pictures


@checked()
def compare(
    a: Splats | Scene,
    b: Splats | Scene,
    cameras: Cameras | None = None,
    *,
    count: int = 8,
    background: Colour = (0.0, 0.0, 0.0),
    eight_bit: bool = False,
    device: str | int = "auto",
    drop_invalid: bool = False,
    progress: Progress = None,
) -> dict[str, Any]:
    """Scores pictures of ``b`` against those of ``a``, view by view.

    Parameters
    ----------
    a, b : Splats or Scene
        The original, and what is compared with it.
    cameras : sequence of Camera, or path, optional
        Where both are drawn from. Otherwise ``count`` views of ``a`` like photographs are looked for.
    background : three floats
        Colour behind the scenes.
    eight_bit : bool
        Whether pictures are rounded to 8 bits first.
    drop_invalid : bool
        As :func:`render`, of both scenes.

    Returns
    -------
    dict
        ``identical``; ``psnr`` and ``ssim`` with ``mean``, ``min`` and ``max`` over views (``psnr`` over those that
        differ); ``views``, a dict each.
    """
    scenes, name = (native(a, "a"), native(b, "b")), device_of(device)
    views = None if cameras is None else as_tuples(views_of(cameras))
    with quiet(name):
        compared, told = _native.compare(
            *scenes,
            views,
            count=whole("count", count),
            background=several(number, "background", background, 3),
            eight_bit=flag("eight_bit", eight_bit),
            device_name=name,
            drop_invalid=flag("drop_invalid", drop_invalid),
            progress=reporter(progress),
        )
    warn(told, "the scene")
    return dict(json.loads(compared))
