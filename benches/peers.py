#!/usr/bin/env python3
"""Bytes at equal reached quality beside the codecs of others that run on a processor, and what they take to run.

    python3 benches/peers.py FOLDER [--only NAME ...] [--asked 36 40 44] [--node NODE] [--npm NODE_MODULES]
        [--spz SPZ_READER] [--lgsc BINARY] [--sog NAME ...] [--limit SECONDS] [--binary LEXISPLAT] [--json FILE]
        [--times NAME ...] [--tables FILE ...] [--peers-only]

Every binary float PLY of FOLDER that has a `NAME.cameras.json` (NAME may be a prefix of the PLY's name) is encoded by
every codec at every setting and decoded to a PLY by the codec's own program. `lexisplat compare` scores every such PLY
against the original: over test views, which `compress` does not get, in pictures as wide as those of training. Ours are
`--psnr` at each asked quality with the training cameras and without cameras, and one file more at each end where these
do not enclose a quality that is compared.

The others, of which those that are not given are left out:
  --npm   the folder `node_modules` of: npm install @playcanvas/splat-transform @adobe/spz
  --spz   spz_reader.cpp, built over a clone of github.com/nianticlabs/spz
  --lgsc  lgsc-api-example1 of a CMake build of github.com/qualcomm/lite-3Dgsplat-codec
  --node  Node 22, which splat-transform needs
SOG is made of the models that --sog names, and is given up after --limit CPU seconds.

Bytes at a quality are on straight lines in log(bytes) between the points of a codec that no other point of it beats. Where
a codec's curve begins above the quality, its smallest file counts. Seconds are CPU seconds (user and system) and wall
seconds of the whole program, and memory is the peak of its resident set. FILE keeps what was measured, and a second run
measures what is missing in it.
"""

import argparse
import json
import math
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.dont_write_bytecode = True  # no __pycache__ in the working tree
from promise import cameras_of, training, widths_of  # noqa: E402
from rate_distortion import cost, header  # noqa: E402
from real_models import ROOT  # noqa: E402

READER = ROOT / "benches/peer_reader.mjs"
SPZ_VERSION = 4  # the newest
# Bits of SH of degree 1 and above it; 5 and 4 are the library's own.
SPZ_BITS = ((3, 2), (4, 3), (5, 4), (6, 5), (7, 6), (8, 8))
SHARES = (95, 90, 75, 50, 25)  # percent of the Gaussians that splat-transform leaves
SOG_SHARES = (95, 90)  # the same before SOG, which takes minutes
STEP = 2.0  # dB that one file more at an end is beyond the quality that was missed
MIDDLE = 40.0  # dB; seconds and memory are shown of the setting of a codec that comes nearest to it
MIB = 1024.0  # KiB, the unit of ru_maxrss on Linux
WITH, WITHOUT = "lexisplat, cameras", "lexisplat"


class Failed(Exception):
    """A program ended with an error, or was given up."""


def timed(command, limit=None):
    """CPU seconds, wall seconds and MiB at most of a program and those that it waited for."""
    bound = (lambda: resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))) if limit else None
    with tempfile.TemporaryFile() as said:
        start = time.monotonic()
        child = subprocess.Popen([str(word) for word in command], stdout=said, stderr=said, preexec_fn=bound)
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        wall, cpu = time.monotonic() - start, used.ru_utime + used.ru_stime
        if child.returncode:
            said.seek(0)
            lines = said.read().decode(errors="replace").strip().splitlines() or ["no message"]
            raise Failed(f"not done after {cpu:.0f} CPU seconds" if limit and cpu >= limit - 1 else lines[-1][:200])
    return {"cpu": cpu, "wall": wall, "mib": used.ru_maxrss / MIB}


def together(*parts):
    """Steps of one task, one after the other."""
    return {"cpu": sum(p["cpu"] for p in parts), "wall": sum(p["wall"] for p in parts), "mib": max(p["mib"] for p in parts)}


