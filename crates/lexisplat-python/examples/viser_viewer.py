"""Shows a scene in a browser by viser: python viser_viewer.py scene.lexi, then open http://localhost:8080

viser draws without view-dependent colour. `lexisplat html` makes a page that draws with it.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import lexisplat as lx
import numpy as np
import viser

C0 = 0.28209479177387814  # SH function of degree 0


def covariances(splats: lx.Splats) -> Any:
    """(N, 3, 3): rotations and squared sizes."""
    w, x, y, z = (splats.quats / np.linalg.norm(splats.quats, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    axes = np.moveaxis(np.array(rows), 2, 0) * np.exp(splats.scales)[:, None]
    return axes @ axes.transpose(0, 2, 1)


def main(path: str, port: int = 8080) -> viser.ViserServer:
    server = viser.ViserServer(port=port)
    splats = lx.load(path)
    server.scene.add_gaussian_splats(
        "scene",
        centers=splats.means,
        covariances=covariances(splats),
        rgbs=np.clip(0.5 + C0 * splats.sh0[:, 0], 0, 1),
        opacities=1 / (1 + np.exp(-splats.opacities[:, None])),
    )
    return server


if __name__ == "__main__":
    server = main(sys.argv[1])
    while True:
        time.sleep(1)
