#!/usr/bin/env python3
"""Frames of the processor's renderer from codes and from dense SH: the table of docs/results/codes_beside_dense.md.

    python3 benches/codes_beside_dense.py FOLDER [--threads 1] [--repeat 8] [--copies 8]

Needs Python alone. FOLDER has bonsai-3dgs.ply and room-large.ply with their cameras. Each model is compressed at tolerance
0.1 (layout f16) and packed at 40 dB with its cameras; then `lexisplat bench` draws it from codes and from dense SH, a frame of each in
turn, in the test views at the trained width. COPIES of room-large side by side are drawn from views around them.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

from real_models import ROOT, lexisplat

SETTINGS = (("tol 0.1", ["--tol", "0.1"]), ("40 dB", ["--psnr", "40"]))
# Views around the copies, as wide as those of the cameras.
AROUND = ["--views", "object", "--orbit", "4", "--width", "1200"]


def rows(scene, views, args):
    found = lexisplat("--threads", args.threads, "--quiet", "bench", scene, *views, "--device", "cpu",
                      "--warmup", "1", "--cpu-repeat", args.repeat, "--json")
    found = json.loads(found)
    codes, dense = (next(p for p in found["paths"] if p["path"] == name) for name in ("cpu-sparse", "cpu-dense"))
    return found, codes, dense


def spread(times):
    return f"{times['median']:.1f} ({times['p10']:.1f}, {times['p90']:.1f})"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--threads", default="1")
    parser.add_argument("--repeat", default="8")
    parser.add_argument("--copies", type=int, default=8)
    args = parser.parse_args()
    subprocess.run(["cargo", "build", "--release", "-q", "-p", "lexisplat-cli"], cwd=ROOT, check=True)
    print("| scene | Gaussians drawn of | file | nonzeros | frame from codes, ms | from dense SH, ms | project and colour, ms: codes, dense "
          "| speed of codes over dense: frame | project and colour | SH memory, bytes a Gaussian |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        tiled = folder / "tiled.ply"
        models = [("bonsai-3dgs", args.folder / "bonsai-3dgs.ply", args.folder / "bonsai.cameras.json"),
                  ("room-large", args.folder / "room-large.ply", args.folder / "room-large.cameras.json")]
        if args.copies:
            tile = [sys.executable, ROOT / "benches/tile.py", models[1][1], str(args.copies), tiled]
            subprocess.run(tile, check=True)
            models.append((f"room-large x {args.copies}", tiled, None))
        for name, model, cameras in models:
            for setting, options in SETTINGS:
                small = folder / "small.lexi"
                known = ["--cameras", cameras] if cameras and "--psnr" in options else []
                lexisplat("compress", model, "-o", small, *options, *known, "--overwrite", "--quiet")
                views = ["--cameras", cameras, "--split", "test"] if cameras else AROUND
                found, codes, dense = rows(small, views, args)
                stages = [times["stages"]["project"]["median"] for times in (codes, dense)]
                each = [times["sh_bytes"] / found["gaussians"] for times in (codes, dense)]
                print(f"| {name} | {codes['visible']:,.0f} of {found['gaussians']:,} | {setting} | {found['mean_nonzeros']:.2f} "
                      f"| {spread(codes['frame'])} | {spread(dense['frame'])} | {stages[0]:.1f}, {stages[1]:.1f} "
                      f"| {codes['fps'] / dense['fps']:.3f} | {stages[1] / stages[0]:.2f} | {each[0]:.1f}, {each[1]:.1f} |", flush=True)


if __name__ == "__main__":
    main()