def peers(args, model):
    """(codec, setting, encode, decode, ending of its files, limit): the two functions make commands, which run in turn, of
    the paths that are read and written."""
    if args.npm:
        transform = [args.node, args.npm / "@playcanvas/splat-transform/bin/cli.mjs", "-q", "-w", "-g", "cpu"]
        adobe = [args.node, READER, args.npm]
        convert = lambda a, b: [[*transform, a, b]]

        def fewer(way, share):
            # Its command line decimates into a PLY alone.
            between = lambda b: b.with_suffix(".fewer.ply")
            return lambda a, b: [[*transform, a, f"--{way}", f"{share}%", between(b)], [*transform, between(b), b]]

        for version in (4, 3):
            spz = lambda a, b, v=version: [[*transform, "--spz-version", v, a, b]]
            yield "SPZ, splat-transform", f"v{version}", spz, convert, "spz", None
        for way in ("decimate", "decimate-adaptive"):
            for share in SHARES:
                yield "decimate and SPZ", f"{way} {share}%", fewer(way, share), convert, "spz", None
        for bits in SPZ_BITS:
            spz = lambda a, b, bits=bits: [[*adobe, "spz", a, b, *bits]]
            read = lambda a, b: [[*adobe, "read", "@adobe/spz", a, b]]
            yield "SPZ, @adobe/spz", "SH %d, %d" % bits, spz, read, "spz", None
        if model.stem in args.sog:
            yield "SOG, splat-transform", "default", convert, convert, "sog", args.limit
            for share in SOG_SHARES:
                yield "decimate and SOG", f"decimate {share}%", fewer("decimate", share), convert, "sog", args.limit
    if args.spz:
        for bits in SPZ_BITS:
            spz = lambda a, b, bits=bits: [[args.spz, "write", a, b, SPZ_VERSION, *bits]]
            yield "SPZ, nianticlabs", "SH %d, %d" % bits, spz, lambda a, b: [[args.spz, "read", a, b]], "spz", None
    if args.lgsc:
        for level in (2, 1, 0):
            encode = [args.lgsc, "--mode", 0, "--compLevel", level]
            decode = [args.lgsc, "--mode", 1, "--outputBinaryPly", 1]
            yield ("L-GSC", f"level {level}",
                   lambda a, b, e=encode: [[*e, "--uncompressedDataPath", a, "--compressedStreamPath", b]],
                   lambda a, b, d=decode: [[*d, "--compressedStreamPath", a, "--reconstructedDataPath", b]], "lgsc", None)


class Bench:
    def __init__(self, args):
        self.args = args
        self.rows = json.loads(args.json.read_text()) if args.json and args.json.exists() else []

    def point(self, model, count, codec, setting, encode, decode, kind, limit):
        """Encodes, decodes and scores, unless that was done; gives the row, or None where the codec failed."""
        found = next((r for r in self.rows if (r["scene"], r["codec"], r["setting"]) == (model.stem, codec, setting)), None)
        if found:
            return None if "failed" in found else found
        cameras = cameras_of(model)
        row = {"scene": model.stem, "gaussians": count, "width": widths_of(model, cameras)[0], "codec": codec, "setting": setting}
        with tempfile.TemporaryDirectory() as folder:
            encoded, decoded = Path(folder) / f"encoded.{kind}", Path(folder) / "decoded.ply"
            try:
                row["encode"] = together(*(timed(command, limit) for command in encode(model, encoded)))
                row["bytes"] = encoded.stat().st_size
                row["decode"] = together(*(timed(command) for command in decode(encoded, decoded)))
                command = [self.args.binary, "compare", model, decoded, "--json", "-q", "--device", "cpu", "--cameras", cameras,
                           "--split", "test", "--width", row["width"]]
                report = subprocess.run([str(word) for word in command], capture_output=True, text=True)
                if report.returncode:
                    raise Failed(report.stderr.strip()[-200:])
                row |= {"psnr": json.loads(report.stdout)["psnr"]["mean"], "worst": json.loads(report.stdout)["psnr"]["min"]}
            except Failed as error:
                row["failed"] = str(error)
        self.rows.append(row)
        if self.args.json:
            self.args.json.write_text(json.dumps(self.rows, indent=1))
        print(f"{model.stem:20} {codec:22} {setting:24} {row.get('failed') or '%d bytes, %.2f dB' % (row['bytes'], row['psnr'])}",
              file=sys.stderr, flush=True)
        return None if "failed" in row else row

    def ours(self, model, count, name, options):
        def ask(decibels):
            compress = lambda a, b: [[self.args.binary, "compress", "--quiet", a, "-o", b, *options, "--psnr", f"{decibels:g}"]]
            decompress = lambda a, b: [[self.args.binary, "decompress", "--quiet", a, "-o", b]]
            return self.point(model, count, name, f"--psnr {decibels:g}", compress, decompress, "lexi", None)

        asked = sorted(self.args.asked)
        reached = [row["psnr"] for row in map(ask, asked) if row]
        if reached and min(reached) > asked[0]:
            ask(math.floor(2 * asked[0] - min(reached) - STEP))
        if reached and max(reached) < asked[-1]:
            ask(math.ceil(2 * asked[-1] - max(reached) + STEP))

    def measure(self, model, count):
        for peer in peers(self.args, model):
            self.point(model, count, *peer)
        if self.args.peers_only:
            return
        with tempfile.TemporaryDirectory() as folder:
            self.ours(model, count, WITH, ["--cameras", training(cameras_of(model), folder)])
        self.ours(model, count, WITHOUT, ["--no-cameras"])


