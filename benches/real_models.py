#!/usr/bin/env python3
"""The table of README.md: every PLY of a folder, compressed at several tolerances and scored.

    python3 benches/real_models.py FOLDER [--tol 0.03 0.05 0.1 0.2] [--layout f16]

Needs Python alone. Views are the test split of `NAME.cameras.json` (NAME may be a prefix of the PLY's
name), else an orbit of 8; PSNR and SSIM are against the original's own pictures, float, width at most
800. For every file it also checks, by decompressing, that no Gaussian is over the tolerance and that
everything but SH-rest is bit-identical.
"""

import argparse
import json
import subprocess
import tempfile
from array import array
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
WIDTH = "800"


def lexisplat(*arguments):
    return subprocess.check_output([ROOT / "target/release/lexisplat", *map(str, arguments)])


def rows(path):
    """Property names and float rows of a binary little-endian PLY whose vertices are floats alone."""
    data = Path(path).read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    header = data[:end].decode().splitlines()
    if any(l.startswith("property") and l.split()[1] not in ("float", "float32") for l in header):
        return None
    names = [l.split()[-1] for l in header if l.startswith("property")]
    count = next(int(l.split()[2]) for l in header if l.startswith("element vertex"))
    values = array("f")
    values.frombytes(data[end:end + 4 * len(names) * count])
    return names, values


def check(original, back, tol):
    """Largest SH-rest error and how many are over `tol`; asserts that the rest is the same to the bit."""
    (names, a), (other, b) = rows(original), rows(back)
    width, other_width = len(names), len(other)
    sh = [(names.index(f"f_rest_{i}"), other.index(f"f_rest_{i}")) for i in range(45) if f"f_rest_{i}" in names]
    for name in names:
        if not name.startswith("f_rest_"):
            assert a[names.index(name)::width].tobytes() == b[other.index(name)::other_width].tobytes(), name
    errors = [0.0] * (len(a) // width)
    for i, j in sh:
        for k, (x, y) in enumerate(zip(a[i::width], b[j::other_width])):
            errors[k] += (x - y) * (x - y)
    worst = max(errors, default=0.0) ** 0.5
    return worst, sum(e ** 0.5 > tol for e in errors)


def views(model, folder):
    for cameras in sorted(folder.glob("*.cameras.json")):
        if model.stem.startswith(cameras.name.removesuffix(".cameras.json").split("-")[0]):
            if any(c.get("split") == "test" for c in json.loads(cameras.read_text())):
                return ["--cameras", cameras, "--split", "test"]
    return ["--orbit", 8]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--tol", type=float, nargs="+", default=[0.03, 0.05, 0.1, 0.2])
    parser.add_argument("--layout", default="f16")
    parser.add_argument("--pursuit", default="ols")
    args = parser.parse_args()
    subprocess.run(["cargo", "build", "--release", "-q"], cwd=ROOT, check=True)
    print("| model | Gaussians | tol | nonzeros | 45 / nonzeros | SH bytes | whole file | PSNR mean / min | SSIM | largest error | over |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for model in sorted(args.folder.glob("*.ply")):
        seen = views(model, args.folder)
        for tol in args.tol:
            with tempfile.TemporaryDirectory() as folder:
                small, back = f"{folder}/s.lexi", f"{folder}/b.ply"
                report = json.loads(lexisplat("compress", model, "-o", small, "--tol", tol, "--layout", args.layout, "--pursuit", args.pursuit, "--json", "-q"))
                lexisplat("decompress", small, "-o", back, "-q")
                worst, over = check(model, back, tol) if rows(model) else (report["max_residual"], report["over_tolerance"])
                score = json.loads(lexisplat("compare", model, small, "--json", "-q", "--width", WIDTH, *seen))
                decibels = lambda v: "identical" if v is None else f"{v:.2f}"
                cells = [
                    model.stem,
                    f"{report['gaussians']:,}",
                    tol,
                    f"{report['mean_nonzeros']:.2f}",
                    f"{report['coefficient_ratio'] or 0:.2f}x",
                    f"{report['dense_sh_bytes'] / report['sh_bytes']:.2f}x",
                    f"{report['ply_bytes'] / report['file_bytes']:.2f}x",
                    f"{decibels(score['psnr']['mean'])} / {decibels(score['psnr']['min'])}",
                    f"{score['ssim']['mean']:.4f}",
                    f"{worst:.6f}",
                    over,
                ]
                print("| " + " | ".join(map(str, cells)) + " |", flush=True)


if __name__ == "__main__":
    main()
