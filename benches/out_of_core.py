#!/usr/bin/env python3
"""Time and memory of compress, decompress and info on a scene larger than memory, as Markdown.

    cargo build --release -p lexisplat-cli --no-default-features
    cargo run --release -p lexisplat --example huge_ply -- MODEL.ply 20000000 huge.ply
    python3 benches/out_of_core.py huge.ply FOLDER [LAYOUT ...]

FOLDER takes the outputs, which are deleted again. Memory is RssAnon of /proc, looked at 20 times a second:
pages of mapped files are not in it, since the system takes them back when it likes. Layouts are f16,
packed, and guess, which is packed with --guess, unless named. The scene must be too large for --memory, or packing holds it. Packing needs as much
disk as the scene beside it. Linux only.
"""

import json
import os
import subprocess
import sys
import threading
import time

BINARY = os.environ.get("LEXISPLAT", "target/release/lexisplat")
INTERVAL = 0.05


def measure(arguments):
    """Runs the program; its JSON, seconds, and peak of RssAnon in MiB."""
    start = time.monotonic()
    process = subprocess.Popen([BINARY, "--json", "--overwrite", *arguments], stdout=subprocess.PIPE)
    peak = 0

    def watch():
        nonlocal peak
        while process.poll() is None:
            try:
                with open(f"/proc/{process.pid}/status") as status:
                    for line in status:
                        if line.startswith("RssAnon:"):
                            peak = max(peak, int(line.split()[1]))
            except FileNotFoundError:
                return
            time.sleep(INTERVAL)

    watcher = threading.Thread(target=watch)
    watcher.start()
    output = process.stdout.read()
    watcher.join()
    if process.wait() != 0:
        sys.exit(f"{' '.join(arguments)}: exit code {process.returncode}")
    return json.loads(output), time.monotonic() - start, peak / 1024


def main():
    scene, folder = sys.argv[1], sys.argv[2]
    layouts = sys.argv[3:] or ["f16", "packed", "guess"]
    print("| command | layout | Gaussians | seconds | million a second | peak RssAnon, MiB | output bytes | load |")
    print("|---|---|---|---|---|---|---|---|")

    def row(name, layout, arguments, output):
        report, seconds, peak = measure(arguments)
        count = report["gaussians"]
        size = f"{os.path.getsize(output):,}" if output else ""
        load = os.getloadavg()[0]
        print(
            f"| {name} | {layout} | {count:,} | {seconds:.1f} | {count / seconds / 1e6:.2f} | {peak:.0f} "
            f"| {size} | {load:.1f} |",
            flush=True,
        )

    row("info", "PLY", ["info", scene], None)
    for layout in layouts:
        small = os.path.join(folder, f"out_of_core.{layout}.lexi")
        back = os.path.join(folder, f"out_of_core.{layout}.ply")
        how = ["--guess"] if layout == "guess" else ["--layout", layout]
        row("compress", layout, ["compress", scene, "-o", small, *how], small)
        row("info", layout, ["info", small], None)
        row("decompress", layout, ["decompress", small, "-o", back], back)
        os.remove(back)
        os.remove(small)


main()
