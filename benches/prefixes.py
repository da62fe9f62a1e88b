#!/usr/bin/env python3
"""PSNR of the first bytes of packed files: mean and least against the original over its cameras.

    python3 benches/prefixes.py FOLDER [--only NAME ...] [--shares 10 15 25 ...] [--binary LEXISPLAT] [-- OPTION ...]

Every PLY of the folder that has a `NAME.cameras.json` (NAME may be a prefix of the PLY's name) is compressed, with the
options given after `--`; `decompress --first` then reads a share of the file, in percent of its bytes, and `compare
--cameras` scores that over all cameras, or over those that are marked as test views. A dash means that nothing can be
drawn of so few bytes. The last columns are the bytes of the file and the share at which the first layer is there.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

sys.dont_write_bytecode = True  # no __pycache__ in the working tree
from promise import cameras_of  # noqa: E402
from real_models import ROOT  # noqa: E402

SHARES = [10, 12, 15, 20, 25, 35, 50, 55, 65, 80, 100]


def output(*command):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    return done.stdout if done.returncode == 0 else None


def measured(binary, model, cameras, options, shares, folder):
    """The scores of all shares as words, the bytes of the file, and the share of the first layer."""
    packed, part = Path(folder, "a.lexi"), Path(folder, "a.ply")
    if output(binary, "compress", model, "-o", packed, "--overwrite", "-q", *options) is None:
        sys.exit(f"{model} could not be compressed")
    words = []
    for share in shares:
        part.unlink(missing_ok=True)
        output(binary, "decompress", packed, "-o", part, "--overwrite", "-q", "--first", f"{share}%")
        told = output(binary, "compare", model, part, "--cameras", cameras, "--json") if part.exists() else None
        score = json.loads(told)["psnr"] if told else None
        words.append(f"{score['mean']:.2f} / {score['min']:.1f}" if score else "-")
    size = packed.stat().st_size
    first = json.loads(output(binary, "info", packed, "--json"))["lexi"]["first_layer"]
    return words, size, f"{100 * first['bytes'] / size:.1f} %"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="+", default=[])
    parser.add_argument("--shares", nargs="+", type=float, default=SHARES)
    parser.add_argument("--binary", default=ROOT / "target/release/lexisplat")
    words = sys.argv[1:]
    end = words.index("--") if "--" in words else len(words)
    args, options = parser.parse_args(words[:end]), words[end + 1 :]
    print("| model | " + " | ".join(f"{share:g} %" for share in args.shares) + " | bytes | first layer |")
    print("|---" * (len(args.shares) + 3) + "|")
    for model in sorted(args.folder.glob("*.ply")):
        cameras = cameras_of(model)
        if cameras is None or args.only and model.stem not in args.only:
            continue
        with tempfile.TemporaryDirectory() as folder:
            words, size, first = measured(args.binary, model, cameras, options, args.shares, folder)
        print(f"| {model.stem} | " + " | ".join(words) + f" | {size:,} | {first} |", flush=True)


if __name__ == "__main__":
    main()
