#!/usr/bin/env python3
"""The quality asked for beside the quality reached over views that were not there when a file was made.

    python3 benches/promise.py FOLDER [FOLDER ...] [--only NAME ...] [--asked 36 40 44] [--presets] [--guess]
        [--refine quick|thorough] [--binary LEXISPLAT] [--json FILE]

Every binary float PLY of the folders that has a `NAME.cameras.json` (NAME may be a prefix of the PLY's name), and
every PLY below 8000 Gaussians over an orbit, is compressed with `--psnr` to each asked quality: without cameras, and
with its training cameras where it has cameras. `--presets` adds the presets, whose aims are 35, 40, 45 and 54 dB, and
`--guess` the presets of `--guess`. `--refine` adds the same qualities with `compress --refine`.

The example `promise` of lexisplat-eval then scores each file against the original; see there for what views, pictures
and tiles are. Pictures are as wide as the cameras' own, which the model was trained at, 1,600 pixels at most, unless
TRAINED says otherwise; on the path they are drawn over white too, at half that width, and 400 pixels wide. The last columns compare
sizes at equal reached quality: bytes without cameras over bytes with, of a guess over bytes without cameras, or of a
refined file over bytes without refining, by the straight line between the logarithms of the bytes of neighbouring files.
"""

import argparse
import json
import math
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

sys.dont_write_bytecode = True  # no __pycache__ in the working tree
from rate_distortion import header  # noqa: E402
from real_models import ROOT  # noqa: E402

SMALL = 8000  # Gaussians; below that an orbit judges where there are no cameras
PRESETS = {"small": 35, "balanced": 40, "high": 45, "archive": 54}
WIDEST = 1600  # pixels; the trainer scales wider photos down
ORBIT = 400  # pixels, where there are no cameras
SMALL_WIDTH = 400  # pixels
# Widths of models whose cameras state the size of photos before training scaled them.
TRAINED = {"flowers-c3dgs-int8": 400}
KINDS = ("half", "quarter", "far", "above", "back")


def cameras_of(path):
    found = [c for c in path.parent.glob("*.cameras.json") if path.stem.startswith(c.name.removesuffix(".cameras.json"))]
    return max(found, key=lambda c: len(c.name), default=None)


def training(cameras, folder):
    """The cameras without the test views, which the split marks or which are every 8th by name."""
    views = sorted(json.loads(cameras.read_text()), key=lambda v: v["img_name"])
    if any(v.get("split") for v in views):
        kept = [v for v in views if v.get("split") != "test"]
    else:
        kept = [v for k, v in enumerate(views) if k % 8]
    file = Path(folder) / "training.cameras.json"
    file.write_text(json.dumps([{k: v for k, v in view.items() if k != "split"} for view in kept]))
    return file


