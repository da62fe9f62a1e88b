"""Pictures, cameras and scores."""

from __future__ import annotations

import json
import math
import warnings
from pathlib import Path

import lexisplat as lx
import numpy as np
import pytest
from conftest import of_inria


def test_codes_are_drawn_as_the_dense_scene_is(packed: lx.Scene, views: list[lx.Camera]) -> None:
    from_codes = lx.render(packed, views, device="cpu")
    dense = lx.render(packed.decode(), views, device="cpu")
    assert len(from_codes) == len(views)
    for a, b in zip(from_codes, dense):
        assert a.shape == (64, 96, 3) and a.dtype == np.float32 and a.max() > 0.3
        assert lx.metrics.psnr(a, b) > 80


def test_options_of_pictures(splats: lx.Splats, views: list[lx.Camera]) -> None:
    white = lx.render(splats, views[0], background=(1, 1, 1), device="cpu")
    black = lx.render(splats, views[0], device="cpu")
    assert white[0, 0].tolist() == [1, 1, 1] and black[0, 0].tolist() == [0, 0, 0]
    plain = lx.render(splats, views[0], max_degree=0, device="cpu")
    assert 10 < lx.metrics.psnr(black, plain) < 50
    with pytest.raises(lx.ParameterError, match="degree"):
        lx.render(splats, views[0], max_degree=7)
    with pytest.raises(lx.ParameterError, match="device"):
        lx.render(splats, views[0], device="tpu")
    wrong = views[0].resized(96)
    wrong.width = 0
    with pytest.raises(lx.ParameterError, match="width"):
        lx.render(splats, wrong, device="cpu")


def test_scenes_are_compared(splats: lx.Splats, packed: lx.Scene, views: list[lx.Camera]) -> None:
    compared = lx.compare(splats, packed, views, device="cpu")
    each = [lx.metrics.psnr(lx.render(splats, v, device="cpu"), lx.render(packed, v, device="cpu")) for v in views]
    assert compared["psnr"]["mean"] == pytest.approx(np.mean(each)) and compared["psnr"]["min"] == min(each)
    assert len(compared["views"]) == len(views) and not compared["identical"]
    assert lx.compare(splats, splats, views, device="cpu")["identical"]


def test_scenes_with_nan_are_neither_drawn_nor_compared(splats: lx.Splats, views: list[lx.Camera]) -> None:
    bad = splats[:]
    bad.scales = bad.scales.copy()
    bad.scales[5, 2] = np.nan
    advice = "scales = NaN of Gaussian 5: finite values; 1 of 3000 .*drop_invalid=True"
    for refused in (
        lambda: lx.render(bad, views[0], device="cpu"),
        lambda: lx.compare(splats, bad, views, device="cpu"),
        lambda: lx.compare(bad, splats, views, device="cpu"),
        lambda: lx.orbit(bad),
    ):
        with pytest.raises(lx.ParameterError, match=advice):
            refused()
    good = splats[np.arange(3000) != 5]
    with pytest.warns(lx.LexisplatWarning, match="dropped 1 of 3000"):
        drawn = lx.render(bad, views[0], device="cpu", drop_invalid=True)
    np.testing.assert_array_equal(drawn, lx.render(good, views[0], device="cpu"))
    with pytest.warns(lx.LexisplatWarning, match="dropped 1 of 3000"):
        assert lx.compare(bad, good, views, device="cpu", drop_invalid=True)["identical"]


def test_pictures_with_nan_are_refused_and_others_out_of_range_told() -> None:
    a = np.random.default_rng(0).random((20, 30, 3)).astype(np.float32)
    bad = a.copy()
    bad[4, 7, 1] = np.nan
    for score in (lx.metrics.score, lx.metrics.psnr, lx.metrics.ssim, lx.metrics.flip):
        for pair in ((a, bad), (bad, a), (bad, bad)):
            with pytest.raises(lx.ParameterError, match="NaN at column 7, row 4"):
                score(*pair)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            score(a, a * np.float32(0.5))
        with pytest.warns(lx.LexisplatWarning, match="picture b: values from .* to 2.* are clipped .*divide by 255") as told:
            score(a, a * 255)
        assert told[0].filename == __file__
    with pytest.warns(lx.LexisplatWarning, match=r"picture a: values from -.* are clipped to 0..1$"):
        lx.metrics.psnr(a - 0.5, a)


def test_views_like_photographs_are_found(splats: lx.Splats) -> None:
    found = lx.photographs(splats, 3)
    assert len(found) == 3 and all(camera.width > 0 for camera in found)


def test_cameras_are_read_and_written_as_gsplat_has_them(tmp_path: Path, views: list[lx.Camera]) -> None:
    camera = views[1]
    again = lx.Camera.from_viewmat(camera.viewmat, camera.K, camera.width, camera.height)
    np.testing.assert_allclose(again.position, camera.position, atol=1e-5)
    np.testing.assert_allclose(again.rotation, camera.rotation, atol=1e-6)
    assert (again.fx, again.fy) == pytest.approx((camera.fx, camera.fy))
    off = camera.K.copy()
    off[0, 2] += 5
    with pytest.warns(lx.LexisplatWarning, match="5.0 pixels"):
        lx.Camera.from_viewmat(camera.viewmat, off, camera.width, camera.height)
    path = tmp_path / "cameras.json"
    path.write_text(json.dumps([of_inria(camera)]))
    (read,) = lx.cameras(path)
    np.testing.assert_array_equal(read.rotation, camera.rotation)
    assert read.name == camera.name and read.split is None
    path.write_text("[{}]")
    with pytest.raises(lx.FormatError):
        lx.cameras(path)
    small = camera.resized(48)
    assert (small.width, small.height) == (48, 32) and small.fx == pytest.approx(camera.fx / 2)


def test_scores_are_those_of_their_definitions() -> None:
    random = np.random.default_rng(0)
    a = random.random((40, 50, 3)).astype(np.float32)
    b = np.clip(a + random.normal(0, 0.05, a.shape), 0, 1).astype(np.float32)
    assert lx.metrics.psnr(a, b) == pytest.approx(-10 * math.log10(np.mean((a.astype(np.float64) - b) ** 2)))
    assert 0 < lx.metrics.ssim(a, b) < 1 and 0 < lx.metrics.flip(a, b) < 1
    assert lx.metrics.score(a, a, flip=True) == {"psnr": math.inf, "ssim": 1.0, "flip": 0.0}
    eight = (a * 255).round().astype(np.uint8)
    assert lx.metrics.psnr(eight, eight.astype(np.float32) / 255) == math.inf
    with pytest.raises(lx.ParameterError, match="picture"):
        lx.metrics.psnr(a, b[:10])
    with pytest.raises(lx.ParameterError, match="picture"):
        lx.metrics.psnr(a[..., :2], b[..., :2])
