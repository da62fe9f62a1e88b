"""Files of every format, and what is said of wrong ones."""

from __future__ import annotations

import io
import os
import pickle
import subprocess
import sys
from pathlib import Path

import lexisplat as lx
import numpy as np
import pytest
from conftest import make


@pytest.mark.parametrize("extension", ["ply", "spz", "sog", "compressed.ply", "splat", "glb"])
def test_every_format_is_written_and_read(extension: str, splats: lx.Splats, tmp_path: Path) -> None:
    path = tmp_path / f"scene.{extension}"
    lost = lx.save(path, splats)
    read = lx.load(path)
    assert len(read) == len(splats)
    assert read.degree == (0 if extension == "splat" else 3)
    assert lost["sh_degree"] == ([3, 0] if extension == "splat" else None)
    # Formats may change the order: the scene as a whole is where it was.
    np.testing.assert_allclose(read.means.mean(0), splats.means.mean(0), atol=1e-2)
    if extension != "sog":
        again = lx.load(path.read_bytes(), name="again")
        np.testing.assert_array_equal(read.means, again.means)


def test_an_offset_is_kept_and_put_back(tmp_path: Path) -> None:
    offset = np.array([500_000.0, 4_649_776.0, -128.0])
    splats = make(200)
    splats.offset = offset
    world = splats.means.astype(np.float64) + offset
    lost = lx.save(tmp_path / "a.ply", splats)
    with pytest.warns(lx.LexisplatWarning, match="kept relative"):
        read = lx.load(tmp_path / "a.ply")
    assert lost["offset"] is None
    assert read.offset is not None
    assert read.means.dtype == np.float32
    np.testing.assert_allclose(read.means + read.offset, world, atol=1e-6)
    scene = lx.compress(read, layout="f32")
    np.testing.assert_array_equal(scene.offset, read.offset)
    np.testing.assert_array_equal(scene.decode()[:9].offset, read.offset)
    lost = lx.save(tmp_path / "a.spz", read)
    assert lost["offset"] == read.offset.tolist()
    views = lx.orbit(read, 2, width=32, height=32)
    assert abs(views[0].position[0] - offset[0]) < 100
    assert views[0].relative_to(read.offset).near == views[0].near != lx.Camera.near
    near = make(200)
    pictures = lx.render(near, [view.relative_to(read.offset) for view in views])
    for far, picture in zip(lx.render(read, views), pictures, strict=True):
        assert np.abs(far - picture).mean() < 0.05


def test_golden_files_are_read(golden: Path) -> None:
    for path in sorted(golden.glob("*.lexi")):
        scene = lx.open(path) if "dictionary" not in path.name else None
        if scene is not None:
            assert len(scene.decode()) == len(scene) == len(lx.load(path)), path.name


def test_lexi_is_a_format_too(splats: lx.Splats, packed: lx.Scene, tmp_path: Path) -> None:
    assert lx.save(tmp_path / "a.lexi", packed) == {}
    assert (tmp_path / "a.lexi").read_bytes() == packed.to_bytes()
    assert len(lx.load(tmp_path / "a.lexi")) == len(packed)
    made = make(3000)
    made.normals = np.ones((3000, 3), np.float32)
    lost = lx.save(tmp_path / "b.lexi", made)
    assert lost["removed"] == 3000 - len(lx.load(tmp_path / "b.lexi")) and lost["normals"] and lost["precision"]
    assert lx.load(tmp_path / "b.lexi").normals is None and lost["extras"] == [] and lost["sh_degree"] is None
    lx.save(tmp_path / "a.ply", packed)
    np.testing.assert_array_equal(lx.load(tmp_path / "a.ply").means, packed.decode().means)


