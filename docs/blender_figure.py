"""Makes docs/blender.png and prints the table of docs/layouts.md, from a scene of Blender's.

    python docs/blender_figure.py

Blender is the one that `make slow` puts into cache/.
"""

import subprocess
import sys
from pathlib import Path

import numpy as np
from PIL import Image

from jflnr import exr
from jflnr.cli import main as jflnr

ROOT = Path(__file__).parents[1]
BLENDER, SCENE = ROOT / "cache/bpy-5.0.1/bin/python", ROOT / "tests/layouts/blender_scene.py"
OUT = ROOT / "out" / "blender"
COMBINED = "ViewLayer.Combined"
RUNS = {
    "`flr`": ["--method", "flr"],
    "`picture`": [],
}


def main() -> None:
    OUT.mkdir(parents=True, exist_ok=True)
    noisy, converged = (render(samples) for samples in (1, 128))
    files = {"one sample per pixel": noisy}
    for number, (name, options) in enumerate(RUNS.items()):
        files[name] = OUT / f"clean-{number}.exr"
        command = ["denoise", str(noisy), "-o", str(files[name]), "--overwrite"]
        assert jflnr([*command, "--channels", "all", "--quiet", *options]) == 0
    print("| | diffuse indirect light | picture |\n| --- | --- | --- |")
    for name, path in files.items():
        light, picture = (psnr(of(path), of(converged)) for of in (indirect, beauty))
        print(f"| {name} | {light:.1f} dB | {picture:.1f} dB |")
    shown = [*list(files.values())[:3], converged]
    tiles = [np.round(255 * display(beauty(path))).astype(np.uint8) for path in shown]
    rows = np.vstack([np.hstack(tiles[:2]), np.hstack(tiles[2:])])
    picture = Image.fromarray(rows).quantize(256, dither=Image.Dither.NONE)  # noise packs badly
    picture.save(ROOT / "docs" / "blender.png", optimize=True)


def render(samples: int) -> Path:
    path = OUT / f"{samples}.exr"
    command = [BLENDER, SCENE, path, 400, 225, samples, "all"]
    if not path.exists():
        subprocess.run([str(part) for part in command], check=True, stdout=sys.stderr)
    return path


def layer(path: Path, name: str) -> np.ndarray:
    channels = exr.read_channels(path)
    return np.stack([channels[f"{name}.{c}"] for c in "RGB"], axis=-1)


def beauty(path: Path) -> np.ndarray:
    return layer(path, COMBINED)


def indirect(path: Path) -> np.ndarray:
    """Diffuse indirect light as it reaches the camera."""
    return layer(path, "ViewLayer.Diffuse Color") * layer(path, "ViewLayer.Diffuse Indirect")


def display(picture: np.ndarray) -> np.ndarray:
    return np.clip(0.8 * picture, 0, 1) ** (1 / 2.2)


def psnr(picture: np.ndarray, reference: np.ndarray) -> float:
    return float(-10 * np.log10(np.mean((display(picture) - display(reference)) ** 2)))


if __name__ == "__main__":
    main()
