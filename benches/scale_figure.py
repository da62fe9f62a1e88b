"""Draws docs/images/scale.svg: seconds by Gaussians for numbers of workers, by the model of docs/SCALE.md, and what was measured.

    scale_figure.py [docs/images/scale.svg]         needs matplotlib
"""

import sys

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt
import numpy as np

#: Gaussians of a bucket.
BUCKET = 262_144
#: Seconds of a bucket on one thread: in tasks, and in the process that calls. Seconds of a scene: drawing samples of a bucket, of
#: which there are at most 32 in two groups, and learning.
TASKS, CALLER, DRAW, LEARN = 9.7, 0.06, 0.36, 1.0
#: Gaussians, workers and seconds that were measured (docs/results/scale.md).
MEASURED = [(1_894_752, 1, 80.8), (1_894_752, 2, 44.7), (20_124_818, 2, 684.7)]
WORKERS = [1, 2, 10, 100, 1000]


def seconds(gaussians, workers):
    buckets = np.ceil(np.asarray(gaussians, float) / BUCKET)
    return TASKS * np.ceil(buckets / workers) + CALLER * buckets + DRAW * np.minimum(buckets, 32) / 2 + LEARN


def main(path):
    plt.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "lexisplat", "font.size": 10})
    figure, axes = plt.subplots(figsize=(7.2, 4.2))
    gaussians = np.logspace(6, 9.3, 200)
    for workers in WORKERS:
        (line,) = axes.plot(gaussians, seconds(gaussians, workers), label=f"{workers:,} worker{'s' * (workers > 1)}")
        points = [(n, s) for n, w, s in MEASURED if w == workers and s]
        axes.plot([n for n, _ in points], [s for _, s in points], "o", color=line.get_color())
    axes.set(xscale="log", yscale="log", xlabel="Gaussians", ylabel="seconds", ylim=(5, 2e5))
    for mark, name in ((60, "a minute"), (3600, "an hour"), (86400, "a day")):
        axes.axhline(mark, color="0.85", zorder=0)
        axes.text(1.05e6, mark * 1.08, name, color="0.5", fontsize=8)
    axes.grid(axis="x", color="0.92")
    axes.legend(frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0), title="dots were measured")
    figure.tight_layout()
    figure.savefig(path, metadata={"Date": None})


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "docs/images/scale.svg")
