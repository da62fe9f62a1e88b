"""Compression, and what is done with the result."""

from __future__ import annotations

import copy
import dataclasses
import json
import os
import pickle
import signal
import subprocess
import threading
import time
from pathlib import Path
from typing import Any

import lexisplat as lx
import numpy as np
import pytest
from conftest import make, of_inria


#: A first view, as a link of a viewer has it.
VIEW = "0.5:-1:-4:0:0:0:1:4:1.25"


@pytest.mark.parametrize(
    ("arguments", "options"),
    [
        (["--preset", "small", "--keep-order"], {"preset": "small", "keep_order": True}),
        (["--guess", "--lod"], {"guess": True, "lod": True}),
        (["--psnr", "30", "--max-gaussians", "900"], {"psnr": 30, "max_gaussians": 900}),
        (["--psnr", "25", "--refine", "0.01"], {"psnr": 25, "refine": 0.01}),
        (["--ratio", "12", "--atoms", "40", "--seed", "7"], {"ratio": 12, "atoms": 40, "seed": 7}),
        (["--guess"], {"guess": True}),
        (["--tol", "0.05"], {"tol": 0.05}),
        (["--layout", "paper", "--pursuit", "omp"], {"layout": "paper", "pursuit": "omp"}),
        (["--max-nonzeros", "3"], {"max_nonzeros": 3}),
        (["--views", "object", "--view", VIEW], {"views": "object", "view": VIEW}),
    ],
)
def test_the_bytes_are_those_of_the_program(
    arguments: list[str], options: dict[str, Any], views: list[lx.Camera], program: str, tmp_path: Path
) -> None:
    path, made = tmp_path / "scene.ply", tmp_path / "by-program.lexi"
    lx.save(path, make(1000))
    if {"preset", "psnr", "ratio"} & set(options):
        file = tmp_path / "cameras.json"
        file.write_text(json.dumps([of_inria(view) for view in views]))
        arguments, options = [*arguments, "--cameras", str(file)], {**options, "cameras": file}
    subprocess.run([program, "compress", path, "-o", made, "--quiet", *arguments], check=True)
    by_program = made.read_bytes()
    assert lx.compress(path, **options).to_bytes() == by_program
    if "ratio" not in options:
        assert lx.compress(lx.load(path), **options).to_bytes() == by_program


def test_the_first_view_is_chosen_given_or_none(splats: lx.Splats) -> None:
    assert lx.compress(splats, tol=0.2).view is not None
    assert lx.compress(splats, tol=0.2, view=f"https://a.b/#view={VIEW}&mode=first").view == VIEW
    assert lx.compress(splats, tol=0.2, view=None).view is None
    with pytest.raises(lx.ParameterError, match="view"):
        lx.compress(splats, tol=0.2, view="1:2:3")


def test_a_scene_tells_of_itself(packed: lx.Scene, splats: lx.Splats) -> None:
    assert packed.degree == 3 and packed.layout == "packed" and 0 < len(packed) <= len(splats)
    assert packed.nbytes == len(packed.to_bytes()) < splats.nbytes / 8
    report, opened = packed.report, lx.open(packed.to_bytes(), name="a")
    assert report is not None and report["file_bytes"] == packed.nbytes and opened.report is None
    for scene in (packed, opened):
        assert sum(scene.nbytes_by_part.values()) == pytest.approx(packed.nbytes)
        assert scene.nbytes_by_part["position"] > 0
    info = opened.info
    assert info["gaussians"] == len(packed) and info["reached"]["judged_psnr"] > 36 and info["version"] == 3
    assert "bytes" in repr(packed)


def test_codes_rebuild_the_dense_scene_within_the_tolerance(splats: lx.Splats) -> None:
    scene = lx.compress(splats, tol=0.03)
    codes, atoms = scene.codes(), scene.dictionary
    np.testing.assert_allclose(np.linalg.norm(atoms, axis=1), 1, atol=1e-5)
    rows = np.repeat(np.arange(len(scene)), np.diff(codes.indptr))
    built = np.zeros((len(scene), 45))
    np.add.at(built, rows, codes.values[:, None].astype(np.float64) * atoms[codes.indices])
    built[codes.escapes] = codes.escape_rows
    decoded, original = (s.shN.transpose(0, 2, 1).reshape(-1, 45) for s in (scene.decode(), splats))
    np.testing.assert_allclose(built, decoded, atol=1e-5)
    errors = np.linalg.norm(decoded.astype(np.float64) - original, axis=1)
    assert errors.max() <= 0.03 and errors.max() == pytest.approx(scene.info["record"]["max_residual"], rel=1e-6)
    np.testing.assert_array_equal(scene.decode().means, splats.means)
    pytest.importorskip("scipy")
    assert codes.to_scipy(len(atoms)).shape == (len(splats), 90)


