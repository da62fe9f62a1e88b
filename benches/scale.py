"""What many tiles cost: rates and bytes by workers, killed workers, memory, and bytes against other ways to pack. docs/results/scale.md
has what it printed. Needs the Python package with Ray, and the program in $LEXISPLAT_PROGRAM.

    scale.py make MODELS FOLDER --tiles 8       makes tiles of about 250,000 Gaussians of the real models
    scale.py workers FOLDER                     1, 2 and 4 workers, and the program
    scale.py kills FOLDER                       ten runs with a worker killed in each
    scale.py memory FOLDER                      most memory of a worker
    scale.py bytes FOLDER                       against each tile by itself and the whole in one piece, at equal PSNR
"""

import argparse
import hashlib
import json
import math
import os
import random
import signal
import subprocess
import sys
import threading
import time
import warnings
from pathlib import Path

import lexisplat as lx
import numpy as np

PROGRAM = os.environ.get("LEXISPLAT_PROGRAM", "lexisplat")
#: The models that tiles are made of, and their distance in a tile and that of tiles, in world units.
MIXES = [
    ["bonsai-3dgs", "bonsai-pixelgs", "snowmiku-mcmc"],
    ["bonsai-3dgs", "room", "fern", "lego", "flowers-c3dgs-int8"],
    ["bonsai-pixelgs", "snowmiku-mcmc", "room", "lego"],
    ["snowmiku-mcmc", "bonsai-3dgs", "room", "fern"],
]
APART, TILE = 25.0, 60.0
#: Views like photographs of each tile by which files are compared.
VIEWS = 6
NAMES = ("means", "scales", "quats", "opacities", "sh0", "shN")


