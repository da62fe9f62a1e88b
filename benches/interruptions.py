#!/usr/bin/env python3
"""Kills compress at random moments and damages whole outputs, and counts what that leaves, as Markdown.

    cargo build --release -p lexisplat-cli --no-default-features
    target/release/lexisplat demo --gaussians 3000 --output demo
    python3 benches/interruptions.py demo/scene.ply FOLDER [--signal KILL|TERM|INT|HUP] [--runs 200]
        [--ways f16,packed,parts]

FOLDER must be empty and takes the outputs, which are deleted again. Every way to compress is run undisturbed
first; then it is killed at moments spread evenly at random over the time that took and a tenth more, in turn
with no output there and with one to replace. Afterwards the output must be as before, or byte for byte what
the undisturbed run made. A fifth of the outputs is then cut or has a bit flipped, at random offsets: `info`
and `decompress` must refuse each. Linux and macOS.
"""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time

BINARY = os.path.abspath(os.environ.get("LEXISPLAT", "target/release/lexisplat"))
# Where a scene is looked at from two small views, which takes no time.
CAMERAS = [
    {
        "id": i,
        "img_name": str(i),
        "width": 64,
        "height": 48,
        "fx": 60,
        "fy": 60,
        "position": [0.5 * i, 0, -3],
        "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    }
    for i in range(2)
]
# The last has less memory than any scene takes, so that it is packed in parts.
WAYS = {
    "f16": ["--layout", "f16"],
    "packed": ["--layout", "packed", "--cameras", "CAMERAS"],
    "parts": ["--layout", "packed", "--memory", "100kB"],
}
OLD = b"what was there before"
SLACK = 1.1
# Exit code for a damaged file.
DAMAGED = 4


def start(arguments):
    return subprocess.Popen([BINARY, *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)


def read(path):
    try:
        with open(path, "rb") as file:
            return file.read()
    except FileNotFoundError:
        return None


def write(path, data):
    with open(path, "wb") as file:
        file.write(data)


class Folder:
    """The outputs' folder."""

    def __init__(self, path):
        self.path = path
        if os.listdir(path):
            sys.exit(f"{path} is not empty")

    def at(self, name):
        return os.path.join(self.path, name)

    def clear(self):
        for name in os.listdir(self.path):
            os.remove(self.at(name))


def kills(scene, folder, options, number, runs, rng):
    """Counts of a way to compress; bytes and seconds of an undisturbed run."""
    output = folder.at("out.lexi")
    arguments = ["compress", scene, "-o", output, "--quiet", "--overwrite", *options]
    clock = time.monotonic()
    child = start(arguments)
    if child.wait() != 0:
        sys.exit(child.stderr.read().decode())
    seconds = time.monotonic() - clock
    whole = read(output)
    counts = dict.fromkeys(["killed", "as before", "whole", "half", "leftovers", "wrong codes"], 0)
    for run in range(runs):
        folder.clear()
        before = OLD if run % 2 else None
        if before:
            write(output, before)
        child = start(arguments)
        time.sleep(rng.random() * SLACK * seconds)
        child.send_signal(number)
        child.communicate()
        found = read(output)
        killed = child.returncode != 0
        counts["killed"] += killed
        counts["as before" if found == before else "whole" if found == whole else "half"] += 1
        counts["leftovers"] += len(set(os.listdir(folder.path)) - {"out.lexi"})
        # A run that ended well has an output; one that was killed ended by the signal.
        counts["wrong codes"] += child.returncode != -number if killed else found != whole
    folder.clear()
    return counts, whole, seconds


def damages(folder, whole, runs, rng):
    """Damaged outputs tried, and how often `info` and `decompress` took one."""
    damaged, back = folder.at("damaged.lexi"), folder.at("back.ply")
    accepted = {"info": 0, "decompress": 0}
    for run in range(runs):
        data = bytearray(whole)
        if run % 2:
            del data[rng.randrange(len(data)) :]
        else:
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        write(damaged, data)
        for command, arguments in [("info", [damaged]), ("decompress", [damaged, "-o", back])]:
            child = start([command, *arguments])
            child.communicate()
            accepted[command] += child.returncode != DAMAGED or os.path.exists(back)
        folder.clear()
    return accepted


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("scene")
    parser.add_argument("folder")
    parser.add_argument("--signal", default="KILL", choices=["KILL", "TERM", "INT", "HUP"])
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--ways", default=",".join(WAYS), help="parts is packed with little --memory")
    args = parser.parse_args()
    folder = Folder(args.folder)
    rng = random.Random(args.seed)
    number = getattr(signal, f"SIG{args.signal}")
    print(
        "| way | seconds undisturbed | runs | ended by the signal | output as before | output whole "
        "| half outputs | leftovers | wrong exit codes | damaged files tried | taken by info, decompress |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    bad = 0
    cameras = tempfile.NamedTemporaryFile("w", suffix=".json")
    json.dump(CAMERAS, cameras)
    cameras.flush()
    for name in args.ways.split(","):
        options = [cameras.name if option == "CAMERAS" else option for option in WAYS[name]]
        counts, whole, seconds = kills(args.scene, folder, options, number, args.runs, rng)
        tried = max(1, args.runs // 5)
        accepted = damages(folder, whole, tried, rng)
        bad += counts["half"] + counts["leftovers"] + counts["wrong codes"] + sum(accepted.values())
        print(
            f"| {name}, SIG{args.signal} | {seconds:.2f} | {args.runs} | {counts['killed']} | {counts['as before']} "
            f"| {counts['whole']} | {counts['half']} | {counts['leftovers']} | {counts['wrong codes']} "
            f"| {tried} | {accepted['info']}, {accepted['decompress']} |",
            flush=True,
        )
    sys.exit(1 if bad else 0)


main()
