#!/usr/bin/env python3
"""The GPU renderer held against the CPU's, and timed: the tables of docs/results/gpu.md.

    python3 benches/gpu.py FOLDER [--big COPIES] [--repeat 20] [--out OUT.json]

Needs Python alone. For every PLY of FOLDER: GPU against CPU pictures (up to 13 views at most 400 pixels
wide), and for the scene compressed at tolerance 0.1 and packed at 40 dB also sparse against dense pictures
and bytes of SH on the GPU. With `--big COPIES` copies of the first model, packed at 40 dB, are laid side by side and
drawn as one scene, sparse and dense. Takes the best adapter, software included; says which.
"""

import argparse
import json
import os
import subprocess
import tempfile
from pathlib import Path

from real_models import ROOT, lexisplat


def agreement(*arguments):
    program = ROOT / "target/release/examples/gpu_agreement"
    out = subprocess.check_output([program, *map(str, arguments)], text=True)
    return [json.loads(line) for line in out.splitlines()]


def cameras_of(model, folder):
    """The cameras file whose name the model's begins with, if any."""
    for cameras in sorted(folder.glob("*.cameras.json")):
        stem = cameras.name.removesuffix(".cameras.json")
        if model.stem.startswith(stem.split("-")[0]):
            return [cameras]
    return []


def decibels(worst):
    return "identical" if worst["min_psnr"] is None else f"{worst['min_psnr']:.1f}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--repeat", type=int, default=20)
    parser.add_argument("--big", type=int, default=0)
    parser.add_argument("--out", type=Path)
    args = parser.parse_args()
    build = ["cargo", "build", "--release", "-q", "-p", "lexisplat-cli", "-p", "lexisplat-eval", "--bins", "--examples"]
    subprocess.run(build, cwd=ROOT, check=True)
    os.environ.setdefault("XDG_RUNTIME_DIR", "/tmp")
    results = []
    with tempfile.TemporaryDirectory() as folder:
        print("| scene | views | path | worst PSNR to CPU | largest | within 2/255 | worst PSNR to dense f32 | SH bytes each |")
        print("|---|---|---|---|---|---|---|---|")
        for model in sorted(args.folder.glob("*.ply")):
            seen = cameras_of(model, args.folder)
            files = [model]
            for name, options in (("tol 0.1", ["--tol", "0.1"]), ("40 dB", ["--psnr", "40"])):
                small = Path(folder) / f"{model.stem}, {name}.lexi"
                lexisplat("compress", model, "-o", small, *options, "-q")
                files.append(small)
            for file in files:
                for found in agreement(file, *seen):
                    results.append(found)
                    for path, result in found["paths"].items():
                        cpu, dense = result["against_cpu"], result["against_dense_f32"]
                        other = "" if path == "dense-f32" else decibels(dense)
                        print(f"| {file.stem} | {found['views']} | {path} | {decibels(cpu)} dB | {cpu['largest']:.2f} "
                              f"| {100 * cpu['within_2']:.3f} % | {other} | {result['sh_bytes_per_gaussian']:.1f} |", flush=True)
        if results:
            print(f"\n{results[0]['device']} ({results[0]['driver']})")
        if args.big:
            model = sorted(args.folder.glob("*.ply"))[0]
            small = Path(folder) / f"{model.stem}, 40 dB.lexi"
            program = ROOT / "target/release/examples/gpu_large"
            for path in ("sparse-ordered", "dense-f32"):
                line = subprocess.check_output([program, small, str(args.big), path, str(args.repeat)], text=True)
                print(line, flush=True)
                results.append(json.loads(line))
    if args.out:
        args.out.write_text(json.dumps(results, indent=1) + "\n")


if __name__ == "__main__":
    main()
