#!/usr/bin/env python3
"""Makes the tables of README and of docs/results anew, each in its place, with the date and the commit.

    python3 benches/tables.py FOLDER [--only NAME ...] [--list] [--binary LEXISPLAT]

A table stands between `<!-- table NAME -->` and `<!-- end of table -->`, and is replaced there. The tables of
docs/results/promise.md are in several sections, and are made by `benches/promise.py` alone. FOLDER has the models, as `shared/data`. Run it whenever a change alters the bytes of files or what they show.

`presets` is README's table: the whole file of each preset over the PLY, and the mean PSNR that `lexisplat compare` gives
over the test cameras, at most 1200 pixels wide, or over an orbit of 12 views of 480 pixels where a model has no cameras. `demo` is the
line on the demo's scene. Other tables are what their own scripts print.
"""

import argparse
import datetime
import json
import subprocess
import sys
import tempfile
from pathlib import Path

sys.dont_write_bytecode = True  # no __pycache__ in the working tree
from promise import PRESETS, SMALL, cameras_of  # noqa: E402
from rate_distortion import header  # noqa: E402
from real_models import ROOT  # noqa: E402

WIDTH = 1200  # pixels; the widest picture of a model's own cameras that quality is measured on
ORBIT = 12  # views of a model without cameras
ORBIT_WIDTH = 480  # pixels
DEMO = 2000  # Gaussians of the demo's scene, few enough for a test to make it again
HEADS = {"small": "small (35 dB)", "balanced": "balanced (40 dB, default)", "high": "high (45 dB)", "archive": "archive (54 dB)"}
FIRST = "room-large"  # the model of the size and resolution that people have


def run(*command):
    return subprocess.run([str(word) for word in command], check=True, capture_output=True, text=True).stdout


def reached(binary, model, file):
    """Mean PSNR of `file` against `model`."""
    cameras = cameras_of(model)
    given = ["--cameras", cameras, "--split", "test", "--width", WIDTH]
    views = given if cameras else ["--views", "object", "--orbit", ORBIT, "--width", ORBIT_WIDTH]
    told = run(binary, "compare", model, file, *views, "--device", "cpu", "--json", "--quiet")
    return json.loads(told)["psnr"]["mean"]


def presets(binary, folder):
    models = []
    for model in sorted(folder.glob("*.ply")):
        found = header(model)
        if found is not None and not (cameras_of(model) is None and found[1] >= SMALL):
            models.append((model, found[1]))
    rows = []
    for model, count in models:
        cells, misses = [], []
        for name, aim in PRESETS.items():
            with tempfile.TemporaryDirectory() as folder:
                file = Path(folder) / "scene.lexi"
                run(binary, "compress", "--quiet", model, "-o", file, "--preset", name)
                ratio, decibels = model.stat().st_size / file.stat().st_size, reached(binary, model, file)
            cells.append(f"{ratio:.1f}x, {decibels:.1f} dB")
            misses.append(abs(decibels - aim))
        print(model.stem, *cells, file=sys.stderr, flush=True)
        rows.append((model.stem != FIRST, -max(misses), f"| {model.stem} | {count:,} | {' | '.join(cells)} |"))
    lines = ["| model | Gaussians | " + " | ".join(HEADS[name] for name in PRESETS) + " |", "|---|---|" + "---|" * len(PRESETS)]
    return "\n".join(lines + [row for _, _, row in sorted(rows)])


def demo(binary, _):
    with tempfile.TemporaryDirectory() as folder:
        run(binary, "demo", "--gaussians", DEMO, "--output", Path(folder) / "demo", "--quiet")
        scene, file = (Path(folder) / "demo" / name for name in ("scene.ply", "scene.lexi"))
        size, decibels = file.stat().st_size, reached(binary, scene, file)
        ratio = scene.stat().st_size / size
    return f"`lexisplat demo --gaussians {DEMO}` makes a file of {size:,} bytes, {ratio:.1f} times smaller than the PLY, of {decibels:.1f} dB."


def script(*words):
    """The table that a script of this folder prints."""
    return lambda binary, folder: run(sys.executable, ROOT / "benches" / words[0], folder, *words[1:]).strip()


TABLES = {
    "presets": (ROOT / "README.md", presets),
    "demo": (ROOT / "README.md", demo),
    "prefixes": (ROOT / "docs/results/prefixes.md", script("prefixes.py")),
}


def replace(path, name, text):
    whole = path.read_text()
    begin, end = f"<!-- table {name} -->\n", "<!-- end of table -->"
    before, rest = whole.split(begin)
    _, after = rest.split(end, 1)
    commit = run("git", "-C", ROOT, "rev-parse", "--short", "HEAD").strip()
    told = f"(`python3 benches/tables.py FOLDER --only {name}`, {datetime.date.today()}, commit {commit}.)"
    path.write_text(f"{before}{begin}{text}\n\n{told}\n{end}{after}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="+", choices=TABLES)
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--binary", type=Path)
    args = parser.parse_args()
    if args.list:
        print("\n".join(f"{name}: {path.relative_to(ROOT)}" for name, (path, _) in TABLES.items()))
        return
    if args.binary is None:
        subprocess.run(["cargo", "build", "--release", "-q", "-p", "lexisplat-cli"], cwd=ROOT, check=True)
        metadata = run("cargo", "metadata", "--format-version=1", "--no-deps", "--manifest-path", ROOT / "Cargo.toml")
        args.binary = Path(json.loads(metadata)["target_directory"]) / "release" / "lexisplat"
    for name in args.only or TABLES:
        path, make = TABLES[name]
        replace(path, name, make(args.binary, args.folder))


if __name__ == "__main__":
    main()
