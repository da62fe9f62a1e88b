#!/usr/bin/env python3
"""Files of other formats: what lexisplat and the formats' own programs read in them and write, and how fast.

    python3 benches/formats_beside_peers.py MODELS --npm NODE_MODULES [--spz SOURCE] [--only SECTION ...]
        [--models NAME ...] [--quality NAME ...] [--limit SECONDS] [--binary LEXISPLAT]

MODELS is a folder of PLYs of floats, and of .spz and .sog files if there are any. The others, of which those that are not
given are left out:
  --npm   the folder `node_modules` of: npm install @playcanvas/splat-transform three @mkkellogg/gaussian-splats-3d
  --spz   a clone of github.com/nianticlabs/spz, which is built here with spz_reader.cpp: needs c++, zlib and zstd

Needs numpy, and what makes LEXISPLAT and its reading clock:
  cargo build --release -p lexisplat-cli --no-default-features --features zstd
  cargo build --release -p lexisplat-formats --features zstd --example read_time

Sections:
  read      files that peers made, and those of MODELS, read by us and by every peer that reads the format
  written   files that we made, the same, and how alike the pictures of the two readings are
  again     files read and written, and that again: whether the second is the first
  speed     a million Gaussians read on one core
  commands  every .spz and .sog of MODELS through info, render, compress and compare (view needs a window and is left out)
  quality   the same format written by us and by its own program: bytes, seconds, and PSNR against the original

A difference is in quanta: the steps of the format at that value, as `quanta` below has them. 0.5 is where another code
begins. Two readers of one file should be far below. Readers that round to 8 bits for a screen may differ by 1. What is
above that, or was refused, is counted on the last line.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.dont_write_bytecode = True  # no __pycache__ in the working tree
from real_models import ROOT, views  # noqa: E402

SECTIONS = ["read", "written", "again", "speed", "commands", "quality"]
KSPLATS = ROOT / "crates/lexisplat-formats/tests/data"
C0 = 0.28209479177387814  # SH function of degree 0
DEGREE = {0: 0, 9: 1, 24: 2, 45: 3, 72: 4}  # of so many values of SH-rest
PER = [0, 3, 8, 15, 24]  # SH-rest of one channel, by degree
SURE = 100.0  # an opacity before the sigmoid that is 1 for every picture
AXES = {"spz": [1, -1, -1], "glb": [-1, -1, 1]}  # signs of these formats' axes beside a trainer's PLY
CHUNK = 256  # Gaussians of compressed.ply's chunks
FLOAT = 2.0**-20  # relative step of values that are floats in the file; 8 units of the last place
ALIKE = 50.0  # dB between pictures of two readings of one file
LARGE = 1_000_000  # Gaussians of the file whose reading is timed
ROUNDS = 5  # of a reader at once, of which the fastest counts
TURNS = 2  # of all readers
WIDTH = "400"  # pixels of pictures
ORBIT = "4"  # views of pictures of two readings
ATTRIBUTES = ["position", "scale", "rotation", "opacity", "colour", "SH"]


class Failed(Exception):
    """A program ended with an error."""


def run(*command, limit=None, **options):
    """Standard output, and the seconds that it took."""
    start = time.perf_counter()
    try:
        done = subprocess.run([str(part) for part in command], capture_output=True, text=True, timeout=limit, **options)
    except subprocess.TimeoutExpired:
        raise Failed(f"not done after {limit} s") from None
    if done.returncode:
        lines = (done.stderr or done.stdout).strip().splitlines() or ["no message"]
        raise Failed(next((line for line in lines if "rror" in line), lines[-1]).strip()[:120])
    return done.stdout, time.perf_counter() - start


# ---------------------------------------------------------------------------------------------------------------------------
# Scenes, and how far apart two are.


def columns(path):
    """The columns of a binary little-endian PLY of floats, by name."""
    data = Path(path).read_bytes()
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


def numbered(scene, name, count):
    return stack(scene, *(f"{name}_{k}" for k in range(count)))


def rest(scene):
    """SH-rest as (Gaussian, channel, coefficient)."""
    count = sum(name.startswith("f_rest_") for name in scene)
    return numbered(scene, "f_rest", count).reshape(-1, 3, count // 3) if count else np.zeros((len(scene["x"]), 3, 0))


def write(scene, path):
    """A PLY of `scene` that can be drawn: without colours for a screen, and with finite opacities."""
    share = alpha(scene)
    with np.errstate(divide="ignore"):
        opacity = np.log(share) - np.log1p(-share) if "alpha" in scene else scene["opacity"]
    scene = dict(scene, opacity=np.clip(opacity, -SURE, SURE))
    for k, name in enumerate(["red", "green", "blue"]):
        if name in scene:
            scene[f"f_dc_{k}"] = (scene.pop(name) / 255 - 0.5) / C0
    scene.pop("alpha", None)
    head = "".join(f"property float {name}\n" for name in scene)
    count = len(scene["x"])
    rows = np.stack(list(scene.values()), axis=1).astype("<f4")
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{head}end_header\n"
    Path(path).write_bytes(head.encode() + rows.tobytes())


def alpha(scene):
    return scene["alpha"] / 255 if "alpha" in scene else 1 / (1 + np.exp(-np.clip(scene["opacity"], -60, 60)))


def unit(q):
    return q / np.maximum(np.linalg.norm(q, axis=1, keepdims=True), 1e-30)


def covariances(scene):
    w, x, y, z = unit(numbered(scene, "rot", 4)).T
    turn = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]).transpose(2, 0, 1)
    part = turn * np.exp(numbered(scene, "scale", 3))[:, None, :]
    whole = part @ part.transpose(0, 2, 1)
    return np.stack([whole[:, i, j] for i, j in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]], axis=1)


def by_chunk(values, steps):
    """The steps of each Gaussian's chunk of compressed.ply: its range, in so many steps."""
    out = np.empty_like(values)
    for start in range(0, len(values), CHUNK):
        part = values[start : start + CHUNK]
        out[start : start + CHUNK] = (part.max(axis=0) - part.min(axis=0)) / steps
    return out


