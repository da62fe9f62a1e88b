"""Scenes of tiles on workers of Ray."""

from __future__ import annotations

import json
import os
import random
import resource
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import lexisplat as lx
import numpy as np
import pytest
from conftest import make

ray = pytest.importorskip("ray")
import lexisplat.ray  # noqa: E402
from lexisplat.ray import _compress  # noqa: E402

#: Gaussians of a tile. Four of them are more than one bucket.
TILE = 70_000
#: Options that make the tests fast.
FAST: dict[str, Any] = {"guess": True, "keep_order": True}


@pytest.fixture(scope="module", autouse=True)
def workers() -> Iterator[None]:
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False)
    yield
    ray.shutdown()


@pytest.fixture(scope="module")
def tiles(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("tiles")
    for k in range(4):
        splats = make(TILE, degree=1, seed=k)
        splats.means[:, 0] += 1.5 * k
        lx.save(folder / f"tile-{k}.ply", splats)
    return sorted(folder.iterdir())


@pytest.fixture(scope="module")
def expected(tiles: list[Path], program: str, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """What the program makes of the tiles."""
    made = tmp_path_factory.mktemp("expected") / "city.lexi"
    options = ["--guess", "--keep-order", "--quiet", "-o", str(made)]
    subprocess.run([program, "compress", *map(str, tiles), *options], check=True)
    return made.read_bytes()


def test_workers_make_the_bytes_of_the_program(tiles: list[Path], expected: bytes, tmp_path: Path) -> None:
    told: list[tuple[str, int, int]] = []
    out = tmp_path / "city.lexi"
    report = lexisplat.ray.compress(tiles, out, progress=lambda *report: told.append(report), **FAST)
    assert out.read_bytes() == expected
    assert report["gaussians"] == 4 * TILE and report["file_bytes"] == len(expected) and report["skipped"] == []
    assert report["output"] == str(out) and report["sensitivity"] == "guess"
    assert {"survey", "look", "learn", "code", "write"} <= {stage for stage, _, _ in told}
    assert all(0 <= done <= total for _, done, total in told)
    # Two bytes a Gaussian, and sums.
    traffic = report["traffic"]
    assert traffic["state"] < 2.2 * 4 * TILE and traffic["scattered"] == 0 and traffic["statistics"] < 4 << 20


def test_tiles_that_lie_all_over_the_scene_are_scattered(
    tiles: list[Path], expected: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_compress, "MOST_READ", 0.0)
    out = tmp_path / "city.lexi"
    report = lexisplat.ray.compress(tiles[0].parent, out, **FAST)
    assert out.read_bytes() == expected and report["traffic"]["scattered"] > 0


def test_one_large_file_is_as_by_the_program(tiles: list[Path], program: str, tmp_path: Path) -> None:
    parts = [lx.load(tile) for tile in tiles]
    order = np.random.default_rng(0).permutation(4 * TILE)
    arrays = {
        name: np.concatenate([getattr(part, name) for part in parts])[order]
        for name in ("means", "scales", "quats", "opacities", "sh0", "shN")
    }
    large, out, made = (tmp_path / name for name in ("large.ply", "by-ray.lexi", "by-program.lexi"))
    lx.save(large, lx.Splats(**arrays))
    lexisplat.ray.compress(large, out, guess=True)
    subprocess.run([program, "compress", large, "--guess", "-o", made, "--quiet"], check=True)
    assert out.read_bytes() == made.read_bytes()


@pytest.mark.skipif(sys.platform != "linux", reason="finds workers by /proc")
def test_a_killed_worker_changes_nothing(tiles: list[Path], expected: bytes, tmp_path: Path) -> None:
    def workers() -> list[int]:
        found = []
        for process in Path("/proc").glob("[0-9]*"):
            try:
                title = (process / "cmdline").read_bytes()
            except OSError:
                continue
            if title.startswith(b"ray::") and b"IDLE" not in title and b"Agent" not in title:
                found.append(int(process.name))
        return found

    def kill(over: threading.Event) -> None:
        time.sleep(random.uniform(0.0, 1.0))
        while not over.wait(0.01):
            if running := workers():
                os.kill(random.choice(running), signal.SIGKILL)
                killed.append(True)
                return

    killed: list[bool] = []
    # A run may be over before the moment comes.
    for _ in range(5):
        over = threading.Event()
        thread = threading.Thread(target=kill, args=(over,))
        thread.start()
        try:
            lexisplat.ray.compress(tiles, tmp_path / "city.lexi", overwrite=True, **FAST)
        finally:
            over.set()
            thread.join()
        assert (tmp_path / "city.lexi").read_bytes() == expected
        if killed:
            break
    assert killed


def test_one_file_each_has_the_dictionary_of_all(tiles: list[Path], tmp_path: Path) -> None:
    report = lexisplat.ray.compress(tiles, tmp_path / "each", one_each=True, **FAST)
    assert sorted(path.name for path in (tmp_path / "each").iterdir()) == [f"tile-{k}.lexi" for k in range(4)]
    scenes = [lx.open(own["output"]) for own in report["files"]]
    assert all(np.array_equal(scene.dictionary, scenes[0].dictionary) for scene in scenes)
    for scene, tile in zip(scenes, tiles):
        found, original = scene.decode(), lx.load(tile)
        assert np.abs(found.means - original.means).max() < 0.1


def test_a_small_scene_is_as_by_the_program(program: str, tmp_path: Path) -> None:
    small = [tmp_path / "a.ply", tmp_path / "b.ply"]
    for k, path in enumerate(small):
        lx.save(path, make(2000, seed=k))
    lexisplat.ray.compress(small, tmp_path / "by-ray.lexi", guess=True)
    made = tmp_path / "by-program.lexi"
    subprocess.run([program, "compress", *small, "--guess", "-o", made, "--quiet"], check=True)
    assert (tmp_path / "by-ray.lexi").read_bytes() == made.read_bytes()


def test_a_tile_has_the_quality_asked_for_and_is_refined(few: list[Path], tmp_path: Path) -> None:
    def packed(name: str, **options: Any) -> dict[str, Any]:
        # With one_each tasks work on the tile, though it is small.
        return lexisplat.ray.compress(few[1], tmp_path / name, one_each=True, **options)["files"][0]

    plain, coarse, refined = packed("plain", psnr=40), packed("coarse", psnr=32), packed("refined", psnr=40, refine=0.005)
    for less in (coarse, refined):
        assert less["file_bytes"] < plain["file_bytes"]
        assert less["gaussians"] + less["removed"] == 500 and len(lx.open(less["output"]).decode()) == less["gaussians"]
    assert plain["refined"] is None and refined["refined"]["gaussians"] >= refined["gaussians"]


@pytest.fixture
def few(tmp_path: Path) -> list[Path]:
    """Three small tiles, for what goes wrong."""
    paths = [tmp_path / "in" / f"{k}.ply" for k in range(3)]
    paths[0].parent.mkdir()
    for k, path in enumerate(paths):
        lx.save(path, make(500, seed=k))
    return paths


def spoil(path: Path, how: str) -> None:
    if how == "missing":
        path.unlink()
    elif how == "truncated":
        path.write_bytes(path.read_bytes()[:-1000])
    elif how == "nonsense":
        path.write_bytes(b"nonsense")
    elif how == "nan":
        header, end, rows = path.read_bytes().partition(b"end_header\n")
        path.write_bytes(header + end + np.float32(np.nan).tobytes() + rows[4:])
    elif how == "degree":
        lx.save(path, make(500, degree=2))
    else:
        header, end, _ = path.read_bytes().partition(b"end_header\n")
        path.write_bytes(header.replace(b"vertex 500", b"vertex 0") + end)


BAD = ["missing", "truncated", "nonsense", "nan", "degree", "empty"]


@pytest.mark.parametrize("how", BAD)
def test_a_bad_tile_is_named_and_nothing_is_written(few: list[Path], how: str, tmp_path: Path) -> None:
    spoil(few[1], how)
    with pytest.raises(lx.Error, match="1.ply") as caught:
        lexisplat.ray.compress(few, tmp_path / "city.lexi", **FAST)
    assert "Traceback" not in str(caught.value)
    assert not (tmp_path / "city.lexi").exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["in"]


def test_bad_tiles_are_left_out_where_asked(few: list[Path], tmp_path: Path) -> None:
    lexisplat.ray.compress([few[0], few[2]], tmp_path / "good.lexi", **FAST)
    spoiled = []
    for how in BAD:
        spoiled.append(few[0].with_name(f"bad-{how}.ply"))
        lx.save(spoiled[-1], make(500))
        spoil(spoiled[-1], how)
    given = [few[0], *spoiled[:3], few[2], *spoiled[3:]]
    report = lexisplat.ray.compress(given, tmp_path / "city.lexi", skip_bad=True, **FAST)
    assert sorted(own["tile"] for own in report["skipped"]) == sorted(map(str, spoiled))
    assert all(own["error"] for own in report["skipped"])
    assert (tmp_path / "city.lexi").read_bytes() == (tmp_path / "good.lexi").read_bytes()
    # A tile of another degree is good where none of the first degree is.
    without = [path for path in spoiled if "degree" not in path.name]
    with pytest.raises(lx.ParameterError, match="not skipped"):
        lexisplat.ray.compress(without, tmp_path / "none.lexi", skip_bad=True)


def test_names_of_outputs_are_checked_before_any_work(few: list[Path], tmp_path: Path) -> None:
    twin = tmp_path / "other" / few[0].name
    twin.parent.mkdir()
    lx.save(twin, make(500))
    for options, text in [
        ({"tiles": [few[0], twin], "out": tmp_path / "each", "one_each": True}, "a name of its own"),
        ({"tiles": few, "out": few[1], "overwrite": True}, "another file than the tiles"),
        ({"tiles": few, "out": few[1]}, "another file than the tiles"),
        ({"tiles": few, "out": tmp_path}, "the file to write"),
        ({"tiles": few, "out": few[1], "one_each": True}, "a folder"),
        ({"tiles": few, "out": tmp_path / "no" / "city.lexi"}, "a folder that is there"),
        ({"tiles": [few[0], few[0]], "out": tmp_path / "city.lexi"}, "each tile once"),
        ({"tiles": tmp_path / "*.nothing", "out": tmp_path / "city.lexi"}, "with tiles in it"),
        ({"tiles": few, "out": tmp_path / "city.lexi", "threads": 0}, "processors of the largest machine"),
        ({"tiles": few, "out": tmp_path / "city.lexi", "threads": 99}, "processors of the largest machine"),
        ({"tiles": few, "out": tmp_path / "city.lexi", "preset": "tiny"}, "preset"),
        ({"tiles": few, "out": tmp_path / "city.lexi", "tol": -1.0}, "tol = -1: a finite number above 0"),
        ({"tiles": few, "out": tmp_path / "city.lexi", "device": "auto"}, "cpu or gpu"),
        ({"tiles": few, "out": tmp_path / "city.lexi", "psnr": 0.0}, "psnr = 0: a finite number above 0"),
        ({"tiles": few, "out": tmp_path / "city.lexi", "psnr": 40, "preset": "small"}, "not together with preset"),
        ({"tiles": few, "out": tmp_path / "city.lexi", "refine": "slow"}, "quick, thorough"),
        ({"tiles": few, "out": tmp_path / "city.lexi", "refine": 1, "keep_all": True}, "not together with refine"),
        ({"tiles": few, "out": tmp_path / "city.lexi", "refine": 1, "guess": True}, "not together with guess"),
        ({"tiles": few, "out": tmp_path / "city.lexi", "limit": {"nonsense": 1}}, "nonsense"),
    ]:
        with pytest.raises(lx.ParameterError, match=text):
            lexisplat.ray.compress(**options)  # type: ignore[arg-type]
    there = tmp_path / "there.lexi"
    there.write_bytes(b"old")
    with pytest.raises(FileExistsError, match="overwrite=True"):
        lexisplat.ray.compress(few, there)
    assert there.read_bytes() == b"old"
    lexisplat.ray.compress(few, there, overwrite=True, **FAST)
    assert len(lx.open(there)) == 1500


def test_a_full_disk_leaves_nothing(tiles: list[Path], tmp_path: Path) -> None:
    """A limit on the size of files stands for the disk: the process that calls writes the file."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, hard))
    try:
        with pytest.raises(lx.IoError):
            lexisplat.ray.compress(tiles, tmp_path / "city.lexi", **FAST)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, handler)
    assert list(tmp_path.iterdir()) == []


def test_blocks_of_a_dataset_are_tiles(few: list[Path], tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    import ray.data

    names = ("means", "scales", "quats", "opacities", "sh0", "shN")
    rows = [{name: getattr(splats, name)[i] for name in names} for splats in map(lx.load, few) for i in range(500)]
    dataset = ray.data.from_items(rows, override_num_blocks=3)
    report = lexisplat.ray.compress(dataset, tmp_path / "city.lexi", **FAST)
    assert report["gaussians"] == 1500
    with pytest.raises(lx.ParameterError, match="with the columns means, scales"):
        lexisplat.ray.compress(ray.data.from_items([{"x": 1.0}]), tmp_path / "other.lexi")


def test_the_command_does_the_same(few: list[Path], tmp_path: Path) -> None:
    def run(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "lexisplat.ray", *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True)

    made = run(*few, "-o", tmp_path / "by-command.lexi", "--guess", "--keep-order", "--workers", "1", "--json", "-q")
    assert made.returncode == 0 and made.stderr == "", made.stderr
    assert json.loads(made.stdout)["gaussians"] == 1500
    lexisplat.ray.compress(few, tmp_path / "by-call.lexi", **FAST)
    assert (tmp_path / "by-command.lexi").read_bytes() == (tmp_path / "by-call.lexi").read_bytes()
    few[2].write_bytes(b"nonsense")
    failed = run(*few, "-o", tmp_path / "bad.lexi", "--workers", "1", "-q")
    assert failed.returncode == 4 and failed.stderr.startswith("error: ") and "2.ply" in failed.stderr, failed.stderr
    assert failed.stdout == "" and not (tmp_path / "bad.lexi").exists()
