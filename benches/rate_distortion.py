#!/usr/bin/env python3
"""Rate-distortion curves: other training-free codecs and ours, on the same scenes, drawn by one renderer.

    python3 benches/rate_distortion.py FOLDER [FOLDER ...] --lgsc BINARY --splat-transform BINARY
        [--packed | --peers-only] [--sog] [--only NAME ...] [--out DIR] [--cache DIR] [--lexisplat BINARY]

Every binary float PLY of the folders with at least 8000 Gaussians is encoded by each codec at each of its
settings, decoded back to a PLY, and that PLY is scored against the original with `lexisplat compare`: the
test split of `NAME.cameras.json` (NAME may be a prefix of the PLY's name), else an orbit of 12; at most 800
pixels wide, in float. Files whose SH take at most 256 values are left out (flowers-c3dgs-int8): they were
8-bit before they came here, so a codec of 8 bits would look lossless on them.

The others, all optional, none needs photos or training:
  splat-transform  npm install @playcanvas/splat-transform: SPZ v4, compressed.ply, SOG v2
  L-GSC            CMake build of github.com/qualcomm/lite-3Dgsplat-codec: BINARY is lgsc-api-example1
SOG's palette takes over 25 minutes for 90k Gaussians on a CPU, so it runs only under --sog; without it a
result in the cache is used, else NAME.sog beside NAME.ply. What the others made is kept in --cache (scores
are not: the renderer changes); ours is made anew each time.

Writes DIR/rate_distortion.csv, DIR/README.md and DIR/NAME.svg. Needs Python 3.11 alone. Exit status 1 if
any point failed; the rest is written all the same. Without --lexisplat, builds ours first.
"""

import argparse
import csv
import hashlib
import json
import math
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
import zipfile
from array import array
from collections import namedtuple
from datetime import date
from html import escape
from pathlib import Path

sys.dont_write_bytecode = True  # no __pycache__ in the working tree
from real_models import ROOT, WIDTH, views  # noqa: E402

# Our operating points: codec -> (setting, options of `compress`).
OURS = {"lexisplat f16": [(f"tol {t}", ["--tol", t]) for t in ("0.05", "0.1", "0.2")]}
OURS_PACKED = {
    "lexisplat packed": [
        (f"{p} dB", ["--layout", "packed", "--psnr", p]) for p in ("36", "38", "40", "42", "45", "48", "51")
    ]
}
# Fixed, so that a codec looks the same on every plot; ours are the warm ones.
COLOURS = {"lexisplat f16": "#c86400", "lexisplat packed": "#c8102e", "SPZ": "#0072b2", "L-GSC": "#00805f",
           "SOG": "#7b4ab3", "compressed.ply": "#555"}
LEVELS = (36, 38, 40, 42, 44, 46, 48)  # dB at which bytes are compared
SMALLEST = 8000  # Gaussians; below that headers and dictionaries are what is measured
ORBIT = "12"  # views where a scene has no test cameras
# 8-bit alpha decodes to a logit of infinity, which our reader refuses. sigmoid(20) is 1 in f32.
LARGEST_LOGIT = 20.0
FIELDS = ("scene gaussians codec version setting bytes bytes_per_gaussian "
          "psnr_mean psnr_min ssim_mean encode_seconds decode_seconds").split()

Codec = namedtuple("Codec", "name version setting file encode decode")  # encode, decode: paths -> command
Scene = namedtuple("Scene", "name path gaussians views digest")