def quanta(kind, scene, facts):
    """The steps of the format `kind` for every attribute of `scene`, which was read of such a file; docs/FORMATS.md."""
    position, scale = stack(scene, "x", "y", "z"), numbered(scene, "scale", 3)
    colour, sh = numbered(scene, "f_dc", 3), rest(scene)
    spread = lambda values: float(np.ptp(values)) if values.size else 1.0
    floats = FLOAT * np.maximum(np.abs(position).max(initial=1.0), 1.0)
    steps = {"opacity": 1 / 255, "SH": 1.0}
    if kind == "spz":
        turn = 2 / 255 if facts["version"] < 3 else np.sqrt(0.5) / 511
        steps |= {"position": 2.0 ** -facts["fraction_bits"], "scale": 1 / 16, "rotation": turn}
        steps |= {"colour": 1 / 255 / 0.15, "SH": 1 / 128}
    elif kind == "compressed.ply":
        parts = np.array([2047, 1023, 2047])
        steps |= {"position": by_chunk(position, parts), "scale": by_chunk(np.maximum(scale, -20), parts)}
        steps |= {"rotation": np.sqrt(2) / 1023, "colour": by_chunk(colour, 255), "SH": 8 / 256}
    elif kind == "sog":
        log = np.sign(position) * np.log1p(np.abs(position))
        steps |= {"position": np.ptp(log, axis=0) / 65535 * (1 + np.abs(position)), "scale": spread(scale) / 255}
        steps |= {"rotation": np.sqrt(2) / 255, "colour": spread(colour) / 255, "SH": spread(sh) / 255}
    elif kind == "splat":
        steps |= {"position": floats, "scale": FLOAT * 16, "rotation": 1 / 128, "colour": 1 / 255 / C0}
    elif kind == "glb":
        steps |= {"position": floats, "scale": FLOAT * 16, "rotation": FLOAT, "opacity": FLOAT, "colour": FLOAT * 16, "SH": FLOAT}
    elif kind == "ksplat":
        half, level = 2.0**-11, facts["compression_level"]
        steps |= {"position": 2.5 / 32767 if level else floats, "scale": half if level else FLOAT * 16}
        steps |= {"rotation": half if level else FLOAT, "colour": 1 / 255 / C0}
        steps["SH"] = [FLOAT, half * max(spread(sh), 1e-3), max(spread(sh), 1e-3) / 255][level]
    else:
        raise ValueError(f"no quanta for {kind}")
    steps["position"] = np.maximum(steps["position"], floats)
    return {name: np.maximum(step, FLOAT) for name, step in steps.items()}