def tables(rows, asked, times):
    good = [r for r in rows if "failed" not in r]
    codecs = [c for c in dict.fromkeys(r["codec"] for r in good) if c not in (WITH, WITHOUT)]
    kilobytes = lambda size: "-" if size is None else f"{size / 1000:,.0f}"
    lines = []
    for scene in dict.fromkeys(r["scene"] for r in good):
        of = [r for r in good if r["scene"] == scene]
        for decibels in asked:
            at = {c: cost([(r["psnr"], r["bytes"]) for r in of if r["codec"] == c], decibels) for c in [*codecs, WITH, WITHOUT]}
            best = min((at[c] for c in codecs if at[c]), default=None)
            ratio = {c: at[c] / best if at[c] and best else None for c in (WITHOUT, WITH)}
            cells = [scene, str(of[0]["width"]), f"{decibels:g}", kilobytes(at[WITHOUT]), kilobytes(at[WITH]), *(kilobytes(at[c]) for c in codecs)]
            cells += ["-" if r is None else f"{r:.2f}" for r in ratio.values()]
            lines.append((-(ratio[WITHOUT] or 0), cells))
    print("| scene | pixels | dB | lexisplat, nothing but the PLY | lexisplat, cameras | " + " | ".join(codecs)
          + " | without cameras over the best | with cameras over the best |")
    print("|" + "---|" * (7 + len(codecs)))
    for _, cells in sorted(lines, key=lambda line: line[0]):
        print(f"| {' | '.join(cells)} |")

    print("\n| scene | codec | points: setting, bytes a Gaussian @ dB (worst view) |\n|---|---|---|")
    for scene in dict.fromkeys(r["scene"] for r in rows):
        for codec in dict.fromkeys(r["codec"] for r in rows if r["scene"] == scene):
            of = [r for r in rows if (r["scene"], r["codec"]) == (scene, codec)]
            each = lambda r: f"{r['setting']}: " + (r.get("failed") or f"{r['bytes'] / r['gaussians']:.2f} @ {r['psnr']:.2f} ({r['worst']:.1f})")
            print(f"| {scene} | {codec} | {'; '.join(map(each, of))} |")

    print("\n| scene | codec | setting | dB | encode: CPU s | wall s | MiB | decode: CPU s | wall s | MiB |\n|---|---|---|---|---|---|---|---|---|---|")
    for scene in times:
        for codec in dict.fromkeys(r["codec"] for r in good if r["scene"] == scene):
            nearest = min((r for r in good if (r["scene"], r["codec"]) == (scene, codec)), key=lambda r: abs(r["psnr"] - MIDDLE))
            taken = [f"{nearest[way][key]:.{digits}f}" for way in ("encode", "decode") for key, digits in (("cpu", 2), ("wall", 1), ("mib", 0))]
            print(f"| {scene} | {codec} | {nearest['setting']} | {nearest['psnr']:.1f} | {' | '.join(taken)} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="+")
    parser.add_argument("--asked", nargs="+", type=float, default=[36, 40, 44])
    parser.add_argument("--node", default="node")
    parser.add_argument("--npm", type=Path)
    parser.add_argument("--spz", type=Path)
    parser.add_argument("--lgsc", type=Path)
    parser.add_argument("--sog", nargs="+", metavar="NAME", default=[])
    parser.add_argument("--limit", type=int, default=480)
    parser.add_argument("--binary", type=Path, default=ROOT / "target/release/lexisplat")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--peers-only", action="store_true", help="leave out ours")
    parser.add_argument("--times", nargs="+", default=["bonsai-3dgs", "room-large"], metavar="NAME", help="models of the table of seconds")
    parser.add_argument("--tables", nargs="+", type=Path, metavar="FILE", help="measure nothing, and print the tables of such files of --json")
    args = parser.parse_args()
    if args.tables:
        rows = {(r["scene"], r["codec"], r["setting"]): r for file in args.tables for r in json.loads(file.read_text())}
        tables(list(rows.values()), args.asked, args.times)
        return
    bench = Bench(args)
    for model in sorted(args.folder.glob("*.ply")):
        found = header(model)
        if found and cameras_of(model) and (not args.only or model.stem in args.only):
            bench.measure(model, found[1])
    tables(bench.rows, args.asked, args.times)


if __name__ == "__main__":
    main()