def test_a_given_dictionary_is_used(splats: lx.Splats, tmp_path: Path) -> None:
    first = lx.compress(splats, tol=0.1)
    path = tmp_path / "first.lexi"
    first.save(path)
    for dictionary in (first.dictionary, path, path.read_bytes()):
        scene = lx.compress(splats, tol=0.1, dictionary=dictionary)
        np.testing.assert_array_equal(scene.dictionary, first.dictionary)
    with pytest.raises(lx.ParameterError, match="dictionary"):
        lx.compress(splats, tol=0.1, dictionary=np.eye(44, dtype=np.float32))


def test_chunks_are_the_scene(tmp_path: Path) -> None:
    splats = make(70_000, degree=1)
    scene = lx.compress(splats, guess=True)
    at, parts = 0, []
    for start, part in scene.chunks():
        assert start == at
        at += len(part)
        parts.append(part.means)
    assert len(parts) > 1
    np.testing.assert_array_equal(np.concatenate(parts), scene.decode().means)
    # An iterator that is left early ends its thread.
    threads = threading.active_count()
    next(scene.chunks())
    assert threading.active_count() == threads


def test_cameras_beside_a_file_are_used(views: list[lx.Camera], program: str, tmp_path: Path) -> None:
    path, made = tmp_path / "scene.ply", tmp_path / "by-program.lexi"
    lx.save(path, make(1000))
    file = tmp_path / "cameras.json"
    file.write_text(json.dumps([of_inria(view) for view in views]))
    given, without = (lx.compress(path, cameras=cameras).to_bytes() for cameras in (file, None))
    assert given != without
    assert lx.compress(path).to_bytes() == lx.compress(str(path), cameras="auto").to_bytes() == given
    subprocess.run([program, "compress", path, "-o", made, "--quiet"], check=True)
    assert made.read_bytes() == given
    # Nothing lies beside arrays and bytes.
    assert lx.compress(lx.load(path)).to_bytes() == lx.compress(path.read_bytes()).to_bytes() == without
    assert lx.compress(path, views="object").to_bytes() not in (given, without)
    # Cameras from which nothing shows are not those of the scene.
    away = [dataclasses.replace(view, position=view.position * 40) for view in views]
    file.write_text(json.dumps([of_inria(view) for view in away]))
    with pytest.warns(lx.LexisplatWarning, match="do not seem to belong to the scene"):
        assert lx.compress(path).to_bytes() == without


