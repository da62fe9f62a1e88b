"""Arrays in and out."""

from __future__ import annotations

from pathlib import Path

import lexisplat as lx
import numpy as np
import pytest
from conftest import make

NAMES = ("means", "scales", "quats", "opacities", "sh0", "shN")


def same(a: lx.Splats, b: lx.Splats) -> None:
    for name in NAMES:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)


@pytest.mark.parametrize("degree", range(5))
def test_a_ply_gives_back_what_was_saved(degree: int, tmp_path: Path) -> None:
    before = make(50, degree)
    before.extras = {"time": np.arange(50, dtype=np.float64), "label": np.arange(50, dtype=np.uint8)}
    before.normals = np.ones((50, 3), np.float32)
    lx.save(tmp_path / "a.ply", before)
    after = lx.load(tmp_path / "a.ply")
    same(before, after)
    assert after.degree == degree and len(after) == 50
    assert after.comments == before.comments
    assert after.normals is not None
    np.testing.assert_array_equal(after.normals, before.normals)
    for name, values in before.extras.items():
        assert after.extras[name].dtype == values.dtype
        np.testing.assert_array_equal(after.extras[name], values)


def test_what_is_loaded_is_not_copied(ply: Path) -> None:
    splats = lx.load(ply)
    arrays = splats.to_dict(contiguous=False)
    for name in NAMES:
        assert np.shares_memory(arrays[name], getattr(splats, name)), name
        assert arrays[name].dtype == np.float32 and arrays[name].flags.writeable, name
    # Files hold the channels apart: SH-rest is a view of that array.
    n, k, _ = splats.shN.shape
    assert splats.shN.strides == (12 * k, 4, 4 * k)
    assert not splats.shN.flags.owndata and np.shares_memory(splats.shN, splats.shN.transpose(0, 2, 1))
    assert splats.shN.transpose(0, 2, 1).flags.c_contiguous
    contiguous = splats.to_dict()
    assert contiguous["shN"].flags.c_contiguous and contiguous["shN"].shape == (n, k, 3)
    np.testing.assert_array_equal(contiguous["shN"], splats.shN)


@pytest.mark.parametrize("degree", range(5))
def test_sh_are_contiguous_if_asked(degree: int, tmp_path: Path) -> None:
    lx.save(tmp_path / "a.ply", make(9000, degree))
    strided, contiguous = lx.load(tmp_path / "a.ply"), lx.load(tmp_path / "a.ply", contiguous=True)
    same(strided, contiguous)
    assert contiguous.shN.flags.c_contiguous
    assert np.shares_memory(contiguous.to_dict()["shN"], contiguous.shN) or degree == 0


def test_any_strides_of_sh_are_taken(tmp_path: Path) -> None:
    splats = make(5000)
    odd = np.zeros((5000, 3, 40), np.float32)
    odd[:, :, 5:35:2] = splats.shN.transpose(0, 2, 1)
    strided = lx.Splats(**{name: getattr(splats, name) for name in NAMES[:-1]}, shN=odd[:, :, 5:35:2].transpose(0, 2, 1))
    assert not strided.shN.flags.c_contiguous
    lx.save(tmp_path / "a.ply", strided)
    same(splats, lx.load(tmp_path / "a.ply"))


def test_both_spaces_come_back(splats: lx.Splats) -> None:
    same(splats, lx.Splats.from_dict(splats.to_dict()))
    linear = splats.to_dict("linear")
    np.testing.assert_allclose(linear["scales"], np.exp(splats.scales))
    np.testing.assert_allclose(linear["opacities"], 1 / (1 + np.exp(-splats.opacities.astype(np.float64))), rtol=1e-6)
    back = lx.Splats.from_dict(linear, space="linear")
    np.testing.assert_allclose(back.scales, splats.scales, atol=1e-6)
    np.testing.assert_allclose(back.opacities, splats.opacities, atol=1e-2)
    linear["opacities"][:2] = [0, 1]
    linear["scales"][0] = 0
    sure = lx.Splats.from_dict(linear, space="linear")
    assert sure.opacities[:2].tolist() == [-100, 100] and np.isfinite(sure.scales).all()


def test_sizes_of_zero_are_flat(tmp_path: Path, splats: lx.Splats) -> None:
    flat = splats[:]
    flat.scales = flat.scales.copy()
    flat.scales[:, 2] = -np.inf
    assert len(lx.compress(flat, keep_all=True, guess=True)) == len(splats)
    lx.save(tmp_path / "a.ply", flat)
    assert (lx.load(tmp_path / "a.ply").scales[:, 2] == -20).all()


def test_a_run_that_leaves_nothing_is_an_error(tmp_path: Path, splats: lx.Splats) -> None:
    lx.save(tmp_path / "nan.ply", splats)
    header, rows = (tmp_path / "nan.ply").read_bytes().split(b"end_header\n", 1)
    nothing = np.full_like(np.frombuffer(rows, np.float32), np.nan).tobytes()
    (tmp_path / "nan.ply").write_bytes(header + b"end_header\n" + nothing)
    with pytest.raises(lx.FormatError, match="no Gaussian is left"):
        lx.compress(tmp_path / "nan.ply", drop_invalid=True)
    for name in ("a.ply", "a.spz", "a.lexi"):
        with pytest.raises(lx.ParameterError, match="no Gaussians"):
            lx.save(tmp_path / name, splats[:0])
    with pytest.raises(lx.ParameterError, match="no Gaussians"):
        lx.compress(splats[:0])