def make(models: Path, folder: Path, tiles: int) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    loaded = {name: lx.load(models / f"{name}.ply") for mix in MIXES for name in mix}
    side = math.ceil(math.sqrt(tiles))
    for t in range(tiles):
        parts = [loaded[name] for name in MIXES[t % len(MIXES)]]
        arrays = {name: np.concatenate([getattr(part, name) for part in parts]) for name in NAMES}
        corner = [[TILE * (t % side) + APART * (k % 2), TILE * (t // side) + APART * (k // 2), 0.3 * t] for k in range(len(parts))]
        arrays["means"] = np.concatenate([part.means + np.float32(at) for part, at in zip(parts, corner)])
        lx.save(folder / f"tile-{t:03}.ply", lx.Splats(**arrays))


def checksum(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:12]


def inputs(folder: Path) -> list[Path]:
    return sorted(folder.glob("tile-*.ply"))


def compress(folder: Path, out: Path, workers: int, **options: object) -> dict:
    """Compresses on so many workers of one thread; in a process of its own, so that Ray begins anew."""
    code = (
        "import json, sys, time, ray, lexisplat.ray\n"
        "given = json.loads(sys.argv[1])\n"
        "ray.init(num_cpus=given['workers'], include_dashboard=False, log_to_driver=False, logging_level='error')\n"
        "clock = time.monotonic()\n"
        "report = lexisplat.ray.compress(given['folder'], given['out'], overwrite=True, **given['options'])\n"
        "print(json.dumps({**report, 'clock': time.monotonic() - clock}))\n"
    )
    given = {"folder": str(folder), "out": str(out), "workers": workers, "options": options}
    done = subprocess.run([sys.executable, "-c", code, json.dumps(given)], capture_output=True, text=True)
    if done.returncode:
        sys.exit(done.stderr)
    return json.loads(done.stdout.splitlines()[-1])


def by_program(tiles: list[Path], out: Path, *options: str) -> float:
    clock = time.monotonic()
    command = [PROGRAM, "compress", *map(str, tiles), "-o", str(out), "--overwrite", "--quiet", *options]
    subprocess.run(command, check=True)
    return time.monotonic() - clock


def workers(folder: Path, scratch: Path) -> None:
    print("| who | seconds | Gaussians a second | bytes | checksum | traffic: statistics, state, results |\n|---|---|---|---|---|---|")
    for count in (1, 2, 4):
        out = scratch / f"{count}.lexi"
        report = compress(folder, out, count)
        rate = (report["gaussians"] + report["removed"]) / report["clock"]
        moved = ", ".join(f"{report['traffic'][name] / 1e6:.1f} MB" for name in ("statistics", "state", "results"))
        print(f"| {count} workers | {report['clock']:.1f} | {rate:,.0f} | {out.stat().st_size:,} | {checksum(out)} | {moved} |", flush=True)
    for threads in (1, 2):
        out = scratch / "program.lexi"
        seconds = by_program(inputs(folder), out, "--memory", "1MB", "--threads", str(threads))
        print(f"| the program, {threads} threads | {seconds:.1f} | | {out.stat().st_size:,} | {checksum(out)} | |", flush=True)


def processes() -> list[tuple[int, str]]:
    """Workers of Ray: their numbers and titles."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            title = (process / "cmdline").read_bytes().split(b"\0")[0].decode()
        except OSError:
            continue
        if title.startswith("ray::") and "Agent" not in title:
            found.append((int(process.name), title))
    return found


def kills(folder: Path, scratch: Path, runs: int) -> None:
    whole = compress(folder, scratch / "whole.lexi", 2)["clock"]
    expected, chance = checksum(scratch / "whole.lexi"), random.Random(7)
    print(f"expected {expected}, {whole:.1f} s\n\n| run | killed | seconds | checksum |\n|---|---|---|---|")
    for run in range(runs):
        at, killed = chance.uniform(0.05, 0.95) * whole, []

        def kill() -> None:
            # Ray itself needs some seconds before the work begins.
            begun = time.monotonic()
            while not processes() and time.monotonic() - begun < 60:
                time.sleep(0.05)
            time.sleep(at)
            while not killed and time.monotonic() - begun < 600:
                busy = [process for process in processes() if process[1] != "ray::IDLE"]
                if busy:
                    number, title = chance.choice(busy)
                    os.kill(number, signal.SIGKILL)
                    killed.append(f"{title} after {at:.1f} s")
                time.sleep(0.05)

        thread = threading.Thread(target=kill)
        thread.start()
        out = scratch / "killed.lexi"
        report = compress(folder, out, 2)
        thread.join()
        print(f"| {run} | {', '.join(killed)} | {report['clock']:.1f} | {checksum(out)} |", flush=True)


def memory(folder: Path, scratch: Path) -> None:
    most: dict[str, int] = {}
    over = threading.Event()

    def watch() -> None:
        while not over.wait(0.3):
            for number, title in processes():
                try:
                    lines = Path(f"/proc/{number}/status").read_text().splitlines()
                except OSError:
                    continue
                sizes = {line.split(":")[0]: int(line.split()[1]) for line in lines if line.startswith(("VmRSS", "RssAnon", "RssFile"))}
                for kind, size in sizes.items():
                    most[kind] = max(most.get(kind, 0), size)

    thread = threading.Thread(target=watch)
    thread.start()
    report = compress(folder, scratch / "memory.lexi", 2)
    over.set()
    thread.join()
    count = report["gaussians"] + report["removed"]
    sizes = ", ".join(f"{kind} {size / 2**20:.2f} GiB" for kind, size in sorted(most.items()))
    print(report["stages"])
    print(f"{count:,} Gaussians in {report['clock']:.1f} s, {report['file_bytes']:,} bytes; most of a worker: {sizes}; traffic {report['traffic']}")


def scores(original: Path, cameras: Path, file: Path) -> float:
    command = [PROGRAM, "compare", str(original), str(file), "--cameras", str(cameras), "--json", "--quiet"]
    return json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)["psnr"]["mean"]


def compare(folder: Path, scratch: Path) -> None:
    tiles = inputs(folder)
    whole, cameras = scratch / "whole.ply", scratch / "cameras.json"
    subprocess.run([PROGRAM, "convert", *map(str, tiles), str(whole), "--overwrite", "--quiet"], check=True)
    views = [view for tile in tiles for view in lx.photographs(lx.load(tile), VIEWS)]
    of = lambda k, v: {"id": k, "img_name": f"{k}", "width": v.width, "height": v.height, "fx": v.fx, "fy": v.fy,
                       "position": np.asarray(v.position).tolist(), "rotation": np.asarray(v.rotation).tolist()}  # fmt: skip
    cameras.write_text(json.dumps([of(k, view) for k, view in enumerate(views)]))
    curves: dict[str, list[tuple[float, int]]] = {}
    print("| how | preset | bytes | PSNR, dB |\n|---|---|---|---|")

    def add(how: str, preset: str, size: int, file: Path) -> None:
        curves.setdefault(how, []).append((scores(whole, cameras, file), size))
        print(f"| {how} | {preset} | {size:,} | {curves[how][-1][0]:.2f} |", flush=True)

    for preset in ("small", "balanced", "high"):
        out = scratch / "tiles.lexi"
        by_program(tiles, out, "--memory", "1MB", "--preset", preset)
        add("tiles, one dictionary", preset, out.stat().st_size, out)
    for preset in ("small", "balanced"):
        out = scratch / "piece.lexi"
        by_program([whole], out, "--memory", "16GiB", "--preset", preset)
        add("the whole in one piece", preset, out.stat().st_size, out)
        each = [scratch / f"{tile.stem}.lexi" for tile in tiles]
        for tile, path in zip(tiles, each):
            by_program([tile], path, "--preset", preset)
        joined = scratch / "joined.ply"
        subprocess.run([PROGRAM, "convert", *map(str, each), str(joined), "--overwrite", "--quiet"], check=True)
        add("each tile by itself", preset, sum(path.stat().st_size for path in each), joined)
    ours = sorted(curves.pop("tiles, one dictionary"))
    at = lambda psnr: math.exp(np.interp(psnr, [p for p, _ in ours], [math.log(size) for _, size in ours]))
    for how, points in curves.items():
        for psnr, size in points:
            print(f"{how}: at {psnr:.2f} dB ours are {100 * (at(psnr) / size - 1):+.1f} % of its {size:,} bytes")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["make", "workers", "kills", "memory", "bytes"])
    parser.add_argument("paths", nargs="+", type=Path)
    parser.add_argument("--tiles", type=int, default=8)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--scratch", type=Path, default=Path("scale-scratch"))
    given = parser.parse_args()
    warnings.simplefilter("ignore", lx.LexisplatWarning)
    if given.what == "make":
        return make(given.paths[0], given.paths[1], given.tiles)
    folder = given.paths[0].resolve()
    scratch = given.scratch.resolve()
    scratch.mkdir(exist_ok=True)
    steps = {"workers": workers, "memory": memory, "bytes": compare}
    if given.what == "kills":
        return kills(folder, scratch, given.runs)
    steps[given.what](folder, scratch)


if __name__ == "__main__":
    main()