def test_the_order_is_kept_if_asked(splats: lx.Splats, views: list[lx.Camera]) -> None:
    scene = lx.compress(splats, cameras=views, keep_order=True)
    assert scene.info["order_kept"] and len(scene) == len(splats)
    np.testing.assert_allclose(scene.decode().means, splats.means, atol=0.02)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"psnr": 40, "size": 1000}, "size = given: not together with psnr"),
        ({"guess": True, "psnr": 40}, "psnr = given: not together with guess"),
        ({"views": "room", "cameras": []}, "views = given: not together with cameras"),
        ({"layout": "packed", "max_nonzeros": 3}, "layout = packed: f16, f32 or paper, which max_nonzeros is for"),
        ({"layout": "f32", "psnr": 40}, "layout = f32: packed, which psnr is for"),
        ({"preset": "tiny"}, "preset = tiny: one of small"),
        ({"views": "sea"}, "views = sea: auto, object or room"),
        ({"size": "2 furlongs"}, "size = 2 furlongs: bytes, as"),
        ({"max_nonzeros": 300}, "max_nonzeros = 300: a whole number, 0 to 255"),
        ({"seed": -1}, "seed = -1"),
        ({"atoms": 2.5}, "atoms = 2.5"),
        ({"limit": {"splats": 1}}, "limit = splats"),
        ({"psnr": -1}, "psnr = -1"),
        ({"psnr": float("nan")}, "psnr = NaN"),
        ({"tol": 0}, "tol = 0"),
        ({"atoms": 5000}, "atoms = 5000: 1 to 1024"),
        ({"device": "tpu"}, "device = tpu"),
        ({"cameras": []}, "cameras"),
        ({"size": 10}, "size"),
    ],
)
def test_choices_that_cannot_be_met_are_named(splats: lx.Splats, options: dict[str, Any], text: str) -> None:
    with pytest.raises(lx.ParameterError) as refused:
        lx.compress(splats, **options)
    assert text in str(refused.value)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"psnr": "forty"}, "psnr = forty (str): a number"),
        ({"preset": 5}, "preset = 5 (int): text"),
        ({"keep_order": "yes"}, "keep_order = yes (str): True or False"),
        ({"size": [1]}, "size = [1] (list): bytes"),
        ({"atoms": "90"}, "atoms = 90 (str): a whole number"),
        ({"cameras": 3}, "cameras = 3 (int): a Camera"),
        ({"cameras": [3]}, "cameras[0] = 3 (int): a Camera"),
        ({"limit": 5}, "limit = 5 (int): a dict"),
        ({"memory": None}, "memory = a NoneType: bytes"),
        ({"progress": 1}, "progress = 1 (int): True"),
        ({"dictionary": object()}, "dictionary = a object: an array of numbers"),
        ({"prset": "small"}, "compress has no option prset; did you mean preset?"),
        ({"zzz": 1}, "compress has no option zzz: it has scene, preset"),
    ],
)
def test_types_and_names_are_refused_before_any_work(options: dict[str, Any], text: str, tmp_path: Path) -> None:
    # There is no file, so a look for it would raise another error.
    with pytest.raises(lx.WrongTypeError) as refused:
        lx.compress(tmp_path / "none.ply", **options)
    assert text in str(refused.value)
    assert isinstance(refused.value, TypeError) and isinstance(refused.value, lx.ParameterError)


def test_checkpoints_refuse_options_when_they_are_chosen() -> None:
    with pytest.raises(lx.WrongTypeError, match="LexiCompression has no option prset; did you mean preset"):
        lx.LexiCompression(prset="small")
    with pytest.raises(TypeError, match="psnr = forty"):
        lx.LexiCompression(psnr="forty")


def test_arguments_of_other_functions_are_checked_too(splats: lx.Splats, views: list[lx.Camera], tmp_path: Path) -> None:
    cases: list[tuple[Any, str]] = [
        (lambda: lx.save(splats, "x.lexi"), "save(path, scene) takes the path first"),
        (lambda: lx.save(lx.compress(splats, guess=True), tmp_path / "x.lexi"), "takes the path first"),
        (lambda: lx.render(views[0], splats), "render(scene, camera) takes the scene first"),
        (lambda: lx.LexiCompression().compress(splats.to_dict(), tmp_path), "takes the folder first"),
        (lambda: lx.load(3), "source = 3 (int): a path, the bytes of a file, or a file object"),
        (lambda: lx.load("a.ply", contigous=True), "load has no option contigous; did you mean contiguous?"),
        (lambda: lx.open("a.lexi", name=b"a"), "name = b'a' (bytes): text"),
        (lambda: lx.save("a.spz", splats, sh_bits=5), "sh_bits = 5 (int): 2 values"),
        (lambda: lx.render(splats, views[0], background="red"), "background = red: 3 values"),
        (lambda: lx.orbit(splats, "3"), "count = 3 (str): a whole number"),
        (lambda: lx.compare(splats, "a.ply"), "b = a.ply (str): Splats or a Scene"),
        (lambda: lx.Camera("800", 600, 1, 1, [0] * 3, np.eye(3)), "width = 800 (str): a whole number"),
        (lambda: lx.DictionaryLearner(atoms=3), "DictionaryLearner has no option atoms"),
        (lambda: lx.DictionaryLearner(tol="1").fit(np.eye(4)), "tol = 1 (str): a number"),
        (lambda: lx.metrics.psnr(np.zeros((2, 2, 3)), "a.png"), "picture b = an array of"),
        (lambda: lx.Splats.from_dict("a.ply"), "arrays = a.ply (str): a dict of arrays"),
        (lambda: lx.Splats.from_dict(splats.to_dict() | {"quats": "none"}), "quats = none (str): an array of numbers"),
    ]
    for call, text in cases:
        with pytest.raises(lx.ParameterError) as refused:
            call()
        assert text in str(refused.value)


