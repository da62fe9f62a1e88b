"""A scene that is made here, and where the repository's files are."""

from __future__ import annotations

import os
from pathlib import Path

import lexisplat as lx
import numpy as np
import pytest


def make(count: int = 3000, degree: int = 3, seed: int = 0) -> lx.Splats:
    """Gaussians on a sphere whose colour depends on where they are and from where they are seen."""
    random = np.random.default_rng(seed)
    means = random.normal(size=(count, 3))
    means /= np.linalg.norm(means, axis=1, keepdims=True)
    coefficients = (degree + 1) ** 2 - 1
    patterns = random.normal(size=(6, coefficients, 3))
    weights = random.normal(size=(count, 6)) * (random.random((count, 6)) < 0.4)
    return lx.Splats(
        means=means,
        scales=random.normal(-3.3, 0.3, size=(count, 3)),
        quats=random.normal(size=(count, 4)),
        opacities=random.normal(2.0, 1.0, size=count),
        sh0=means[:, None, :] * 0.8,
        shN=0.1 * np.einsum("ni,ikc->nkc", weights, patterns),
        comments=["made by the tests"],
    )


def of_inria(camera: lx.Camera) -> dict[str, object]:
    """An entry of INRIA's ``cameras.json``."""
    return {
        "id": 0,
        "img_name": camera.name,
        "width": camera.width,
        "height": camera.height,
        "position": camera.position.tolist(),
        "rotation": camera.rotation.tolist(),
        "fx": camera.fx,
        "fy": camera.fy,
    }


@pytest.fixture(scope="session")
def splats() -> lx.Splats:
    return make()


@pytest.fixture(scope="session")
def ply(splats: lx.Splats, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("scene") / "scene.ply"
    lx.save(path, splats)
    return path


@pytest.fixture(scope="session")
def views(splats: lx.Splats) -> list[lx.Camera]:
    return lx.orbit(splats, 4, width=96, height=64)


@pytest.fixture(scope="session")
def packed(splats: lx.Splats, views: list[lx.Camera]) -> lx.Scene:
    return lx.compress(splats, cameras=views)


@pytest.fixture(scope="session")
def golden() -> Path:
    path = Path(__file__).parents[2] / "lexisplat/tests/golden"
    if not path.is_dir():
        pytest.skip("not in the repository")
    return path


@pytest.fixture(scope="session")
def program() -> str:
    """The built program, which LEXISPLAT_PROGRAM names."""
    path = os.environ.get("LEXISPLAT_PROGRAM")
    if path is None:
        pytest.skip("LEXISPLAT_PROGRAM is not set")
    return path