def test_options_of_formats(splats: lx.Splats, tmp_path: Path) -> None:
    sizes = []
    for bits in [(5, 4), (8, 8)]:
        lx.save(tmp_path / "a.spz", splats, sh_bits=bits)
        sizes.append((tmp_path / "a.spz").stat().st_size)
    assert sizes[0] < sizes[1]
    lx.save(tmp_path / "a", splats, format="spz", spz_version=2)
    assert (tmp_path / "a").read_bytes()[:2] == b"\x1f\x8b"
    with pytest.raises(lx.ParameterError, match="spz_version|version"):
        lx.save(tmp_path / "a.spz", splats, spz_version=9)
    with pytest.raises(lx.ParameterError, match="format"):
        lx.save(tmp_path / "a.ksplat", splats)
    with pytest.raises(lx.ParameterError, match="format"):
        lx.save(tmp_path / "a.txt", splats)
    for wrong in ({"path": tmp_path / "a.GLTF"}, {"path": tmp_path / "a", "format": "gltf"}):
        with pytest.raises(lx.ParameterError, match="glTF is written as one file, .glb"):
            lx.save(scene=splats, **wrong)  # type: ignore[arg-type]
    assert sorted(os.listdir(tmp_path)) == ["a", "a.spz"]


def test_files_appear_whole_and_are_kept_if_asked(splats: lx.Splats, tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(b"mine")
    with pytest.raises(FileExistsError) as refused:
        lx.save(path, splats, overwrite=False)
    assert isinstance(refused.value, lx.IoError) and refused.value.filename == str(path)
    assert path.read_bytes() == b"mine"
    with pytest.raises(lx.ParameterError):
        lx.save(path, splats[:0], format="glb")
    assert path.read_bytes() == b"mine" and os.listdir(tmp_path) == ["a.ply"]
    lx.save(path, splats)
    assert len(lx.load(path)) == len(splats)


def test_missing_and_wrong_files_are_told_apart(tmp_path: Path, packed: lx.Scene) -> None:
    with pytest.raises(FileNotFoundError) as missing:
        lx.load(tmp_path / "none.ply")
    assert missing.value.errno == 2 and missing.value.filename.endswith("none.ply")
    assert isinstance(missing.value, lx.Error) and type(missing.value).__name__ == "IoError"
    with pytest.raises(lx.FormatError) as wrong:
        lx.load(b"not a scene", name="mine")
    assert wrong.value.file == "mine" and isinstance(wrong.value, ValueError)
    with pytest.raises(lx.FormatError, match="truncated"):
        lx.open(packed.to_bytes()[:-1])
    damaged = bytearray(packed.to_bytes())
    damaged[-5] ^= 1
    with pytest.raises(lx.FormatError, match="checksum"):
        lx.load(bytes(damaged))
    with pytest.raises(IsADirectoryError if os.name == "posix" else OSError):
        lx.load(tmp_path)


def test_limits_are_kept(ply: Path, packed: lx.Scene) -> None:
    with pytest.raises(lx.LimitError, match="1000"):
        lx.load(ply, limit={"gaussians": 1000})
    with pytest.raises(lx.LimitError):
        lx.open(packed.to_bytes(), limit={"atoms": 1})
    with pytest.raises(lx.ParameterError, match="limit = splats"):
        lx.load(ply, limit={"splats": 1})


def test_invalid_gaussians_are_refused_or_left_out(tmp_path: Path) -> None:
    path, splats = tmp_path / "a.ply", make(100)
    splats.means[7, 1] = 1234.5
    lx.save(path, splats)
    whole = path.read_bytes()
    path.write_bytes(whole.replace(np.float32(1234.5).tobytes(), np.float32(np.nan).tobytes()))
    with pytest.raises(lx.FormatError, match="number 7 .*drop_invalid=True leaves such"):
        lx.load(path)
    with pytest.warns(lx.LexisplatWarning):
        assert len(lx.load(path, drop_invalid=True)) == 99
    splats.means[7, 1] = np.nan
    splats.shN = splats.shN.copy()
    splats.shN[3, 2, 1] = np.inf
    advice = "inf of Gaussian 3: finite values; 2 of 100 .*drop_invalid=True leaves such"
    for name in ("b.ply", "b.spz", "b.lexi"):
        with pytest.raises(lx.ParameterError, match=advice) as refused:
            lx.save(tmp_path / name, splats)
        assert refused.value.name == "shN" and not (tmp_path / name).exists()
    with pytest.warns(lx.LexisplatWarning, match="dropped 2 of 100"):
        lx.save(tmp_path / "b.ply", splats, drop_invalid=True)
    assert len(lx.load(tmp_path / "b.ply")) == 98
    with pytest.warns(lx.LexisplatWarning, match="dropped 2 of 100"):
        assert len(lx.compress(splats, guess=True, keep_all=True, drop_invalid=True)) == 98
    splats.opacities[:] = np.nan
    with pytest.raises(lx.ParameterError, match="none is left"):
        lx.save(tmp_path / "c.ply", splats, drop_invalid=True)


def test_errors_can_be_pickled(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError) as missing:
        lx.load(tmp_path / "none.ply")
    again = pickle.loads(pickle.dumps(missing.value))
    assert type(again) is type(missing.value) and again.filename == missing.value.filename


@pytest.mark.skipif(os.name != "posix", reason="fork")
def test_a_forked_process_is_told_to_be_spawned(ply: Path) -> None:
    script = """
import os, sys, lexisplat as lx
lx.load(sys.argv[1])
child = os.fork()
if child == 0:
    try: lx.load(sys.argv[1])
    except RuntimeError as error: os._exit(0 if "spawn" in str(error) else 1)
    os._exit(2)
assert os.waitpid(child, 0)[1] == 0
"""
    subprocess.run([sys.executable, "-W", "ignore", "-c", script, ply], check=True, timeout=60)


@pytest.mark.parametrize("kind", ["ply", "lexi", "sog"])
def test_bytes_and_file_objects_are_read(kind: str, packed: lx.Scene, tmp_path: Path) -> None:
    path = tmp_path / f"a.{kind}"
    lx.save(path, packed)
    expected, data = lx.load(path), path.read_bytes()
    with path.open("rb") as file:
        sources = [data, bytearray(data), memoryview(data), io.BytesIO(data), file]
        for source in sources:
            np.testing.assert_array_equal(lx.load(source).means, expected.means)
    with path.open("rb") as file:
        if kind == "lexi":
            assert lx.open(file) == packed and lx.open(io.BytesIO(data)).to_bytes() == data
        else:
            assert lx.compress(file, guess=True) == lx.compress(path, guess=True)
    (tmp_path / "wrong").write_bytes(b"no scene")
    with (tmp_path / "wrong").open("rb") as file, pytest.raises(lx.FormatError) as wrong:
        lx.load(file)
    assert wrong.value.file == str(tmp_path / "wrong")
    with (tmp_path / "wrong").open("r") as file, pytest.raises(lx.ParameterError, match='mode "rb"'):
        lx.load(file)  # type: ignore[arg-type]


def test_what_is_no_scene_is_named(splats: lx.Splats, tmp_path: Path) -> None:
    for wrong in (lambda: lx.save(tmp_path / "a.ply", splats.to_dict()), lambda: lx.compress(splats.to_dict())):
        with pytest.raises(TypeError, match="Splats.from_dict") as refused:
            wrong()
        assert isinstance(refused.value, lx.Error)


def test_the_command_for_ray_says_in_one_line_that_ray_is_missing(tmp_path: Path) -> None:
    script = """
import sys
sys.modules["ray"] = None
from lexisplat.ray._command import main
sys.exit(main(["a.ply", "-o", "b.lexi"]))
"""
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, cwd=tmp_path)
    assert ended.returncode == 1 and ended.stdout == ""
    assert ended.stderr == 'error: lexisplat.ray needs Ray: pip install "lexisplat[ray]"\n'
