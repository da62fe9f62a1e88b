"""Writes examples/lexisplat.ipynb without outputs: python make_notebook.py"""

from __future__ import annotations

import json
from pathlib import Path

CELLS = [
    """# lexisplat in Python

A trained scene in, a small file out, and what that cost in pictures. `SCENE` may name a file of yours (PLY, SPZ, SOG, ...); without it a small scene is made here.""",
    """
import os

import lexisplat as lx
import matplotlib.pyplot as plt
import numpy as np


def made(count=20_000, seed=0):
    "A glossy ring: its colour depends on where it is seen from."
    random = np.random.default_rng(seed)
    u, v = random.uniform(0, 2 * np.pi, (2, count))
    normal = np.stack([np.cos(v) * np.cos(u), np.sin(v), np.cos(v) * np.sin(u)], 1)
    means = 0.35 * normal + np.stack([np.cos(u), 0 * u, np.sin(u)], 1)
    shN = 0.25 * normal[:, [1, 2, 0]][:, :, None] * np.array([1.0, 0.9, 0.8]) * [[[1], [-1], [1]]]
    shN = np.concatenate([shN, 0.08 * random.normal(size=(1, 12, 3)) * normal[:, :1, None]], 1)
    sh0 = np.sin(np.stack([3 * u, 3 * u + 2, 3 * u + 4], 1))[:, None]
    return lx.Splats(
        means=means, scales=random.normal(-3.9, 0.25, (count, 3)), quats=random.normal(size=(count, 4)),
        opacities=np.full(count, 3.0), sh0=sh0, shN=shN,
    )


splats = lx.load(os.environ["SCENE"]) if "SCENE" in os.environ else made()
splats
""",
    "Every array has gsplat's name and shape. `shN` is a view of the channel-major array that files hold; nothing was copied.",
    """
{name: (array.shape, str(array.dtype)) for name, array in splats.to_dict(contiguous=False).items()}
""",
    "## Compress\n\nThe default is about 40 dB. `psnr=`, `min_psnr=`, `size=` and `ratio=` search for a target. The bytes are those that the program makes.",
    """
scene = lx.compress(splats)
print(scene)
print(f"{splats.nbytes / scene.nbytes:.1f} times smaller than the arrays")
for part, size in sorted(scene.nbytes_by_part.items(), key=lambda item: -item[1])[:6]:
    print(f"{part:>15} {size:10,.0f} bytes")
""",
    "## Look\n\nA scene is drawn straight from its sparse codes.",
    """
camera = lx.photographs(splats, 2)[0].resized(480)
before, after = lx.render(splats, camera, device="cpu"), lx.render(scene, camera, device="cpu")
figure, axes = plt.subplots(1, 3, figsize=(15, 4))
amplified = 0.5 + 8 * (after - before)
for axis, picture, title in zip(axes, (before, after, amplified), ("original", "from the codes", "difference, times 8")):
    axis.imshow(np.clip(picture, 0, 1))
    axis.set_title(title)
    axis.axis("off")
axes[1].set_xlabel("")
figure.tight_layout()
lx.metrics.score(before, after, flip=True)
""",
    "## How small for how good",
    """
views = [camera.resized(320) for camera in lx.photographs(splats, 6)]
points = []
for preset in ("small", "balanced", "high"):
    made_of_it = lx.compress(splats, preset=preset, cameras=views)
    points.append((made_of_it.nbytes / 1e3, lx.compare(splats, made_of_it, views, device="cpu")["psnr"]["mean"]))
figure, axis = plt.subplots(figsize=(6, 3.5))
axis.plot(*zip(*points), "o-")
for (size, psnr), name in zip(points, ("small", "balanced", "high")):
    axis.annotate(name, (size, psnr), textcoords="offset points", xytext=(6, -10))
axis.set(xlabel="file, kB", ylabel="PSNR, dB")
axis.grid(alpha=0.3)
""",
    "## The paper's part by itself\n\nA dictionary and sparse codes within a tolerance, for rows of any length, as scikit-learn has its estimators.",
    """
X = np.ascontiguousarray(splats.shN.transpose(0, 2, 1)).reshape(len(splats), -1)
learner = lx.DictionaryLearner(tol=0.1).fit(X)
codes = learner.transform(X)
errors = np.linalg.norm(learner.inverse_transform(codes) - X, axis=1)
print(codes.shape, f"{codes.nnz / len(X):.2f} of {X.shape[1]} nonzeros a row, largest error {errors.max():.4f}")
figure, axis = plt.subplots(figsize=(8, 3))
axis.imshow(learner.components_[:45].T, cmap="RdBu", vmin=-0.6, vmax=0.6, aspect="auto")
axis.set(xlabel="atom, most used first", ylabel="coefficient");
""",
]


def main() -> None:
    def cell(index: int, text: str) -> dict[str, object]:
        lines = text.strip().splitlines(keepends=True)
        common: dict[str, object] = {"id": f"cell-{index}", "metadata": {}, "source": lines}
        if text.startswith("\n"):
            return {"cell_type": "code", "execution_count": None, "outputs": [], **common}
        return {"cell_type": "markdown", **common}

    notebook = {
        "cells": [cell(index, text) for index, text in enumerate(CELLS)],
        "metadata": {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}},
        "nbformat": 4,
        "nbformat_minor": 5,
    }
    path = Path(__file__).with_name("lexisplat.ipynb")
    path.write_text(json.dumps(notebook, indent=1) + "\n")


if __name__ == "__main__":
    main()