def widths_of(model, cameras):
    """The width that the model was trained at, half of it, and a small one."""
    own = min(WIDEST, max(v["width"] for v in json.loads(cameras.read_text()))) if cameras else ORBIT
    own = TRAINED.get(model.stem, own)
    return [own, own // 2] + ([SMALL_WIDTH] if own // 2 > SMALL_WIDTH else [])


def bytes_at(points, decibels):
    """Bytes at a reached quality, between the two neighbouring (dB, bytes) points or beyond the last two."""
    points = sorted(points)
    if len(points) < 2:
        return None
    k = next((k for k in range(1, len(points) - 1) if points[k][0] >= decibels), len(points) - 1)
    (x0, y0), (x1, y1) = points[k - 1], points[k]
    if x1 - x0 < 1e-6:
        return None
    return math.exp(math.log(y0) + (decibels - x0) / (x1 - x0) * (math.log(y1) - math.log(y0)))


def measure(binary, scorer, model, count, args):
    cameras = cameras_of(model)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        ways = [("none", ["--no-cameras"])] + ([("given", ["--cameras", training(cameras, folder)])] if cameras else [])
        refined = [(f"{way}, {args.refine}", [*extra, "--refine", args.refine]) for way, extra in ways if args.refine]
        jobs = [(way, f"psnr {a:g}", a, [*extra, "--psnr", f"{a:g}"]) for way, extra in ways + refined for a in args.asked]
        if args.presets:
            jobs += [(way, name, aim, [*extra, "--preset", name]) for way, extra in ways for name, aim in PRESETS.items()]
        if args.guess:
            jobs += [("guess", name, aim, ["--guess", "--preset", name]) for name, aim in PRESETS.items()]
        files, made, seconds = [], [], []
        for number, job in enumerate(jobs):
            file = Path(folder) / f"{number}.lexi"
            before = processor_seconds()
            done = subprocess.run([binary, "compress", "--quiet", model, "-o", file, *job[3]], capture_output=True, text=True)
            if done.returncode:
                # The other files of a run of an hour still count.
                print(f"{model.name} {job[3]}: {done.stderr.strip()}", file=sys.stderr, flush=True)
                args.failed = True
                continue
            files.append(file)
            made.append(job)
            seconds.append(processor_seconds() - before)
        jobs = made
        sizes = [file.stat().st_size for file in files]
        widths = widths_of(model, cameras)
        at = ",".join(map(str, widths))
        scored = subprocess.check_output([scorer, model, cameras or "orbit", at, *files], text=True).splitlines()
        for (way, name, aim, _), size, cpu, line in zip(jobs, sizes, seconds, scored):
            row = {"scene": model.stem, "widths": widths, "gaussians": count, "cameras": way, "asked": name, "aim": aim}
            rows.append(row | json.loads(line) | {"bytes": size, "cpu_seconds": cpu})
    return rows


def processor_seconds():
    """CPU seconds of all programs that were waited for."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def table(rows):
    print("| scene | width | cameras | asked | reached | off | worst view | worst tile | over white | at half the width | at 400 | "
          + " | ".join(KINDS) + " | bytes each | ratio | CPU s |")
    print("|" + "---|" * (14 + len(KINDS)))
    points = {}
    for r in rows:
        if r["asked"].startswith("psnr"):
            points.setdefault((r["scene"], r["cameras"]), []).append((r["path"]["mean"], r["bytes"]))
    for r in rows:
        path = r["path"]
        off = [f"{r[k]['mean']:.1f}" if r[k] else "-" for k in KINDS]
        ratio = ""
        way, refined, _ = r["cameras"].partition(",")
        beside = (r["scene"], way if refined else {"none": "given", "guess": "none"}.get(way))
        if beside in points:
            other = bytes_at(points[beside], path["mean"])
            ratio = f"{r['bytes'] / other:.2f}" if other else ""
        smaller = [f"{r[f'path_{w}']['mean']:.2f}" for w in r["widths"][1:]] + ["-"]
        print(f"| {r['scene']} | {r['widths'][0]} | {r['cameras']} | {r['asked']} | {path['mean']:.2f} | {path['mean'] - r['aim']:+.2f} | "
              f"{path['worst']:.1f} | {path['worst_tile']:.1f} | {r['white']['mean']:.2f} | {smaller[0]} | {smaller[1]} | {' | '.join(off)} | {r['bytes'] / r['gaussians']:.2f} | {ratio} | {r['cpu_seconds']:.0f} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--only", nargs="+")
    parser.add_argument("--asked", nargs="+", type=float, default=[36, 40, 44])
    parser.add_argument("--presets", action="store_true")
    parser.add_argument("--guess", action="store_true")
    parser.add_argument("--refine")
    parser.add_argument("--binary", type=Path)
    parser.add_argument("--json", type=Path)
    parser.set_defaults(failed=False)
    args = parser.parse_args()
    build = ["cargo", "build", "--release", "-q", "-p", "lexisplat-eval", "--example", "promise"]
    subprocess.run(build, cwd=ROOT, check=True)
    if args.binary is None:
        subprocess.run(["cargo", "build", "--release", "-q", "-p", "lexisplat-cli"], cwd=ROOT, check=True)
    metadata = subprocess.check_output(["cargo", "metadata", "--format-version=1", "--no-deps"], cwd=ROOT)
    target = Path(json.loads(metadata)["target_directory"]) / "release"
    rows = []
    for model in sorted(m for folder in args.folders for m in folder.glob("*.ply")):
        found = header(model)
        if found is None or (args.only and model.stem not in args.only):
            continue
        count = found[1]
        if cameras_of(model) is None and count >= SMALL:
            continue
        rows += measure(args.binary or target / "lexisplat", target / "examples" / "promise", model, count, args)
        if args.json:
            args.json.write_text(json.dumps(rows, indent=1))
    table(rows)
    sys.exit(args.failed)


if __name__ == "__main__":
    main()
