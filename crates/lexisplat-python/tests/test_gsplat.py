"""Checkpoints in the manner of gsplat."""

from __future__ import annotations

from pathlib import Path

import lexisplat as lx
import numpy as np
import pytest

NAMES = {"means", "scales", "quats", "opacities", "sh0", "shN"}


def test_a_checkpoint_comes_back(splats: lx.Splats, views: list[lx.Camera], tmp_path: Path) -> None:
    compression = lx.LexiCompression(cameras=views, keep_order=True)
    compression.compress(tmp_path / "a", splats.to_dict())
    assert {path.name for path in (tmp_path / "a").iterdir()} == {"scene.lexi", "meta.json"}
    back = compression.decompress(tmp_path / "a")
    assert set(back) == NAMES
    assert back["shN"].shape == (3000, 15, 3) and back["opacities"].shape == (3000,)
    np.testing.assert_allclose(np.asarray(back["means"]), splats.means, atol=0.02)
    assert lx.compare(splats, lx.Splats.from_dict(back), views, device="cpu")["psnr"]["min"] > 34


def test_keys_that_have_no_place_are_refused(splats: lx.Splats, tmp_path: Path) -> None:
    with pytest.raises(lx.ParameterError, match="features"):
        lx.LexiCompression().compress(tmp_path, splats.to_dict() | {"features": np.zeros((3000, 32))})
    assert not list(tmp_path.iterdir())