def test_sizes_are_told_in_many_ways(splats: lx.Splats, views: list[lx.Camera]) -> None:
    part = splats[:400]
    made = [lx.compress(part, size=size, cameras=views) for size in (12_000, 12e3, "12kB", np.int64(12_000))]
    assert made[0].nbytes <= 12_000 and all(scene == made[0] for scene in made)
    assert lx.load(made[0].to_bytes(), limit={"bytes": "1GB", "gaussians": 1e6}).degree == 3
    with pytest.raises(lx.LimitError):
        lx.load(made[0].to_bytes(), limit={"bytes": "1kB"})


def test_scenes_are_copied_pickled_and_compared(packed: lx.Scene, splats: lx.Splats, tmp_path: Path) -> None:
    packed.save(tmp_path / "a.lexi")
    opened = lx.open(tmp_path / "a.lexi", limit={"gaussians": 5000})
    for scene in (packed, opened):
        for again in (copy.copy(scene), copy.deepcopy(scene), pickle.loads(pickle.dumps(scene))):
            assert again == scene and hash(again) == hash(scene) and again is not scene
            assert again.report == scene.report and again.to_bytes() == scene.to_bytes()
            np.testing.assert_array_equal(again.decode().means, scene.decode().means)
    other = lx.compress(splats[:500], guess=True)
    assert packed == opened and packed != other and packed != packed.to_bytes() and len({packed, opened, other}) == 2


def test_what_is_compressed_is_not_compressed_again(packed: lx.Scene) -> None:
    with pytest.raises(lx.FormatError, match="compressed already"):
        lx.compress(packed.to_bytes())


def test_values_that_are_not_finite_are_refused(splats: lx.Splats) -> None:
    wrong = splats[:]
    wrong.shN = wrong.shN.copy()
    wrong.shN[3, 2, 1] = np.inf
    with pytest.raises(lx.ParameterError, match="finite"):
        lx.compress(wrong, guess=True)


def test_progress_is_told_stage_by_stage(splats: lx.Splats, views: list[lx.Camera]) -> None:
    told: list[tuple[str, int, int]] = []
    lx.compress(splats, cameras=views, psnr=30, refine=0.001, progress=lambda *report: told.append(report))
    stages = [stage for stage, done, _ in told if done == 0]
    assert {"draw", "code", "write"} <= set(stages)
    for stage in set(stages):
        assert any(done == total for name, done, total in told if name == stage), stage
    # Views are drawn as a part of looking, which goes on after them.
    start = next(k for k, (stage, *_) in enumerate(told) if stage == "look")
    end = next(k for k, (stage, done, total) in enumerate(told) if k > start and stage == "look" and done == total)
    assert "draw" in {stage for stage, *_ in told[start:end]}


def test_a_callback_that_raises_ends_the_work(splats: lx.Splats) -> None:
    def refuse(stage: str, done: int, total: int) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        lx.compress(splats, progress=refuse)


def test_tqdm_shows_progress(splats: lx.Splats, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("tqdm")
    lx.compress(splats, guess=True, progress=True)
    assert "code" in capsys.readouterr().err


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_ctrl_c_ends_the_work() -> None:
    splats = make(60_000)
    # Where the tests run in the background the signal is ignored.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    timer = threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    begin = time.monotonic()
    try:
        with pytest.raises(KeyboardInterrupt):
            lx.compress(splats, psnr=50)
    finally:
        signal.signal(signal.SIGINT, before)
    # It would take far longer than the wait for the next check.
    assert time.monotonic() - begin < 30


def test_other_threads_run_meanwhile(splats: lx.Splats) -> None:
    done = threading.Event()
    counted = 0

    def count() -> None:
        nonlocal counted
        while not done.is_set():
            counted += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    lx.compress(splats)
    done.set()
    thread.join()
    assert counted > 20