def run(command):
    """Wall seconds, start-up and all, and what was printed; a failure says the line that begins "error"."""
    start = time.monotonic()
    done = subprocess.run([str(c) for c in command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if done.returncode:
        lines = [l for l in done.stderr.splitlines() if l.strip()] or [f"exit status {done.returncode}"]
        raise RuntimeError(next((l for l in lines if l.startswith("error")), lines[-1]))
    return time.monotonic() - start, done.stdout, done.stderr


def header(path):
    """(names, count, offset of the rows) of a binary little-endian PLY of floats alone, else None."""
    with open(path, "rb") as file:
        lines = []
        while not lines or lines[-1] != "end_header":
            line = file.readline(1000)
            if not line:
                return None
            lines.append(line.decode("latin-1").strip())
        offset = file.tell()
    words = [l.split() for l in lines if l]
    properties = [w for w in words if w[0] == "property"]
    elements = [w for w in words if w[0] == "element"]
    if ["format", "binary_little_endian", "1.0"] not in words or len(elements) != 1:
        return None
    if any(w[1] not in ("float", "float32") for w in properties):
        return None
    return [w[2] for w in properties], int(elements[0][2]), offset


def columns(path):
    names, count, offset = header(path)
    values = array("f")
    values.frombytes(Path(path).read_bytes()[offset:offset + 4 * count * len(names)])
    return {name: values[i::len(names)] for i, name in enumerate(names)}


def write_ply(path, table):
    count = len(next(iter(table.values())))
    values = array("f", bytes(4 * count * len(table)))
    for i, column in enumerate(table.values()):
        values[i::len(table)] = column
    properties = "".join(f"property float {name}\n" for name in table)
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{properties}end_header\n"
    Path(path).write_bytes(head.encode() + values.tobytes())


def inria(table):
    """The table in INRIA's order at degree 3. L-GSC takes f_rest in the order of the file, whatever the
    names say, and always 45 of them; Brush writes them in alphabetical order."""
    each = sum(name.startswith("f_rest_") for name in table) // 3
    if each > 15:
        raise RuntimeError("SH degree over 3")
    zeros = array("f", bytes(4 * len(table["x"])))
    rest = {f"f_rest_{15 * c + k}": table[f"f_rest_{each * c + k}"] if k < each else zeros
            for c in range(3) for k in range(15)}
    plain = {n: table[n] for n in "x y z f_dc_0 f_dc_1 f_dc_2".split()}
    others = {n: table[n] for n in "opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3".split()}
    return plain | rest | others


def finite_opacity(path):
    table = columns(path)
    if any(map(math.isinf, table["opacity"])):
        bound = LARGEST_LOGIT
        table["opacity"] = array("f", (math.copysign(bound, v) if math.isinf(v) else v for v in table["opacity"]))
        write_ply(path, table)


def scenes(folders, only, notes):
    for model in (m for folder in folders for m in sorted(folder.glob("*.ply"))):
        if only and model.stem not in only:
            continue
        head = header(model)
        if head is None or head[1] < SMALLEST:
            notes.append(f"{model.stem}: left out, " + ("not a PLY of floats" if head is None else f"{head[1]} Gaussians"))
            continue
        table = columns(model)
        if "f_rest_0" in table and len(set(table["f_rest_0"])) <= 256:
            notes.append(f"{model.stem}: left out, its SH were 8-bit already")
            continue
        seen = views(model, model.parent)
        digest = hashlib.sha256(model.read_bytes()).hexdigest()[:12]
        yield Scene(model.stem, model, head[1], ["--orbit", ORBIT] if "--orbit" in seen else seen, digest)


def peers(transform, lgsc):
    if transform:
        version = re.search(r"v(\d\S*)", "".join(run([transform, "--version"])[1:]))[1]
        convert = lambda a, b: [transform, "-q", "-w", "-g", "cpu", a, b]
        for name, file, setting in (("SPZ", "s.spz", "v4"), ("compressed.ply", "s.compressed.ply", ""), ("SOG", "s.sog", "v2")):
            yield Codec(name, version, setting, file, convert, convert)
    if lgsc:
        # The program prints 1.0 for every commit, so the binary itself is in the version.
        version = "1.0-" + hashlib.sha256(Path(lgsc).read_bytes()).hexdigest()[:8]
        for level in "012":
            yield Codec(
                "L-GSC", version, f"level {level}", "s.lgsc",
                lambda a, b, level=level: [lgsc, "--mode", 0, "--uncompressedDataPath", a, "--compressedStreamPath", b, "--compLevel", level],
                lambda a, b: [lgsc, "--mode", 1, "--compressedStreamPath", a, "--reconstructedDataPath", b, "--outputBinaryPly", 1],
            )


def peer_point(codec, scene, cache, sog):
    """(encoded, decoded, encode seconds or None, decode seconds, version) from the cache, filled if need be.
    None where SOG is neither wanted nor there."""
    def home(version):
        key = "-".join((scene.name, scene.digest, codec.name, version, codec.setting))
        return cache / re.sub(r"[^\w.-]+", "_", key)

    folder, version, ready = home(codec.version), codec.version, scene.path.with_suffix(".sog")
    if codec.name == "SOG" and not sog and not folder.exists():
        if not ready.exists():
            return None
        with zipfile.ZipFile(ready) as bundle:
            version = json.loads(bundle.read("meta.json")).get("asset", {}).get("generator", "?").split()[-1].lstrip("v")
        version += " (ready-made)"
        folder = home(version + hashlib.sha256(ready.read_bytes()).hexdigest()[:8])
    if not folder.exists():
        cache.mkdir(parents=True, exist_ok=True)
        # Made aside and renamed, so that a run cut short leaves nothing that looks finished.
        with tempfile.TemporaryDirectory(dir=cache) as aside:
            made = Path(aside) / "made"
            made.mkdir()
            encoded, decoded, source, encode = made / codec.file, made / "decoded.ply", scene.path, None
            if codec.name == "L-GSC":
                source = Path(aside) / "inria.ply"
                write_ply(source, inria(columns(scene.path)))
            if version == codec.version:
                encode, *_ = run(codec.encode(source, encoded))
            else:
                shutil.copyfile(ready, encoded)
            decode, *_ = run(codec.decode(encoded, decoded))
            finite_opacity(decoded)
            (made / "seconds.json").write_text(json.dumps([encode, decode]))
            made.rename(folder)
    return folder / codec.file, folder / "decoded.ply", *json.loads((folder / "seconds.json").read_text()), version


def scored(lexisplat, scene, codec, version, setting, encoded, decoded, encode, decode):
    score = json.loads(run([lexisplat, "compare", scene.path, decoded, "--json", "-q", "--width", WIDTH, *scene.views])[1])
    decibels = lambda v: math.inf if v is None else v
    size = Path(encoded).stat().st_size
    row = (scene.name, scene.gaussians, codec, version, setting, size, size / scene.gaussians,
           decibels(score["psnr"]["mean"]), decibels(score["psnr"]["min"]), score["ssim"]["mean"], encode, decode)
    print(f"{scene.name:16} {codec:18} {setting:10} {row[6]:7.2f} B/Gaussian {row[7]:6.2f} / {row[8]:.2f} dB", flush=True)
    return dict(zip(FIELDS, row))


def cost(points, decibels):
    """Bytes per Gaussian that reach `decibels` on the curve through (decibels, bytes) points: straight lines
    in log(bytes) between the points that no other beats, flat below the lowest, None above the highest."""
    front = []
    for quality, size in sorted(points, key=lambda p: (p[1], -p[0])):
        if not front or quality > front[-1][0]:
            front.append((quality, size))
    for i, (quality, size) in enumerate(front):
        if quality >= decibels:
            if i == 0 or math.isinf(quality):
                return size
            low, small = front[i - 1]
            return math.exp(math.log(small) + (decibels - low) / (quality - low) * math.log(size / small))
    return None


def curves(rows, column="psnr_mean"):
    found = {}
    for row in rows:
        found.setdefault(row["codec"], []).append((row[column], row["bytes_per_gaussian"]))
    return found


def plot(scene, rows):
    """An SVG: bytes per Gaussian, log, against mean PSNR; names and settings beside the points."""
    wide, high, left, right, top, bottom = 860, 560, 62, 24, 64, 56
    shown = [r for r in rows if math.isfinite(r["psnr_mean"])]
    sizes, dbs = [r["bytes_per_gaussian"] for r in shown], [r["psnr_mean"] for r in shown]
    low, far = math.log(min(sizes) / 1.25), math.log(max(sizes) * 1.3)
    floor, roof = math.floor(min(dbs) - 1.5), math.ceil(max(dbs) + 1.5)
    x = lambda b: left + (math.log(b) - low) / (far - low) * (wide - left - right)
    y = lambda d: high - bottom - (d - floor) / (roof - floor) * (high - top - bottom)
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide} {high}" width="{wide}" height="{high}" '
           'font-family="system-ui, -apple-system, Segoe UI, Helvetica, Arial, sans-serif" font-size="12">',
           f'<rect width="{wide}" height="{high}" fill="#fff"/>']
    text = lambda px, py, s, more="": out.append(f'<text x="{px:.1f}" y="{py:.1f}" {more}>{escape(s)}</text>')
    line = lambda x1, y1, x2, y2, colour: out.append(f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="{colour}"/>')
    text(left, 28, scene.name, 'font-size="18" font-weight="600" fill="#111"')
    seen = f"orbit of {ORBIT}" if "--orbit" in scene.views else "test views"
    text(left, 47, f"{scene.gaussians:,} Gaussians, {seen}; up and to the left is better", 'fill="#666"')
    # Round sizes, thinned from the left until 38 pixels lie between them.
    last = -math.inf
    for tick in sorted(m * 10 ** e for e in range(-1, 4) for m in (1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8)):
        if low <= math.log(tick) <= far and x(tick) - last >= 38:
            last = x(tick)
            line(last, top, last, high - bottom, "#ececec")
            text(last, high - bottom + 18, f"{tick:g}", 'text-anchor="middle" fill="#555"')
    step = next(s for s in (1, 2, 5, 10, 20) if (roof - floor) / s <= 12)
    for tick in range(-(-floor // step) * step, roof + 1, step):
        line(left, y(tick), wide - right, y(tick), "#ececec")
        text(left - 8, y(tick) + 4, str(tick), 'text-anchor="end" fill="#555"')
    line(left, high - bottom, wide - right, high - bottom, "#888")
    text((left + wide - right) / 2, high - 14, "bytes per Gaussian (log scale)", 'text-anchor="middle" fill="#333"')
    text(0, 0, "mean PSNR, dB", f'transform="translate(18 {(top + high - bottom) / 2:.0f}) rotate(-90)" text-anchor="middle" fill="#333"')

    colour = lambda codec: COLOURS.get(codec, "#333")
    drawn, taken = {}, []
    for row in shown:
        drawn.setdefault(row["codec"], []).append((x(row["bytes_per_gaussian"]), y(row["psnr_mean"]), row["setting"]))
    for codec, points in drawn.items():
        points.sort()
        path = " ".join(f"{px:.1f},{py:.1f}" for px, py, _ in points)
        out.append(f'<polyline points="{path}" fill="none" stroke="{colour(codec)}" stroke-width="{2.6 if codec.startswith("lexisplat") else 1.8}"/>')
        out.extend(f'<circle cx="{px:.1f}" cy="{py:.1f}" r="4.2" fill="{colour(codec)}" stroke="#fff" stroke-width="1.2"/>' for px, py, _ in points)
        taken += [(px - 6, py - 6, px + 6, py + 6) for px, py, _ in points]
        for (ax, ay, _), (bx, by, _) in zip(points, points[1:]):
            pieces = max(2, int(math.hypot(bx - ax, by - ay) / 6))
            middles = [(ax + (bx - ax) * i / pieces, ay + (by - ay) * i / pieces) for i in range(pieces)]
            taken += [(mx - 3, my - 3, mx + 3, my + 3) for mx, my in middles]

    def label(px, py, s, size, more):
        """Puts the text where it covers least: right, left, above, below, then the corners, then farther."""
        w, best = 0.64 * size * len(s), None
        for far_off in (9, 15, 22, 32):
            near, up, down = 0.7 * far_off, py - far_off, py + far_off + 0.7 * size
            spots = [("start", px + far_off, py + size / 3), ("end", px - far_off, py + size / 3), ("middle", px, up), ("middle", px, down)]
            spots += [(anchor, px + sign * near, by) for anchor, sign in (("start", 1), ("end", -1)) for by in (up + 0.3 * far_off, down - 0.3 * far_off)]
            for anchor, bx, by in spots:
                start = bx - {"start": 0, "middle": w / 2, "end": w}[anchor]
                box = (start - 2, by - size, start + w + 2, by + 0.3 * size)
                inside = left < box[0] and box[2] < wide - 4 and top - 10 < box[1] and box[3] < high - bottom
                hits = sum(box[0] < t[2] and t[0] < box[2] and box[1] < t[3] and t[1] < box[3] for t in taken) + 100 * (not inside)
                if best is None or hits < best[0]:
                    best = hits, box, bx, by, anchor
        taken.append(best[1])
        # A white rim keeps the letters legible over grid lines.
        text(best[2], best[3], s, f'text-anchor="{best[4]}" font-size="{size}" paint-order="stroke" stroke="#fff" stroke-width="3" {more}')

    for codec, points in drawn.items():  # names first: they need the room
        name = codec if len(points) > 1 else f"{codec} {points[0][2]}".strip()
        label(*points[-1][:2], name, 14, f'font-weight="600" fill="{colour(codec)}"')
    for codec, points in drawn.items():
        for px, py, setting in points if len(points) > 1 else ():
            label(px, py, setting, 11, f'fill="{colour(codec)}"')
    return "\n".join(out + ["</svg>\n"])


def report(scene, rows):
    """The scene's part of README.md: the points, then ours against the cheapest other codec."""
    seconds = lambda v: "" if v is None else f"{v:.2f}"
    lines = [f"## {scene.name}", "", f"{scene.gaussians:,} Gaussians; " + " ".join(Path(str(v)).name for v in scene.views).lstrip("-") + ".", "",
             f"![{scene.name}]({scene.name}.svg)", "",
             "| codec | version | setting | bytes | bytes / Gaussian | PSNR mean / min | SSIM | encode, s | decode, s |", "|---|---|---|---|---|---|---|---|---|"]
    for r in sorted(rows, key=lambda r: (r["codec"], r["bytes"])):
        lines.append(f"| {r['codec']} | {r['version']} | {r['setting']} | {r['bytes']:,} | {r['bytes_per_gaussian']:.2f} | {r['psnr_mean']:.2f} / {r['psnr_min']:.2f} "
                     f"| {r['ssim_mean']:.4f} | {seconds(r['encode_seconds'])} | {seconds(r['decode_seconds'])} |")
    for title, column in (("mean", "psnr_mean"), ("minimum", "psnr_min")):
        found = curves(rows, column)
        ours = [c for c in found if c.startswith("lexisplat")]
        others = [c for c in found if c not in ours]
        if not others:
            continue
        lines += ["", f"At equal {title} PSNR, bytes per Gaussian (ours: ratio to the best of the others):", "",
                  "| dB | best of the others |" + "".join(f" {c} |" for c in ours), "|---|---|" + "---|" * len(ours)]
        for level in LEVELS:
            costs = [(cost(found[c], level), c) for c in others]
            best = min((c for c in costs if c[0] is not None), default=None)
            cells = [f"{best[1]} {best[0]:.2f}" if best else "none reaches it"]
            for mine in (cost(found[c], level) for c in ours):
                cells.append("" if mine is None else f"{mine:.2f}" + (f" ({mine / best[0]:.3f})" if best else ""))
            lines.append(f"| {level} | " + " | ".join(cells) + " |")
    return lines + [""]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", type=Path, nargs="+", metavar="FOLDER")
    parser.add_argument("--out", type=Path, default=Path("rate_distortion"))
    parser.add_argument("--cache", type=Path, default=Path(tempfile.gettempdir()) / "rate_distortion_cache")
    parser.add_argument("--lgsc", type=Path, help="L-GSC's lgsc-api-example1")
    parser.add_argument("--splat-transform", default=shutil.which("splat-transform"))
    parser.add_argument("--lexisplat", type=Path, help="use this program and do not build")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="scenes, by file name without .ply")
    parser.add_argument("--packed", action="store_true", help="also our packed layout")
    parser.add_argument("--peers-only", action="store_true", help="leave out ours")
    parser.add_argument("--sog", action="store_true", help="run SOG's palette (very slow)")
    args = parser.parse_args()
    if not args.lexisplat:
        subprocess.run(["cargo", "build", "--release", "-q"], cwd=ROOT, check=True)
    lexisplat = args.lexisplat or ROOT / "target/release/lexisplat"
    own = {} if args.peers_only else OURS | (OURS_PACKED if args.packed else {})
    our_version = run([lexisplat, "--version"])[1].split()[-1]
    rows, parts, notes, failures = [], [], [], []
    args.out.mkdir(parents=True, exist_ok=True)
    notes += [f"no {name}: its program was not given" for name, given in (("L-GSC", args.lgsc), ("splat-transform", args.splat_transform)) if not given]
    others = list(peers(args.splat_transform, args.lgsc))

    for scene in scenes(args.folders, args.only, notes):
        here = []
        for codec in others:
            try:
                point = peer_point(codec, scene, args.cache, args.sog)
                if point is None:
                    notes.append(f"{scene.name}: no SOG, which runs only under --sog")
                    continue
                here.append(scored(lexisplat, scene, codec.name, point[4], codec.setting, *point[:4]))
            except RuntimeError as error:
                failures.append(f"{scene.name}, {codec.name} {codec.setting}: {error}")
        for name, points in own.items():
            for setting, options in points:
                with tempfile.TemporaryDirectory() as folder:
                    small, back = f"{folder}/s.lexi", f"{folder}/b.ply"
                    try:
                        encode, *_ = run([lexisplat, "compress", scene.path, "-o", small, "-q", *options])
                        decode, *_ = run([lexisplat, "decompress", small, "-o", back, "-q"])
                        here.append(scored(lexisplat, scene, name, our_version, setting, small, back, encode, decode))
                    except RuntimeError as error:
                        failures.append(f"{scene.name}, {name} {setting}: {error}")
        rows += here
        if any(math.isfinite(r["psnr_mean"]) for r in here):
            (args.out / f"{scene.name}.svg").write_text(plot(scene, here))
        parts += report(scene, here)

    with open(args.out / "rate_distortion.csv", "w", newline="") as file:
        table = csv.DictWriter(file, FIELDS)
        table.writeheader()
        table.writerows(rows)
    # Where things lie on the machine this ran on says nothing.
    command = shlex.join(["python3", "benches/rate_distortion.py", *(Path(a).name if "/" in a else a for a in sys.argv[1:])])
    top = ["# Rate and distortion", "", f"{date.today()}, by", "", f"    {command}", "",
           "PSNR and SSIM are against the original's own pictures. Bytes are whole files. Seconds are wall time of the whole program, start-up and reading included; "
           "those of the other codecs are from the day their file entered the cache. Curves are straight in log(bytes) between a codec's own points, flat below its cheapest and absent above its best; "
           "points that another point of the same codec beats are left out. L-GSC is given the scene in INRIA's property order, the only one it reads; "
           f"infinite opacities, which 8-bit alpha decodes to, are drawn as a logit of {LARGEST_LOGIT:g}.", ""]
    top += [f"- {note}" for note in notes + [f"failed: {f}" for f in failures]] + [""]
    (args.out / "README.md").write_text("\n".join(top + parts))
    for failure in failures:
        print(f"failed: {failure}", file=sys.stderr)
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
