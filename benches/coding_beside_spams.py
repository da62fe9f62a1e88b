#!/usr/bin/env python3
"""Coding speed beside SPAMS: same dictionary, same tolerance, float32, coding step alone.

    pip install spams-bin numpy scipy safetensors
    python3 benches/coding_beside_spams.py MODEL.ply [MODEL.ply ...] [--tol 0.1] [--threads 1 2]

For each model: learns a dictionary with `lexisplat compress`, codes with `spams.omp` (which is OLS; its
eps is the squared norm) and with `lexisplat` (`--pursuit ols`, bound verified), and prints a table.
Both are run REPEATS times after one warm-up; the median counts.
"""

import argparse
import json
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import spams
from safetensors.numpy import load_file

REPEATS = 7
ROOT = Path(__file__).resolve().parent.parent


def sh_rest(path):
    """SH-rest of a binary little-endian PLY of floats, a column a Gaussian."""
    data = Path(path).read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    names = [l.split()[-1] for l in data[:end].decode().splitlines() if l.startswith("property float")]
    rows = np.frombuffer(data[end:], "<f4").reshape(-1, len(names))
    # By name: Brush writes them in alphabetical order.
    return np.asfortranarray(rows[:, [names.index(f"f_rest_{i}") for i in range(45)]].T)


def spams_speed(x, d, tol, threads):
    seconds = []
    for _ in range(REPEATS + 1):
        start = time.perf_counter()
        codes = spams.omp(x, d, eps=tol * tol, numThreads=threads)
        seconds.append(time.perf_counter() - start)
    return x.shape[1] / statistics.median(seconds[1:]), codes.nnz / x.shape[1]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", nargs="+")
    parser.add_argument("--tol", type=float, default=0.1)
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    args = parser.parse_args()
    build = ["cargo", "build", "--release", "-q", "-p", "lexisplat", "--example", "coding_speed", "-p", "lexisplat-cli", "--bin", "lexisplat"]
    subprocess.run(build, cwd=ROOT, check=True)
    target = Path(json.loads(subprocess.check_output(["cargo", "metadata", "--format-version=1", "--no-deps"], cwd=ROOT))["target_directory"]) / "release"
    print("| model | threads | SPAMS /s | nonzeros | lexisplat /s | nonzeros | ratio |")
    print("|---|---|---|---|---|---|---|")
    for model in args.models:
        with tempfile.TemporaryDirectory() as folder:
            lexi = f"{folder}/scene.lexi"
            subprocess.run([target / "lexisplat", "compress", "--quiet", model, "-o", lexi, "--tol", str(args.tol)], check=True, stdout=subprocess.DEVNULL)
            dictionary = np.asfortranarray(load_file(lexi)["dictionary"].T)
            x = sh_rest(model)
            for threads in args.threads:
                theirs, their_nonzeros = spams_speed(x, dictionary, args.tol, threads)
                command = [target / "examples" / "coding_speed", model, lexi, str(args.tol), "ols", str(threads), str(REPEATS)]
                ours = json.loads(subprocess.check_output(command))
                assert ours["max_residual"] <= args.tol, ours
                assert abs(ours["mean_nonzeros"] / their_nonzeros - 1) < 0.005, (ours, their_nonzeros)
                print(f"| {Path(model).stem} | {threads} | {theirs:,.0f} | {their_nonzeros:.3f} | {ours['per_second']:,.0f} | {ours['mean_nonzeros']:.3f} | {ours['per_second'] / theirs:.1f} |", flush=True)


if __name__ == "__main__":
    main()