def differences(ours, theirs, steps, sign):
    """The largest difference of every attribute in quanta, and the attributes that the peer rounds to 8 bits.

    `sign`: of the axes that the peer leaves as they are in the file.
    """
    if len(ours["x"]) != len(theirs["x"]):
        raise Failed(f"{len(ours['x'])} Gaussians, and {len(theirs['x'])}")
    largest = lambda difference, step: float(np.max(np.abs(difference) / step, initial=0))
    found, rounded = {}, set()
    found["position"] = largest(stack(ours, "x", "y", "z") - sign * stack(theirs, "x", "y", "z"), steps["position"])
    if "scale_0" in theirs:
        a, b = (np.maximum(numbered(scene, "scale", 3), -17.4) for scene in (ours, theirs))  # f16's least scale
        found["scale"] = largest(a - b, steps["scale"])
        a, b = (unit(numbered(scene, "rot", 4)) for scene in (ours, theirs))
        b = b * np.array([1, *(sign[[1, 0, 0]] * sign[[2, 2, 1]])])
        b = np.where(np.sum(a * b, axis=1, keepdims=True) < 0, -b, b)
        found["rotation"] = largest(a - b, steps["rotation"])
    else:
        # A step of a scale changes a covariance by two such shares of its trace.
        a, b = covariances(ours), numbered(theirs, "cov", 6)
        b = b * sign[[0, 0, 0, 1, 1, 2]] * sign[[0, 1, 2, 1, 2, 2]]
        trace = a[:, [0, 3, 5]].sum(axis=1, keepdims=True)
        found["scale"] = found["rotation"] = largest((a - b) / np.maximum(trace, 1e-30), 2 * steps["scale"])
    if "red" in theirs:
        shown = np.clip(255 * (numbered(ours, "f_dc", 3) * C0 + 0.5), 0, 255)
        found["colour"] = largest(shown - stack(theirs, "red", "green", "blue"), 1.0)
        rounded |= {"colour", "opacity"}
        steps = dict(steps, opacity=1 / 255)
    else:
        found["colour"] = largest(numbered(ours, "f_dc", 3) - numbered(theirs, "f_dc", 3), steps["colour"])
    found["opacity"] = largest(alpha(ours) - alpha(theirs), steps["opacity"])
    a, b = rest(ours), rest(theirs)
    per = min(a.shape[2], b.shape[2])
    if per:
        a, b, step = a[:, :, :per], b[:, :, :per], steps["SH"]
        a = a * turns_of_sh(sign)[:per]
        if "cov_0" in theirs:
            # Bytes around 128.
            a, step, rounded = np.clip(a, -1, 127 / 128), max(step, 1 / 128), rounded | {"SH"}
        found["SH"] = largest(a - b, step)
    return found, rounded


def turns_of_sh(sign):
    """The signs of SH functions along axes that have these: function m of degree l is odd in y for m below 0, and so on."""
    signs = []
    for degree in range(1, 5):
        for m in range(-degree, degree + 1):
            odd = [-m - 1 if m < 0 else m, m < 0, degree - abs(m)]
            signs.append(np.prod([s if o % 2 else 1.0 for s, o in zip(sign, odd)]))
    return np.array(signs)


