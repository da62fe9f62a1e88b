#!/usr/bin/env python3
"""Frames a second beside gsplat and the 3DGS authors' rasteriser: same GPU, model and views, in one run.

    pip install torch numpy gsplat==1.5.3
    pip install git+https://github.com/graphdeco-inria/diff-gaussian-rasterization@59f5f77
    python3 benches/beside_gsplat.py MODEL.ply CAMERAS.json [--split test] [--width 1600] [--repeat 100]

Every view is drawn `--repeat` times after 10 that do not count, and only drawing is timed: by CUDA events
there, by time stamps here. Both peers get activated values, as their own viewers hand over. A peer that is
not installed, or a machine without CUDA, is named in the output and left out; `lexisplat bench` runs all
the same. Pictures are compared too: a rasteriser that draws something else is no comparison.
"""

import argparse
import json
import statistics
import subprocess
from array import array
from pathlib import Path

from real_models import ROOT, lexisplat, rows

WARMUP = 10
NEAR, FAR = 0.2, 1e10


def load_cameras(path, split, most):
    """Pinhole cameras as (name, width, height, fx, fy, world-to-view 4 x 4 as rows)."""
    out = []
    for camera in json.loads(Path(path).read_text()):
        if split != "all" and camera.get("split") != split:
            continue
        scale = min(1.0, most / camera["width"])
        width = round(camera["width"] * scale)
        height = max(1, int(camera["height"] * scale + 0.5))
        fx, fy = (camera[f] * size / camera[side] for f, size, side in (("fx", width, "width"), ("fy", height, "height")))
        turn, at = camera["rotation"], camera["position"]
        # The file holds camera-to-world; its transpose turns the other way.
        rotation = [[turn[j][i] for j in range(3)] for i in range(3)]
        view = [row + [-sum(r * p for r, p in zip(row, at))] for row in rotation] + [[0.0, 0.0, 0.0, 1.0]]
        out.append((camera["img_name"], width, height, fx, fy, view))
    return out


def load_model(path):
    """Columns of a PLY of floats, and coefficients of SH a channel."""
    names, values = rows(path)
    width = len(names)
    columns = {name: values[i::width] for i, name in enumerate(names)}
    rest = sum(name.startswith("f_rest_") for name in names)
    return columns, rest // 3


def as_tensors(columns, per_channel, torch):
    def stack(*names):
        parts = [torch.frombuffer(array("f", columns[name]), dtype=torch.float32) for name in names]
        return torch.stack(parts, dim=1).contiguous().cuda()

    dc = stack(*(f"f_dc_{c}" for c in range(3)))[:, None, :]
    rest = stack(*(f"f_rest_{k}" for k in range(3 * per_channel))) if per_channel else dc[:, :0, :].flatten(1)
    rest = rest.reshape(len(dc), 3, per_channel).transpose(1, 2)
    return {
        "means": stack("x", "y", "z"),
        "scales": stack(*(f"scale_{k}" for k in range(3))).exp(),
        "quats": torch.nn.functional.normalize(stack(*(f"rot_{k}" for k in range(4)))),
        "opacities": stack("opacity")[:, 0].sigmoid(),
        "sh": torch.cat([dc, rest], dim=1).contiguous(),
    }


def timed(torch, draw, repeat):
    """Milliseconds of each of `repeat` calls."""
    for _ in range(WARMUP):
        draw()
    out = []
    for _ in range(repeat):
        start, end = (torch.cuda.Event(enable_timing=True) for _ in range(2))
        start.record()
        draw()
        end.record()
        torch.cuda.synchronize()
        out.append(start.elapsed_time(end))
    return out


def gsplat_drawer(model, degree, torch):
    from gsplat import rasterization

    def drawer(camera):
        _, width, height, fx, fy, view = camera
        matrix = torch.tensor([view], device="cuda")
        k = torch.tensor([[[fx, 0, width / 2], [0, fy, height / 2], [0, 0, 1]]], device="cuda")
        return lambda: rasterization(model["means"], model["quats"], model["scales"], model["opacities"],
                                     model["sh"], matrix, k, width, height, near_plane=NEAR,
                                     sh_degree=degree, packed=False)[0][0]
    return drawer