def test_other_types_are_converted() -> None:
    splats = lx.Splats.from_dict(
        {
            "means": [[0, 0, 0]],
            "scales": np.zeros((1, 3), np.float64),
            "quats": [[1, 0, 0, 0]],
            "opacities": np.zeros((1, 1)),
            "sh0": np.zeros((1, 3)),
        }
    )
    assert splats.degree == 0 and splats.shN.shape == (1, 0, 3) and splats.opacities.shape == (1,)
    assert all(getattr(splats, name).dtype == np.float32 for name in NAMES)


class Exchanged:
    """Something that is no array but hands one over, as tensors of other libraries."""

    def __init__(self, values: np.ndarray) -> None:
        self.values = values

    def __dlpack__(self, **options: object) -> object:
        return self.values.__dlpack__(**options)

    def __dlpack_device__(self) -> tuple[int, int]:
        return self.values.__dlpack_device__()


def test_tensors_are_taken_without_a_copy(splats: lx.Splats) -> None:
    taken = lx.Splats.from_dict({name: Exchanged(getattr(splats, name)) for name in NAMES})
    for name in NAMES:
        assert np.shares_memory(getattr(taken, name), getattr(splats, name)), name
    given = np.from_dlpack(splats.shN)
    assert np.shares_memory(given, splats.shN)


def test_torch_shares_memory(splats: lx.Splats) -> None:
    torch = pytest.importorskip("torch")
    tensors = splats.to_torch(contiguous=False)
    assert all(isinstance(tensor, torch.Tensor) for tensor in tensors.values())
    assert tensors["means"].data_ptr() == splats.means.ctypes.data
    parameters = {name: torch.nn.Parameter(tensor) for name, tensor in tensors.items()}
    same(splats, lx.Splats.from_dict(parameters))


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"quats": np.zeros((10, 3))}, "quats"),
        ({"scales": np.zeros((9, 3))}, "scales"),
        ({"opacities": np.zeros((10, 2))}, "opacities"),
        ({"sh0": np.zeros((10, 3, 1))}, "sh0"),
        ({"shN": np.zeros((10, 4, 3))}, "shN"),
        ({"shN": np.zeros((10, 45))}, "shN"),
        ({"means": np.zeros(10)}, "means"),
    ],
)
def test_wrong_shapes_are_named(change: dict[str, np.ndarray], named: str) -> None:
    arrays = {name: getattr(make(10), name) for name in NAMES}
    with pytest.raises(lx.ParameterError, match=named):
        lx.Splats.from_dict(arrays | change)
    with pytest.raises(lx.ParameterError, match="quats missing"):
        lx.Splats.from_dict({name: value for name, value in arrays.items() if name != "quats"})
    with pytest.raises(lx.ParameterError, match="space"):
        lx.Splats.from_dict(arrays, space="exp")  # type: ignore[arg-type]


def test_arrays_that_were_changed_are_checked_when_they_are_used(splats: lx.Splats, tmp_path: Path) -> None:
    changed = splats[:100]
    changed.means = np.zeros((100, 3), np.float64)
    lx.save(tmp_path / "a.ply", changed)
    assert not lx.load(tmp_path / "a.ply").means.any()
    changed.means = np.zeros((99, 3))
    with pytest.raises(lx.ParameterError, match="scales"):
        lx.save(tmp_path / "a.ply", changed)
    changed = splats[:100]
    changed.extras = {"x": np.zeros(100, np.complex64)}
    with pytest.raises(lx.ParameterError, match="extras"):
        lx.save(tmp_path / "a.ply", changed)


def test_gaussians_are_chosen_as_rows_of_arrays(splats: lx.Splats) -> None:
    assert len(splats[10:20]) == 10 and len(splats[-1]) == 1
    mask = splats.opacities > 2
    assert len(splats[mask]) == mask.sum()
    np.testing.assert_array_equal(splats[[3, 1]].means, splats.means[[3, 1]])
    assert "3,000 Gaussians, SH degree 3" in repr(splats)
    assert splats.nbytes == 3000 * 59 * 4


def test_a_scene_has_an_end(splats: lx.Splats) -> None:
    with pytest.raises(IndexError):
        splats[3000]
    assert len(list(splats[:3])) == 3


def test_strides_of_no_whole_floats_are_copied(tmp_path: Path) -> None:
    splats = make(50)
    records = np.zeros(50, [("x", "u1"), ("shN", "f4", (15, 3)), ("means", "f4", 3)])
    records["shN"], records["means"] = splats.shN, splats.means
    splats.shN, splats.means = records["shN"], records["means"]
    lx.save(tmp_path / "a.ply", splats)
    same(lx.load(tmp_path / "a.ply"), make(50))
    picture = np.zeros(20, [("x", "u1"), ("rows", "f4", (30, 3))])["rows"]
    assert lx.metrics.psnr(picture, picture.copy()) == float("inf")
