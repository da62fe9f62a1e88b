#!/usr/bin/env python3
"""Time, memory and bytes of packing, for one binary or several in turn.

    python3 benches/packing_seconds.py [--binary NAME=PATH ...] [--simd avx2 avx512] [--way WAY ...] -- MODEL.ply ...

Without --binary it builds this tree. Every binary packs every model in every way, one after the other on an
otherwise idle machine, REPEATS times; the run with the least CPU time counts. A larger model comes from
benches/tile.py. CPU seconds are user and system time of all threads. Memory is the largest resident set.
"""

import argparse
import json
import os
import subprocess
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
WAYS = {
    "default": [],
    "psnr": ["--psnr", "40"],
    "guess": ["--guess"],
    "size": ["--size", "1MB"],
    "tol": ["--tol", "0.1"],
}
REPEATS = 2


def run(command, simd):
    """Runs a command; returns its wall and CPU seconds, its largest resident set in MiB, and its output."""
    with tempfile.TemporaryFile() as out:
        start = time.perf_counter()
        child = subprocess.Popen(command, stdout=out, stderr=subprocess.PIPE, env={**os.environ, "LEXISPLAT_SIMD": simd})
        complaint = child.stderr.read().decode()
        _, status, usage = os.wait4(child.pid, 0)
        wall = time.perf_counter() - start
        out.seek(0)
        text = out.read().decode()
    return wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024, status, text, complaint


def built():
    subprocess.run(["cargo", "build", "--release", "-q", "-p", "lexisplat-cli", "--bin", "lexisplat"], cwd=ROOT, check=True)
    metadata = subprocess.check_output(["cargo", "metadata", "--format-version=1", "--no-deps"], cwd=ROOT)
    return Path(json.loads(metadata)["target_directory"]) / "release" / "lexisplat"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", nargs="+")
    parser.add_argument("--binary", action="append", default=[], metavar="NAME=PATH")
    parser.add_argument("--simd", nargs="+", default=["avx2"])
    parser.add_argument("--way", nargs="+", default=["default", "psnr", "guess"], choices=list(WAYS))
    parser.add_argument("--repeats", type=int, default=REPEATS)
    args = parser.parse_args()
    binaries = [entry.split("=", 1) for entry in args.binary] or [["this", str(built())]]
    print("| model | way | vectors | binary | wall s | CPU s | look s | pack s | MiB | bytes |")
    print("|---|---|---|---|---|---|---|---|---|---|", flush=True)
    for model in args.models:
        for way in args.way:
            for simd in args.simd:
                for name, binary in binaries:
                    with tempfile.TemporaryDirectory() as folder:
                        out = f"{folder}/out.lexi"
                        command = [binary, "compress", "--json", "--overwrite", model, "-o", out, *WAYS[way]]
                        runs = [run(command, simd) for _ in range(args.repeats)]
                        wall, cpu, memory, status, text, complaint = min(runs, key=lambda r: r[1])
                        try:
                            report = json.loads(text)
                        except json.JSONDecodeError:
                            report = {}
                        look, pack = (report.get(key) for key in ("look_seconds", "pack_seconds"))
                        stage = lambda v: "" if v is None else f"{v:.2f}"
                        size = report.get("file_bytes", complaint.strip().splitlines()[-1] if complaint else status)
                        print(f"| {Path(model).stem} | {way} | {simd} | {name} | {wall:.2f} | {cpu:.2f} | {stage(look)} | {stage(pack)} | {memory:.0f} | {size} |", flush=True)


if __name__ == "__main__":
    main()
