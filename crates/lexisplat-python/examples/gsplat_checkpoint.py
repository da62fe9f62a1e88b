"""Compresses a checkpoint of gsplat's simple_trainer, and says what that cost.

    python gsplat_checkpoint.py results/garden/ckpts/ckpt_29999_rank0.pt garden.lexi
"""

import sys

import lexisplat as lx
import torch

checkpoint = torch.load(sys.argv[1], map_location="cpu", weights_only=True)
splats = lx.Splats.from_dict(checkpoint["splats"])  # means, scales, quats, opacities, sh0, shN
scene = lx.compress(splats, preset="balanced", progress=True)
scene.save(sys.argv[2])

quality = lx.compare(splats, scene)["psnr"]
print(f"{scene}: {splats.nbytes / scene.nbytes:.1f} times smaller than the arrays")
print(f"PSNR {quality['mean']:.1f} dB on average, {quality['min']:.1f} dB at worst")

tensors = scene.decode().to_torch("linear")  # what gsplat.rasterization takes
print({name: tuple(tensor.shape) for name, tensor in tensors.items()})