def inria_drawer(model, degree, torch):
    from diff_gaussian_rasterization import GaussianRasterizationSettings, GaussianRasterizer

    def drawer(camera):
        _, width, height, fx, fy, view = camera
        tan = (width / (2 * fx), height / (2 * fy))
        world = torch.tensor(view, device="cuda").T.contiguous()
        projection = torch.zeros(4, 4, device="cuda")
        projection[0, 0], projection[1, 1] = 1 / tan[0], 1 / tan[1]
        projection[2, 2], projection[2, 3], projection[3, 2] = 1.0, -0.01, 1.0
        settings = {
            "image_height": height, "image_width": width, "tanfovx": tan[0], "tanfovy": tan[1],
            "bg": torch.zeros(3, device="cuda"), "scale_modifier": 1.0, "viewmatrix": world,
            "projmatrix": world @ projection.T, "sh_degree": degree, "campos": world.inverse()[3, :3],
            "prefiltered": False, "debug": False,
        }
        if "antialiasing" in GaussianRasterizationSettings._fields:
            settings["antialiasing"] = False
        rasterizer = GaussianRasterizer(GaussianRasterizationSettings(**settings))
        means_2d = torch.zeros_like(model["means"])
        return lambda: rasterizer(means3D=model["means"], means2D=means_2d, shs=model["sh"],
                                  opacities=model["opacities"][:, None], scales=model["scales"],
                                  rotations=model["quats"])[0].permute(1, 2, 0)
    return drawer


def peers(columns, per_channel, cameras, repeat):
    """Times of every peer that runs here; a reason for each that does not."""
    try:
        import torch
    except ImportError:
        return {}, {"gsplat and INRIA": "torch is not installed"}
    if not torch.cuda.is_available():
        return {}, {"gsplat and INRIA": f"torch {torch.__version__} finds no CUDA GPU"}
    degree = round((per_channel + 1) ** 0.5) - 1
    model = as_tensors(columns, per_channel, torch)
    found, missing = {}, {}
    for name, make in (("gsplat", gsplat_drawer), ("INRIA", inria_drawer)):
        try:
            drawer = make(model, degree, torch)
        except ImportError as error:
            missing[name] = str(error)
            continue
        views = []
        with torch.no_grad():
            for camera in cameras:
                draw = drawer(camera)
                views.append((timed(torch, draw, repeat), draw().clamp(0, 1).cpu()))
        found[name] = views
    return found, missing


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path)
    parser.add_argument("cameras", type=Path)
    parser.add_argument("--split", default="test")
    parser.add_argument("--width", type=int, default=1600)
    parser.add_argument("--repeat", type=int, default=100)
    parser.add_argument("--device", default="auto")
    args = parser.parse_args()
    subprocess.run(["cargo", "build", "--release", "-q"], cwd=ROOT, check=True)
    cameras = load_cameras(args.cameras, args.split, args.width)
    columns, per_channel = load_model(args.model)
    print(f"{args.model.name}: {len(columns['x'])} Gaussians, {len(cameras)} views, the first {cameras[0][1]} x {cameras[0][2]}")
    found, missing = peers(columns, per_channel, cameras, args.repeat)
    for name, views in found.items():
        means = [statistics.mean(times) for times, _ in views]
        print(f"{name:<14} {1000 * len(means) / sum(means):8.1f} fps, median {statistics.median(t for times, _ in views for t in times):.3f} ms")
    for name, reason in missing.items():
        print(f"{name}: left out: {reason}")
    options = ["--cameras", args.cameras, "--split", args.split, "--width", args.width, "--device", args.device]
    report = json.loads(lexisplat("bench", args.model, *options, "--repeat", args.repeat, "--warmup", WARMUP, "--cpu-repeat", 1, "-q", "--json"))
    for path in report["paths"]:
        device = "the processor" if path["path"].startswith("cpu") else report["device"]
        print(f"{path['path']:<14} {path['fps']:8.1f} fps, median {path['frame']['median']:.3f} ms, on {device}")
    if found:
        compare_pictures(args, options, cameras, found)


def compare_pictures(args, options, cameras, found):
    """Prints each peer's PSNR against our pictures."""
    import tempfile

    import numpy
    from PIL import Image

    with tempfile.TemporaryDirectory() as folder:
        lexisplat("render", args.model, *options, "-o", folder, "-q")
        ours = [numpy.asarray(Image.open(path), numpy.float64) / 255 for path in sorted(Path(folder).glob("*.png"))]
    for name, views in found.items():
        errors = [((own - picture.numpy()) ** 2).mean() for own, (_, picture) in zip(ours, views)]
        print(f"{name}: pictures within {-10 * numpy.log10(max(errors)):.1f} dB of ours at worst")


if __name__ == "__main__":
    main()