# ---------------------------------------------------------------------------------------------------------------------------
# Programs.


def kind_of(path):
    name = path.name
    return "compressed.ply" if name.endswith(".compressed.ply") else name.rsplit(".", 1)[1]


class Ours:
    name = "lexisplat"

    def __init__(self, binary):
        self.binary, self.clock = binary, Path(binary).parent / "examples/read_time"

    def versions(self):
        return [run(self.binary, "--version")[0].strip()]

    def __call__(self, *words, **options):
        return run(self.binary, *words, "-q", **options)

    def read(self, path, out):
        self("convert", path, out, "--overwrite")

    def write(self, path, out, version=None):
        return self("convert", path, out, "--overwrite", *(["--spz-version", version] if version else []))[1]

    def facts(self, path):
        return json.loads(self("info", path, "--json")[0])["about"]

    def seconds(self, path, one):
        return run(*one, self.clock, path, ROUNDS, env={**os.environ, "RAYON_NUM_THREADS": "1"})[0]

    def alike(self, a, b, *options):
        """Least PSNR of the views of `b` against `a`; infinite if they are the same."""
        report = json.loads(self("compare", a, b, "--json", "--device", "cpu", "--width", WIDTH, *options)[0])
        return {key: np.inf if report["psnr"][key] is None else report["psnr"][key] for key in ("mean", "min")}


class SplatTransform:
    name, reads = "splat-transform", ["spz", "sog", "compressed.ply", "splat", "ksplat"]
    writes = [("spz", 3), ("spz", 4), ("compressed.ply", None), ("sog", None), ("glb", None)]

    def __init__(self, npm):
        self.npm = npm
        self.program = ["node", npm / "@playcanvas/splat-transform/bin/cli.mjs", "-q", "-w", "-g", "cpu"]

    def read(self, path, out):
        run(*self.program, path, out)

    def write(self, path, out, version=None, limit=None):
        return run(*self.program, *(["--spz-version", version] if version else []), path, out, limit=limit)[1]

    def seconds(self, path, one):
        return node(self.npm, "time", self.name, path, ROUNDS, one=one)


class Niantic:
    name, reads, writes = "nianticlabs/spz", ["spz"], [("spz", 2), ("spz", 3), ("spz", 4)]

    def __init__(self, source, folder):
        self.source, self.program = source, Path(folder, "spz_reader")
        cc = source / "src/cc"
        run("c++", "-O3", "-std=c++17", "-I", cc, ROOT / "benches/spz_reader.cpp", *sorted(cc.glob("*.cc")), "-lz", "-lzstd", "-o", self.program)

    def versions(self):
        commit = run("git", "-C", self.source, "log", "-1", "--format=%h of %cs")[0].strip()
        return [f"nianticlabs/spz {commit}, {run(self.program, 'versions')[0].strip()}"]

    def read(self, path, out):
        run(self.program, "read", path, out)

    def write(self, path, out, version=4, limit=None):
        return run(self.program, "write", path, out, version)[1]

    def seconds(self, path, one):
        return run(*one, self.program, "time", path, ROUNDS)[0]


class ByNode:
    writes = []

    def __init__(self, npm, name, reads, spz):
        # The newest version of SPZ that it reads.
        self.npm, self.name, self.reads, self.spz = npm, name, reads, spz

    def read(self, path, out):
        node(self.npm, "read", self.name, path, out)

    def seconds(self, path, one):
        return node(self.npm, "time", self.name, path, ROUNDS, one=one)


def node(npm, *words, one=()):
    return run(*one, "node", ROOT / "benches/peer_reader.mjs", npm, *words)[0]


# ---------------------------------------------------------------------------------------------------------------------------
# Sections.


