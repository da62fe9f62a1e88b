"""Draws the first views of models, without cameras and with them, as one picture.

python3 benches/first_views.py ../shared/data docs/images --binary target/release/lexisplat
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image, ImageDraw

# Models without cameras, and models with the name of their cameras.
ALONE = [
    "bonsai-3dgs.ply", "bonsai-pixelgs.ply", "snowmiku-mcmc.ply", "fern.ply", "room.ply", "room-large.ply", "lego.ply",
    "flowers-c3dgs-int8.ply", "fruit-drops.ply", "leica-brush.ply", "leica-scaniverse.spz", "butterfly.spz",
    "hornedlizard.spz", "fourth-st.spz",
]
WITH = {
    "bonsai-3dgs.ply": "bonsai", "snowmiku-mcmc.ply": "snowmiku", "fern.ply": "fern", "room-large.ply": "room-large",
    "lego.ply": "lego", "flowers-c3dgs-int8.ply": "flowers-c3dgs-int8",
}
# Width and height of a picture of the sheet, in pixels, and pictures in a row.
SIZE = (240, 135)
COLUMNS = 5


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("output", type=Path, help="folder for first-views.jpg")
    parser.add_argument("--binary", default="lexisplat")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        pictures = [(Path(model).stem, drawn(given, Path(folder), model, [])) for model in ALONE]
        for model, cameras in WITH.items():
            path = given.data / f"{cameras}.cameras.json"
            pictures.append((f"{Path(model).stem}, cameras", drawn(given, Path(folder), model, ["--cameras", path])))
    rows = -(-len(pictures) // COLUMNS)
    sheet = Image.new("RGB", (SIZE[0] * COLUMNS, SIZE[1] * rows))
    pen = ImageDraw.Draw(sheet)
    for k, (name, picture) in enumerate(pictures):
        corner = (k % COLUMNS * SIZE[0], k // COLUMNS * SIZE[1])
        sheet.paste(picture.resize(SIZE, Image.Resampling.LANCZOS), corner)
        pen.text((corner[0] + 4, corner[1] + 3), name, fill=(255, 255, 0))
    sheet.save(given.output / "first-views.jpg", quality=85)


def drawn(given, folder, model, cameras):
    """The first view of a model. Without cameras the layout is an exact one, which is made sooner and has the same view."""
    run = lambda *words: subprocess.run([given.binary, *words, "--quiet", "--overwrite"], check=True, stderr=subprocess.DEVNULL)
    file, picture = folder / "scene.lexi", folder / "scene.png"
    how = ["--preset", "small", *cameras] if cameras else ["--tol", "0.5"]
    run("compress", given.data / model, "-o", file, *how)
    run("render", file, "--poster", picture, "--width", str(2 * SIZE[0]), "--device", "cpu")
    return Image.open(picture).convert("RGB")


if __name__ == "__main__":
    sys.exit(main())
