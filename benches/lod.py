#!/usr/bin/env python3
"""A flight through a scene of many millions of Gaussians within a budget, against all Gaussians drawn.

    python3 benches/lod.py MODEL.ply CAMERAS.json FOLDER [--copies 66] [--views 100] [--budget 1000000 ...] [--width 640]
        [--binary LEXISPLAT]

Copies of the model, without what lies beyond the others, are packed with `compress --guess`, with `--lod` and without.
The path goes through all copies in turn, from the
model's cameras moved along. `render` draws its views of the whole file, and `render --budget` within each budget. For
each budget there are: Gaussians drawn, bytes read for a view and held, PSNR of the 8-bit pictures, and the largest
memory of the process, with the pages of the file that it has mapped. Needs NumPy and Pillow. FOLDER keeps the scenes,
and what is there is not made again.
"""

import argparse
import json
import sys
from pathlib import Path

import numpy as np
from PIL import Image

sys.dont_write_bytecode = True  # no __pycache__ in the working tree
from real_models import ROOT  # noqa: E402
from sizes import run  # noqa: E402


def tile(model, copies, target):
    """Return how far apart copies of a model are in x and z, and write them to the target if there is one.

    Of each axis a copy holds the middle 90 percent, and of these no Gaussian larger than an eighth of its width. So few
    Gaussians reach into another copy, where they would hide what is seen there.
    """
    data = model.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    lines = data[:end].decode().splitlines()
    names = [line.split()[2] for line in lines if line.startswith("property float ")]
    rows = np.frombuffer(data[end:], "<f4").reshape(-1, len(names))
    columns, size = ([names.index(f"{stem}{k}") for k in of] for stem, of in (("", "xyz"), ("scale_", "012")))
    least, most = np.quantile(rows[:, columns], [0.05, 0.95], axis=0)
    sides = (most - least)[[0, 2]]
    inside = ((rows[:, columns] >= least) & (rows[:, columns] <= most)).all(1)
    kept = rows[inside & (np.exp(rows[:, size].max(1)) < sides.min() / 8)].copy()
    if target is None:
        return sides
    header = data[:end].replace(b"element vertex %d" % len(rows), b"element vertex %d" % (len(kept) * copies))
    side = int(np.ceil(np.sqrt(copies)))
    with target.open("wb") as out:
        out.write(header)
        for copy in range(copies):
            moved = kept.copy()
            moved[:, columns[0]] += copy // side * sides[0]
            moved[:, columns[2]] += copy % side * sides[1]
            out.write(moved.tobytes())
    return sides


def path(cameras, sides, copies, views):
    """Return cameras on a way through all copies, there and back along rows of the grid."""
    side = int(np.ceil(np.sqrt(copies)))
    cells = [divmod(copy, side) for copy in range(copies)]
    cells.sort(key=lambda cell: (cell[0], cell[1] if cell[0] % 2 == 0 else -cell[1]))
    found = []
    for view in range(views):
        camera = dict(cameras[view % len(cameras)])
        cell = cells[view * copies // views]
        x, y, z = camera["position"]
        camera["position"] = [x + cell[0] * float(sides[0]), y, z + cell[1] * float(sides[1])]
        camera.update(id=view, img_name=f"{view:04}")
        camera.pop("split", None)
        found.append(camera)
    return found


def psnr(a, b):
    x, y = (np.asarray(Image.open(file).convert("RGB"), dtype=np.float64) for file in (a, b))
    error = np.mean((x - y) ** 2)
    return 10 * np.log10(255**2 / error) if error else 100.0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path)
    parser.add_argument("cameras", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--copies", type=int, default=66)
    parser.add_argument("--views", type=int, default=100)
    parser.add_argument("--budget", type=int, nargs="+", default=[1_000_000])
    parser.add_argument("--width", type=int, default=640)
    parser.add_argument("--binary", default=ROOT / "target/release/lexisplat")
    args = parser.parse_args()
    args.folder.mkdir(parents=True, exist_ok=True)
    big, packed = args.folder / f"{args.copies}.ply", args.folder / f"{args.copies}.lexi"
    files = {packed: ["--lod"], args.folder / f"{args.copies}-plain.lexi": []}
    missing = [file for file in files if not file.exists()]
    sides = tile(args.model, args.copies, big if missing else None)
    for file in missing:
        run([args.binary, "compress", big, "-o", file, "--guess", "-q", *files[file]])
    big.unlink(missing_ok=True)
    for file, more in files.items():
        print(f"{' '.join(['compress --guess', *more])}: {file.stat().st_size:,} bytes")
    views = args.folder / f"path-{args.copies}-{args.views}.json"
    views.write_text(json.dumps(path(json.loads(args.cameras.read_text()), sides, args.copies, args.views)))
    draw = [args.binary, "render", packed, "--cameras", views, "--width", args.width, "-q", "--json", "--overwrite"]
    whole = args.folder / f"whole-{args.copies}-{args.views}-{args.width}"
    if not whole.exists():
        run([*draw, "-o", whole])
    described = json.loads(run([args.binary, "info", packed, "--json"])[0])
    print(f"{described['gaussians']:,} Gaussians in {packed.stat().st_size:,} bytes, {args.views} views\n")
    print("| budget | Gaussians drawn | bytes read for a view | bytes held | PSNR, mean / least | largest memory |")
    print("|---" * 6 + "|")
    for budget in args.budget:
        folder = args.folder / f"budget-{budget}"
        told, _, _, memory = run([*draw, "-o", folder, "--budget", budget])
        found = json.loads(told)["views"]
        scores = [psnr(whole / Path(view["file"]).name, view["file"]) for view in found]
        read = [view["bytes_read"] for view in found]
        print(
            f"| {budget:,} | {max(view['gaussians'] for view in found):,} | {np.mean(read):,.0f}, {max(read):,} at most "
            f"| {max(view['bytes_held'] for view in found):,} | {np.mean(scores):.2f} / {min(scores):.2f} dB | {memory / 2**20:,.0f} MiB |"
        )


if __name__ == "__main__":
    main()
