#!/usr/bin/env python3
"""Bytes, Gaussians and frame times with `compress --refine` beside those without: the table of docs/results/refine.md.

    python3 benches/refine.py FOLDER [--asked 40] [--models bonsai-3dgs room-large] [--efforts quick thorough]
                              [--without-cameras] [--binary PATH]

Needs Python alone. FOLDER has the models with their cameras. Pictures are the test views, as wide as the model was trained. Without
refining three files are made, asked for 1.5 dB less to 1.5 dB more; the logarithm of bytes is interpolated at the PSNR of the refined
file. CPU seconds are those of the whole command.
"""

import argparse
import json
import math
import resource
import subprocess
import tempfile
from pathlib import Path

from real_models import ROOT

CAMERAS = {"bonsai-3dgs": "bonsai", "bonsai-pixelgs": "bonsai", "snowmiku-mcmc": "snowmiku"}
# Quality of the files without refining, in dB beside what was asked. Judges and test views differ by up to 1 dB.
BESIDE = (-1.5, 0.0, 1.5)
# Largest width of test views; papers draw wider cameras at this width.
WIDTH = "1600"


def run(binary, *arguments):
    """Standard output of a command, and its CPU seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    out = subprocess.run([binary, *map(str, arguments)], check=True, capture_output=True, text=True).stdout
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return out, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


class Bench:
    def __init__(self, args, scratch):
        self.args, self.scratch = args, scratch

    def views(self, cameras):
        return ["--cameras", cameras, "--split", "test", "--width", WIDTH, "--device", "cpu", "--json"]

    def made(self, model, cameras, asked, used, *options):
        """Facts of a file of `model`."""
        file = self.scratch / "made.lexi"
        looks = ["--cameras", cameras] if used else ["--no-cameras"]
        told, seconds = run(self.args.binary, "compress", model, "-o", file, "--psnr", asked, *looks, *options,
                            "--device", "cpu", "--overwrite", "--json")
        views = self.views(cameras)
        score = json.loads(run(self.args.binary, "compare", model, file, *views)[0])
        beside = json.loads(run(self.args.binary, "compare", model, file, "--orbit", 24, "--device", "cpu", "--json")[0])
        told = json.loads(told)
        return {"bytes": file.stat().st_size, "gaussians": told["gaussians"], "of": told["gaussians"] + told["removed"],
                "psnr": score["psnr"]["mean"], "least": score["psnr"]["min"], "beside": beside["psnr"]["mean"],
                "seconds": seconds, "frame": self.frame(file, views), "refined": told["refined"]}

    def frame(self, file, views, path="cpu-sparse"):
        """Median milliseconds of a frame of the processor's renderer."""
        found = json.loads(run(self.args.binary, "bench", file, *views, "--cpu-repeat", 3)[0])
        return next(each["frame"]["median"] for each in found["paths"] if each["path"] == path)


def at(rows, psnr, key):
    """The value of `key` of files without refining at this PSNR, by the nearest two."""
    rows = sorted(rows, key=lambda row: abs(row["psnr"] - psnr))[:2]
    (a, b), value = rows, (lambda row: math.log(row[key]))
    return math.exp(value(a) + (psnr - a["psnr"]) / (b["psnr"] - a["psnr"]) * (value(b) - value(a)))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--asked", type=float, nargs="+", default=[36.0, 40.0, 44.0])
    parser.add_argument("--models", nargs="+", default=["room-large", "bonsai-3dgs", "room", "fern", "lego", "snowmiku-mcmc"])
    parser.add_argument("--efforts", nargs="+", default=["quick", "thorough"])
    parser.add_argument("--without-cameras", action="store_true")
    parser.add_argument("--binary", type=Path)
    args = parser.parse_args()
    if args.binary is None:
        subprocess.run(["cargo", "build", "--release", "-q", "-p", "lexisplat-cli"], cwd=ROOT, check=True)
        args.binary = ROOT / "target/release/lexisplat"
    print("| model, PSNR asked | effort | bytes | test PSNR: mean, least | least without refining | bytes without refining "
          "| ratio of bytes | Gaussians left | without refining | frame, ms | without refining | original | found views, mean PSNR | without refining | CPU s |")
    print("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as scratch:
        bench = Bench(args, Path(scratch))
        for name in args.models:
            model = args.folder / f"{name}.ply"
            cameras = args.folder / f"{CAMERAS.get(name, name)}.cameras.json"
            original = bench.frame(model, bench.views(cameras), "cpu-dense")
            for asked in args.asked:
                used = not args.without_cameras
                plain = [bench.made(model, cameras, asked + more, used) for more in BESIDE]
                for effort in args.efforts:
                    row = bench.made(model, cameras, asked, used, "--refine", effort)
                    same = {key: at(plain, row["psnr"], key) for key in ("bytes", "gaussians", "frame", "beside", "least")}
                    print(f"| {name}, {asked:.0f} | {effort} | {row['bytes']:,} | {row['psnr']:.2f}, {row['least']:.2f} "
                          f"| {same['least']:.2f} | {same['bytes']:,.0f} | {row['bytes'] / same['bytes']:.2f} | {row['gaussians'] / row['of']:.2f} "
                          f"| {same['gaussians'] / row['of']:.2f} | {row['frame']:.1f} | {same['frame']:.1f} | {original:.1f} "
                          f"| {row['beside']:.2f} | {same['beside']:.2f} | {row['seconds']:.0f} |", flush=True)


if __name__ == "__main__":
    main()
