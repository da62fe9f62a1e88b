#!/usr/bin/env python3
"""What presets and targets give on real models, as Markdown tables.

    python3 benches/packed_models.py FOLDER [--skip-targets]

Packs every float model below and scores it on views that packing did not know: the test split of its
cameras, else an orbit of 12; 400 pixels wide. Builds lexisplat first.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

sys.dont_write_bytecode = True  # no __pycache__ in the working tree
from real_models import ROOT, lexisplat  # noqa: E402

# Model and its cameras.
MODELS = {"bonsai-3dgs": "bonsai", "bonsai-pixelgs": "bonsai", "snowmiku-mcmc": "snowmiku",
          "leica-brush": None, "fruit-drops": None}
PRESETS = ("small", "balanced", "high", "archive")
TARGETS = ("36", "40", "44")


def run(*arguments):
    return json.loads(lexisplat(*arguments, "--json", "--quiet"))


def packed(folder, name, options):
    """The report of `compress`, the score on held-out views, and resident SH bytes a Gaussian."""
    model = folder / f"{name}.ply"
    cameras = MODELS[name] and folder / f"{MODELS[name]}.cameras.json"
    views = ["--cameras", cameras, "--split", "test"] if cameras else ["--orbit", "12"]
    with tempfile.TemporaryDirectory() as temporary:
        small = f"{temporary}/s.lexi"
        report = run("compress", model, "-o", small, *options)
        score = run("compare", model, small, "--width", "400", *views)["psnr"]
        resident = run("info", small)["lexi"]["resident_sh_bytes_per_gaussian"]
    return report, score, resident


def main():
    folder = Path(sys.argv[1])
    subprocess.run(["cargo", "build", "--release", "-q"], cwd=ROOT, check=True)
    print("| model | Gaussians | preset | bytes a Gaussian | whole file | PSNR mean / min | nonzeros | SH bytes in memory | seconds |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name in MODELS:
        for preset in PRESETS:
            r, s, resident = packed(folder, name, ["--preset", preset])
            print(f"| {name} | {r['gaussians']:,} | {preset} | {r['file_bytes'] / r['gaussians']:.2f} | "
                  f"{r['ply_bytes'] / r['file_bytes']:.1f}x | {s['mean']:.2f} / {s['min']:.2f} | "
                  f"{r['mean_nonzeros']:.2f} | {resident:.1f} | {r['total_seconds']:.1f} |", flush=True)
    if "--skip-targets" in sys.argv:
        return
    print("\n| model | asked, dB | without cameras: reached, off, bytes a Gaussian | with cameras: reached, off, bytes a Gaussian |")
    print("|---|---|---|---|")
    for name, cameras in MODELS.items():
        for target in TARGETS:
            cells = []
            for options in ([], ["--cameras", folder / f"{cameras}.cameras.json"] if cameras else None):
                if options is None:
                    cells.append("-")
                    continue
                r, s, _ = packed(folder, name, ["--psnr", target, *options])
                cells.append(f"{s['mean']:.2f}, {s['mean'] - float(target):+.2f}, {r['file_bytes'] / r['gaussians']:.2f}")
            print(f"| {name} | {target} | " + " | ".join(cells) + " |", flush=True)


main()
