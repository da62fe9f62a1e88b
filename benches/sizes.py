#!/usr/bin/env python3
"""Time, memory and bytes of larger and larger scenes, packed whole, in parts and on Ray's workers.

    python3 benches/sizes.py MODEL.ply CAMERAS.json FOLDER [--copies 1 3 8] [--binary LEXISPLAT] [--ray PYTHON] [-- OPTION ...]

A scene is copies of the model side by side (`benches/tile.py`), which are made in FOLDER and stay there. It is compressed
without cameras, by the options after `--`. CPU seconds and the most resident memory are those of the program. PSNR is over the
test views of CAMERAS.json, at their own size, which stand in the first copy; views differ in what they show of others. `--ray`
is a Python with the package and Ray; its workers, two of one thread, take the same scene, and must make the same bytes as the
program in parts.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.dont_write_bytecode = True  # no __pycache__ in the working tree
from real_models import ROOT  # noqa: E402

#: Options with which a scene is packed as the program does, whole or in parts by its size, and in parts whatever its size.
WAYS = {"default": [], "in parts": ["--memory", "1MB"]}
RAY = """
import json, sys, ray, lexisplat.ray
ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level="error")
lexisplat.ray.compress([sys.argv[1]], sys.argv[2], overwrite=True)
"""


def run(command):
    """The output of a command, the seconds on the clock and of the processor, and the most bytes of resident memory."""
    with tempfile.TemporaryFile("w+") as told:
        clock, process = time.monotonic(), subprocess.Popen([str(part) for part in command], stdout=told)
        _, status, usage = os.wait4(process.pid, 0)
        if status:
            sys.exit(f"failed: {' '.join(map(str, command))}")
        told.seek(0)
        printed = told.read()
    return printed, time.monotonic() - clock, usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024


def quality(binary, scene, packed, cameras):
    command = [binary, "compare", scene, packed, "--cameras", cameras, "--split", "test", "--json", "-q"]
    told = json.loads(subprocess.run([str(part) for part in command], check=True, capture_output=True, text=True).stdout)
    found = [view["psnr"] for view in told["views"]]
    return sum(found) / len(found), min(found)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path)
    parser.add_argument("cameras", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--copies", type=int, nargs="+", default=[1, 3, 8])
    parser.add_argument("--binary", type=Path, default=ROOT / "target/release/lexisplat")
    parser.add_argument("--ray", type=Path)
    parser.add_argument("options", nargs="*")
    args = parser.parse_args()
    args.folder.mkdir(parents=True, exist_ok=True)
    print("| Gaussians | how | seconds | CPU seconds, a million | memory, of the PLY | bytes each | PSNR, dB (worst) |\n|---|---|---|---|---|---|---|")
    for copies in args.copies:
        scene = args.folder / f"{args.model.stem}-{copies}.ply"
        if not scene.exists():
            subprocess.run([sys.executable, ROOT / "benches/tile.py", args.model, str(copies), scene], check=True)
        size = scene.stat().st_size
        made = {}
        for how, way in WAYS.items():
            if how in made:
                continue
            packed = args.folder / f"{scene.stem}-{how.replace(' ', '-')}.lexi"
            options = ["--overwrite", "-q", "--json", "--no-cameras", *way, *args.options]
            report, clock, cpu, resident = run([args.binary, "compress", scene, "-o", packed, *options])
            how = "in parts" if json.loads(report)["in_parts"] else "whole"
            made[how] = packed
            told = subprocess.run([args.binary, "info", packed, "--json"], check=True, capture_output=True, text=True).stdout
            count = size_of(told)
            mean, worst = quality(args.binary, scene, packed, args.cameras)
            print(f"| {count:,} | {how} | {clock:.0f} | {cpu:.0f}, {cpu / count * 1e6:.0f} | {resident / size:.2f} | {packed.stat().st_size / count:.2f} | {mean:.2f} ({worst:.1f}) |", flush=True)
        if args.ray:
            packed = args.folder / f"{scene.stem}-ray.lexi"
            _, clock, _, _ = run([args.ray, "-c", RAY, scene, packed])
            same = "the same bytes as in parts" if packed.read_bytes() == made["in parts"].read_bytes() else "OTHER BYTES"
            print(f"| {count:,} | Ray, 2 workers | {clock:.0f} | | | {packed.stat().st_size / count:.2f} | {same} |", flush=True)


def size_of(told):
    """The number of Gaussians of the source, from what `info` prints."""
    found = json.loads(told)
    return found["gaussians"] + found["lexi"]["removed"]


if __name__ == "__main__":
    main()
