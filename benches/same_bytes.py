#!/usr/bin/env python3
"""Hashes every kind of file that `lexisplat compress` writes, for every model in a folder.

    python3 benches/same_bytes.py FOLDER OUT.json [--program target/release/lexisplat] [--against OLD.json]

A change that must not change bytes is measured by running this with the program before it and after it.
OUT.json maps MODEL/WAY to the SHA-256 of the file (or to the exit code of a refusal), and of the PLY that
`decompress` makes of it. With --against the differences are listed, and the exit code is 1 if there are any.
Finished entries of OUT.json are kept, so a stopped run goes on where it was.
"""

import argparse
import hashlib
import json
import pathlib
import subprocess
import sys
import tempfile

# Ways to compress: a name and the options. `{cameras}` is MODEL's cameras; a way that needs them is left
# out for a model without.
WAYS = {
    "small": ["--preset", "small"],
    "balanced": [],
    "high": ["--preset", "high"],
    "archive": ["--preset", "archive"],
    "guess": ["--guess"],
    "keep-order": ["--keep-order", "--guess"],
    "packed-tol": ["--layout", "packed", "--tol", "0.1"],
    "psnr": ["--psnr", "40"],
    "size": ["--ratio", "20"],
    "keep-all": ["--keep-all"],
    "cameras": ["--psnr", "38", "--cameras", "{cameras}"],
    "parts": ["--memory", "1MB"],
    "f16": ["--tol", "0.1"],
    "f16-omp": ["--tol", "0.1", "--pursuit", "omp", "--seed", "7"],
    "f32": ["--layout", "f32", "--tol", "0.05"],
    "paper": ["--layout", "paper", "--tol", "0.1"],
    "max-nonzeros": ["--max-nonzeros", "4"],
}


def sha256(path):
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def cameras_of(model):
    stem = model.stem
    for name in (stem, stem.split("-")[0]):
        found = model.with_name(f"{name}.cameras.json")
        if found.exists():
            return found
    return None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--program", default="target/release/lexisplat")
    parser.add_argument("--against", type=pathlib.Path)
    parser.add_argument("--ways", default=",".join(WAYS))
    parser.add_argument("--models", help="names without extension, separated by commas")
    args = parser.parse_args()
    found = json.loads(args.out.read_text()) if args.out.exists() else {}
    models = sorted(args.folder.glob("*.ply"), key=lambda path: path.stat().st_size)
    if args.models:
        models = [model for model in models if model.stem in args.models.split(",")]
    with tempfile.TemporaryDirectory() as scratch:
        packed, back = pathlib.Path(scratch, "a.lexi"), pathlib.Path(scratch, "a.ply")
        for model in models:
            for way in args.ways.split(","):
                key = f"{model.stem}/{way}"
                cameras = cameras_of(model)
                if key in found or ("{cameras}" in WAYS[way] and cameras is None):
                    continue
                options = [str(cameras) if option == "{cameras}" else option for option in WAYS[way]]
                command = [args.program, "compress", str(model), "-o", str(packed), "-q", "--overwrite", *options]
                done = subprocess.run(command, capture_output=True, text=True)
                if done.returncode != 0:
                    found[key] = f"exit {done.returncode}"
                else:
                    command = [args.program, "decompress", str(packed), "-o", str(back), "-q", "--overwrite"]
                    subprocess.run(command, check=True, capture_output=True)
                    found[key] = [packed.stat().st_size, sha256(packed), sha256(back)]
                args.out.write_text(json.dumps(found, indent=0, sort_keys=True) + "\n")
    if args.against:
        old = json.loads(args.against.read_text())
        keys = sorted(set(old) & set(found))
        different = [key for key in keys if old[key] != found[key]]
        print(f"{len(keys)} files compared, {len(different)} differ")
        for key in different:
            print(f"  {key}: {old[key]} -> {found[key]}")
        sys.exit(1 if different else 0)


if __name__ == "__main__":
    main()
