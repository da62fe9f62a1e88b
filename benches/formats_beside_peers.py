#!/usr/bin/env python3
"""Files of other formats, read by lexisplat and by splat-transform: the largest differences of all values.

    python3 benches/formats_beside_peers.py SPLAT_TRANSFORM FILE... [--convert FORMAT ...] [--binary LEXISPLAT]

SPLAT_TRANSFORM is the `bin/cli.mjs` of npm's @playcanvas/splat-transform; it needs Node. Each FILE is read by both
programs, which write what they read as a PLY. With --convert each FILE is first converted to every FORMAT by lexisplat,
and where splat-transform writes that format by splat-transform too, and those files are read by both.

The table has a row for each file and reader pair: the largest difference of positions, of the logarithms of scales, of
opacities after the sigmoid, of rotations (1 - |cosine|), of base colours and of SH, over all Gaussians.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.dont_write_bytecode = True  # no __pycache__ in the working tree
from real_models import ROOT  # noqa: E402

# What splat-transform writes of what lexisplat reads.
THEIRS = {"spz", "sog", "compressed.ply", "glb"}


def run(*command):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    return None if done.returncode == 0 else (done.stderr or done.stdout).strip().splitlines()[-1:]


def columns(path):
    """The columns of a binary little-endian PLY of floats, by name."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    names, count = [], 0
    for line in data[:end].decode().splitlines():
        words = line.split()
        if words[0] == "element":
            assert words[1] == "vertex"
            count = int(words[2])
        if words[0] == "property":
            assert words[1] == "float", line
            names.append(words[2])
    rows = np.frombuffer(data, "<f4", count * len(names), end).reshape(count, len(names))
    return {name: rows[:, k].astype(np.float64) for k, name in enumerate(names)}


def stack(scene, *names):
    return np.stack([scene[name] for name in names], axis=1)


def differences(a, b):
    """The largest differences as words, in the order of the table."""
    if len(a["x"]) != len(b["x"]):
        return [f"{len(a['x'])} and {len(b['x'])} Gaussians"]
    largest = lambda x, y: float(np.max(np.abs(x - y), initial=0))
    both = lambda *names: (stack(a, *names), stack(b, *names))
    alpha = lambda scene: 1 / (1 + np.exp(-np.clip(scene["opacity"], -60, 60)))
    unit = lambda q: q / np.linalg.norm(q, axis=1, keepdims=True)
    qa, qb = (unit(q) for q in both("rot_0", "rot_1", "rot_2", "rot_3"))
    scales = [np.maximum(s, -30) for s in both("scale_0", "scale_1", "scale_2")]
    rest = [sum(name.startswith("f_rest_") for name in scene) for scene in (a, b)]
    sh = "-"
    if rest[0] != rest[1]:
        sh = f"{rest[0]} and {rest[1]} values"
    elif rest[0]:
        sh = f"{largest(*both(*(f'f_rest_{k}' for k in range(rest[0])))):.1e}"
    return [
        f"{largest(*both('x', 'y', 'z')):.1e}",
        f"{largest(*scales):.1e}",
        f"{largest(alpha(a), alpha(b)):.1e}",
        f"{float(np.max(1 - np.abs(np.sum(qa * qb, axis=1)), initial=0)):.1e}",
        f"{largest(*both('f_dc_0', 'f_dc_1', 'f_dc_2')):.1e}",
        sh,
    ]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("splat_transform", type=Path)
    parser.add_argument("files", type=Path, nargs="+")
    parser.add_argument("--convert", nargs="+", default=[])
    parser.add_argument("--binary", default=ROOT / "target/release/lexisplat")
    args = parser.parse_args()
    theirs = ("node", args.splat_transform, "-q", "-w")
    print("| file | Gaussians | position | log scale | opacity | rotation | base colour | SH |\n|" + "---|" * 8)

    def row(name, path, folder):
        ours, other = Path(folder, "ours.ply"), Path(folder, "theirs.ply")
        ours.unlink(missing_ok=True), other.unlink(missing_ok=True)
        failed = run(args.binary, "convert", path, ours, "-q", "--overwrite")
        refused = run(*theirs, path, other)
        if failed or refused:
            print(f"| {name} | not read: {'ours' if failed else 'theirs'}: {failed or refused} |", flush=True)
            return
        a, b = columns(ours), columns(other)
        print(f"| {name} | {len(a['x']):,} | " + " | ".join(differences(a, b)) + " |", flush=True)

    for path in args.files:
        with tempfile.TemporaryDirectory() as folder:
            if not args.convert:
                row(path.name, path, folder)
            for kind in args.convert:
                for name, command in [("lexisplat", (args.binary, "convert", "-q", "--overwrite")), ("theirs", theirs)]:
                    made = Path(folder, f"{name}.{kind}")
                    if name == "theirs" and kind not in THEIRS:
                        continue
                    failed = run(*command, path, made)
                    if failed:
                        print(f"| {path.name} to {kind} by {name} | not written: {failed} |", flush=True)
                    else:
                        row(f"{path.name} to {kind} by {name}", made, folder)


if __name__ == "__main__":
    main()