class Bench:
    def __init__(self, args, folder):
        self.args, self.folder, self.ours, self.missed = args, Path(folder), Ours(args.binary), []
        self.peers, versions = [], self.ours.versions()
        if args.npm:
            self.peers.append(SplatTransform(args.npm))
            versions += node(args.npm, "versions").splitlines()
        if args.spz:
            self.peers.append(Niantic(args.spz, folder))
            versions += self.peers[-1].versions()
        if args.npm:
            self.peers.append(ByNode(args.npm, "three", ["spz", "splat", "ksplat", "glb"], 4))
            self.peers.append(ByNode(args.npm, "gaussian-splats-3d", ["spz", "splat", "ksplat", "compressed.ply"], 2))
        print("Programs: " + "; ".join(versions) + ".")
        self.models = [args.folder / f"{name}.ply" for name in args.models]

    def miss(self, text):
        self.missed.append(text)
        return f"**{text}**"

    def title(self, text, *heads):
        print(f"\n### {text}\n\n| " + " | ".join(heads) + " |\n|" + "---|" * len(heads), flush=True)

    def row(self, *cells):
        print("| " + " | ".join(str(cell) for cell in cells) + " |", flush=True)

    def compared(self, files, pictures):
        """Rows of `files`, each a group and a path: one for each group and reader, of the largest of all files."""
        groups = {}
        for group, path in files:
            groups.setdefault(group, []).append(path)
        for group, paths in groups.items():
            for peer in self.peers:
                if kind_of(paths[0]) in peer.reads:
                    self.group(group, peer, paths, pictures)

    def group(self, group, peer, paths, pictures):
        worst, rounded, gaussians, refused, least, done, drawn = {}, set(), 0, {}, np.inf, 0, False
        ours, theirs = self.folder / "ours.ply", self.folder / "theirs.ply"
        for path in paths:
            kind = kind_of(path)
            try:
                facts = self.ours.facts(path)
                if kind == "spz" and facts["version"] > getattr(peer, "spz", 4):
                    continue
                self.ours.read(path, ours)
                peer.read(path, theirs)
                a, b = columns(ours), columns(theirs)
                sign = AXES.get(kind, [1, 1, 1]) if isinstance(peer, ByNode) else [1, 1, 1]
                found, of = differences(a, b, quanta(kind, a, facts), np.array(sign, float))
                if pictures and "scale_0" in b and rest(a).shape == rest(b).shape:
                    write(b, theirs)
                    least, drawn = min(least, self.ours.alike(ours, theirs, "--orbit", ORBIT)["min"]), True
            except Failed as failed:
                refused.setdefault(str(failed), []).append(path.name)
                continue
            done, rounded, gaussians = done + 1, rounded | of, gaussians + len(a["x"])
            for name, value in found.items():
                worst[name] = max(worst.get(name, 0.0), value)
        cells = []
        for name in ATTRIBUTES:
            value = worst.get(name)
            # Half of a step, and what single precision adds.
            most = 1.02 if name in rounded else 0.5
            text = "-" if value is None else f"{value:.2g}" + (" (8 bits)" if name in rounded else "")
            cells.append(text if value is None or value <= most else self.miss(f"{group}, {peer.name}: {name} {text}"))
        if pictures:
            picture = "-" if not drawn else "identical" if least == np.inf else f"{least:.1f}"
            cells.append(picture if least >= ALIKE else self.miss(f"{group}, {peer.name}: {picture} dB"))
        if done:
            self.row(group, peer.name, done, f"{gaussians:,}", *cells)
        for text, names in refused.items():
            self.row(group, peer.name, f"{len(names)} refused", "", self.miss(f"{text}"), *[""] * (len(cells) - 1))

    def read(self):
        files = []
        for model in self.models:
            for peer in self.peers:
                for kind, version in peer.writes:
                    if kind == "sog" and model.stat().st_size > self.args.sog_bytes:
                        continue
                    path = self.folder / f"{model.stem}-{peer.name.split('/')[0]}-{version or 0}.{kind}"
                    label = f"{kind}{f' v{version}' if version else ''} by {peer.name}"
                    try:
                        peer.write(model, path, version)
                        files.append((label, path))
                    except Failed as failed:
                        self.miss(f"{label}, {model.stem}: {failed}")
            if self.args.npm:
                for level in range(3):
                    path = self.folder / f"{model.stem}-{level}.ksplat"
                    try:
                        node(self.args.npm, "ksplat", model, path, level, 2)
                        files.append((f"ksplat level {level} by gaussian-splats-3d", path))
                    except Failed as failed:
                        self.miss(f"ksplat level {level}, {model.stem}: {failed}")
        for path in self.given() + sorted(KSPLATS.glob("*.ksplat")):
            files.append((f"{kind_of(path)} given", path))
        self.title("Files of peers, read", "format, made by", "read by us and by", "files", "Gaussians", *ATTRIBUTES)
        self.compared(sorted(files, key=lambda file: file[0]), False)

    def given(self):
        return [path for end in ("spz", "sog") for path in sorted(self.args.folder.glob(f"*.{end}"))]

    def written(self):
        files = []
        for model in self.models:
            for kind, version in [("spz", 2), ("spz", 3), ("spz", 4), ("sog", None), ("compressed.ply", None), ("splat", None), ("glb", None)]:
                path = self.folder / f"{model.stem}-ours-{version or 0}.{kind}"
                self.ours.write(model, path, version)
                files.append((f"{kind}{f' v{version}' if version else ''}", path))
        heads = ["format", "read by us and by", "files", "Gaussians", *ATTRIBUTES, "pictures, dB"]
        self.title("Files of lexisplat, read", *heads)
        self.compared(sorted(files, key=lambda file: file[0]), True)

    def again(self):
        self.title("Read and written twice", "format", "files", "the second is the first", "bytes that differ")
        for kind, version in [("spz", 2), ("spz", 3), ("spz", 4), ("compressed.ply", None), ("glb", None), ("splat", None), ("sog", None)]:
            same, count, differ = 0, 0, 0
            for source in self.models + [path for path in self.given() if kind != "sog"]:
                first, second = (self.folder / f"{name}.{kind}" for name in ("first", "second"))
                self.ours.write(source, first, version)
                self.ours.write(first, second, version)
                a, b = first.read_bytes(), second.read_bytes()
                count, same = count + 1, same + (a == b)
                both = (np.frombuffer(bytes[: min(len(a), len(b))], np.uint8) for bytes in (a, b))
                differ += abs(len(a) - len(b)) + int(np.count_nonzero(np.not_equal(*both)))
            label = f"{kind}{f' v{version}' if version else ''}"
            text = f"{same} of {count}"
            asked = kind in ("spz", "compressed.ply", "glb")
            self.row(label, count, text if same == count or not asked else self.miss(f"{label}: {text} come back"), f"{differ:,}")

    def speed(self):
        model = self.args.folder / f"{self.args.speed}.ply"
        count = len(columns(model)["x"])
        large, one = self.folder / "large.ply", ["taskset", "-c", self.args.core]
        run(sys.executable, ROOT / "benches/tile.py", model, -(-LARGE // count), large)
        self.title("Reading on one core", "format", "written by", "Gaussians", "read by", "seconds", "peer / ours")
        for kind, version in [("spz", 3), ("spz", 4), ("compressed.ply", None)]:
            for writer in [self.ours, *self.peers]:
                if writer is not self.ours and (kind, version) not in writer.writes:
                    continue
                path = self.folder / f"large.{kind}"
                writer.write(large, path, version)
                label = f"{kind}{f' v{version}' if version else ''}"
                readers = [self.ours]
                readers += [peer for peer in self.peers if kind in peer.reads and (version or 0) <= getattr(peer, "spz", 4)]
                best, refused = {}, {}
                # In turns, so that other work on the machine slows all of them.
                for reader in readers * TURNS:
                    try:
                        seconds, gaussians = reader.seconds(path, one).strip().splitlines()[-1].split()
                        best[reader.name] = min(best.get(reader.name, np.inf), float(seconds))
                        count = int(gaussians)
                    except Failed as failed:
                        refused[reader.name] = f"refused: {failed}"
                ours = best[self.ours.name]
                for name in [reader.name for reader in readers]:
                    theirs = best.get(name)
                    if theirs is None:
                        self.row(label, writer.name, "", name, refused[name], "")
                        continue
                    ratio = f"{theirs / ours:.2f}"
                    cell = ratio if theirs >= ours else self.miss(f"{label}, {name}: {ratio}")
                    self.row(label, writer.name, f"{count:,}", name, f"{theirs:.3f}", cell)

    def commands(self):
        self.title("Files as they are, in every command", "file", "info", "render", "compress", "compare, dB")
        for path in self.given():
            lexi, pictures = self.folder / "a.lexi", self.folder / "pictures"
            cells = []
            for words in (
                ["info", path, "--json"],
                ["render", path, "-o", pictures, "--orbit", "2", "--width", WIDTH, "--device", "cpu", "--overwrite"],
                ["compress", path, "-o", lexi, "--overwrite"],
                ["compare"],
            ):
                try:
                    if words == ["compare"]:
                        cells.append(f"{self.ours.alike(path, lexi, '--orbit', ORBIT)['mean']:.1f}")
                    else:
                        out, seconds = self.ours(*words)
                        facts = json.loads(out) if words[0] == "info" else None
                        cells.append(f"{facts['gaussians']:,}" if facts else f"{seconds:.1f} s")
                except Failed as failed:
                    cells.append(self.miss(f"{path.name}, {words[0]}: {failed}"))
            self.row(path.name, *cells)

    def quality(self):
        self.title("Cost of a format", "model", "Gaussians", "format", "written by", "bytes", "seconds", "PSNR, dB: mean", "worst view")
        for name in self.args.quality:
            model = self.args.folder / f"{name}.ply"
            count = len(columns(model)["x"])
            seen = views(model, self.args.folder)
            for kind, version in [("sog", None), ("spz", 4), ("compressed.ply", None)]:
                for writer in [self.ours, *self.peers]:
                    if writer is not self.ours and (kind, version) not in writer.writes:
                        continue
                    made = self.folder / f"quality.{kind}"
                    label = f"{kind}{f' v{version}' if version else ''}"
                    try:
                        if writer is self.ours:
                            seconds = writer.write(model, made, version)
                        else:
                            seconds = writer.write(model, made, version, limit=self.args.limit)
                    except Failed as failed:
                        self.row(name, f"{count:,}", label, writer.name, "", str(failed), "", "")
                        continue
                    psnr = self.ours.alike(model, made, *seen)
                    size = made.stat().st_size
                    self.row(name, f"{count:,}", label, writer.name, f"{size:,}", f"{seconds:.1f}", f"{psnr['mean']:.2f}", f"{psnr['min']:.2f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--npm", type=lambda text: Path(text).resolve())
    parser.add_argument("--spz", type=Path)
    parser.add_argument("--only", nargs="+", choices=SECTIONS, default=SECTIONS)
    parser.add_argument("--models", nargs="+", default=["bonsai-3dgs", "fruit-drops", "leica-brush", "pc-short", "train-first1000"])
    parser.add_argument("--quality", nargs="+", default=["fruit-drops", "leica-brush", "fern"])
    parser.add_argument("--speed", default="bonsai-3dgs", help="the model of which copies are timed")
    parser.add_argument("--sog-bytes", type=int, default=3_000_000, help="largest PLY that splat-transform makes a SOG of in `read`")
    parser.add_argument("--limit", type=int, default=1800, help="seconds that a peer may take to write a file in `quality`")
    parser.add_argument("--core", default="0")
    parser.add_argument("--binary", type=Path, default=ROOT / "target/release/lexisplat")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(args, folder)
        for section in args.only:
            getattr(bench, section)()
    print(f"\nMissed: {len(bench.missed)}" + "".join(f"\n- {text}" for text in bench.missed))


if __name__ == "__main__":
    main()
