"""Whole pictures of our scenes for training: materials, things, a lens, and a filter of pixels."""

from __future__ import annotations

import time
from string import ascii_lowercase
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from experiments.rendering.camera import slopes
from experiments.rendering.frame import RENDERER, Layers
from experiments.rendering.materials import Dressed, dressed
from experiments.rendering.picture import Film, Lens, Shading
from experiments.rendering.sampling import stream_seed
from experiments.rendering.scenes.world import World
from experiments.rendering.source import Source
from experiments.rendering.tracer import Tracer
from jflnr.camera import Camera

NOISY = (1, 1, 1, 1, 4, 4, 16, 16, 64)
HALF = 48  # samples per pixel of each half of the reference
PROBE = (64, 36)
BRIGHTNESS = 0.35  # mean of a picture, as DESIGN.md exposes
PILOT = 1e-4  # so dark that nothing of the pilot is clamped


def render(
    source: Source, camera: Camera, seed: int, width: int, height: int, half: int = HALF
) -> tuple[Layers, dict[str, Any]]:
    """The layers of one picture, each `(H, W, C)`, and the facts of its header.

    `beauty_N` and its auxiliary layers `..._N` have N samples per pixel, `reference` and those
    without a number `2 * half`; `depth` and `position` are of the pixels' centres.
    """
    started = time.process_time()
    rng = np.random.default_rng(stream_seed(seed, "picture"))
    guides = Tracer.of(source.scene, camera, *PROBE).guides
    made = dressed(source, camera, guides, rng)
    tracer = Tracer.of(made.scene, camera, width, height)
    lens = _lens(rng, camera, width, height, guides["depth"])
    transparent = (source.world or World).transparent
    film = _film(rng, made, camera, width, height, lens, transparent, stream_seed(seed, "pilot"))
    layers: Layers = {name: tracer.guides[name] for name in ("depth", "position")}
    for name, spp in streams().items():
        images = film.sample(spp, stream_seed(seed, name))
        layers |= {f"{layer}_{name}": image for layer, image in images.items()}
    halves = [film.sample(half, stream_seed(seed, "half", i)) for i in range(2)]
    layers |= {name: (first + halves[1][name]) / 2 for name, first in halves[0].items()}
    layers["reference"], layers["reference_a"] = layers.pop("beauty"), halves[0]["beauty"]
    if np.all(layers["alpha"] == 1):
        layers = {name: image for name, image in layers.items() if not name.startswith("alpha")}
    difference = np.abs(halves[0]["beauty"] - halves[1]["beauty"]).mean(-1) / 2
    mean = np.maximum(layers["reference"].mean(-1), 1e-6)
    facts = {
        "width": width,
        "height": height,
        "seed": seed,
        "camera_to_world": camera.to_world.tolist(),
        "fov_x_degrees": camera.fov_x,
        "lens_radius": lens.radius,
        "focus": lens.focus,
        "transparent": film.transparent,
        "exposure": film.exposure,
        "reference_spp": 2 * half,
        "reference_median_relative_standard_error": round(float(np.median(difference / mean)), 5),
        "processor_seconds": round(time.process_time() - started, 1),
        "renderer": f"mitsuba {mi.__version__}, jflnr renderer {RENDERER}, whole picture",
    }
    return layers, facts


def streams() -> dict[str, int]:
    """Names of the noisy pictures and their sample counts: 1, 1_b, 1_c, 1_d, 4, ..."""
    found: dict[str, int] = {}
    for i, spp in enumerate(NOISY):
        before = NOISY[:i].count(spp)
        found[f"{spp}_{ascii_lowercase[before]}" if before else f"{spp}"] = spp
    return found


def _lens(
    rng: np.random.Generator, camera: Camera, width: int, height: int, depth: NDArray[np.float32]
) -> Lens:
    """A pinhole, or in two of five views a lens that blurs near and far by 1 to 15 pixels."""
    seen = depth[depth > 0]
    if rng.random() > 0.4 or not seen.size:
        return Lens()
    near, focus, far = (float(np.quantile(seen, q)) for q in (0.05, rng.uniform(0.05, 0.9), 0.95))
    pixels = 10 ** rng.uniform(0, 1.2)
    most = max(abs(z - focus) / z for z in (near, far))
    pixel = 2 * slopes(camera, width, height)[0] * focus / width
    return Lens(pixels * pixel / max(most, 0.1), focus)


def _film(
    rng: np.random.Generator,
    made: Dressed,
    camera: Camera,
    width: int,
    height: int,
    lens: Lens,
    share: float,
    seed: int,
) -> Film:
    """A film that is exposed about as a person would, a share of those under a sky transparent."""
    shading = Shading.of(made.scene, made.finishes)
    transparent = bool(rng.random() < share)
    pilot = Film(made.scene, camera, width, height, shading, lens, transparent, PILOT)
    seen = pilot.sample(4, seed)
    light, cover = (_blocks(seen[name].mean(-1)) for name in ("beauty", "alpha"))
    covered = cover > 0.5 * cover.max()
    blocks = light[covered] / cover[covered]
    typical = float(np.minimum(blocks, 8 * np.median(blocks) + 1e-9).mean()) / PILOT
    exposure = BRIGHTNESS / typical * 10 ** rng.uniform(-0.3, 0.3)
    return Film(made.scene, camera, width, height, shading, lens, transparent, exposure)


def _blocks(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Means over 8 x 8 pixels."""
    height, width = (length // 8 for length in image.shape)
    return image[: height * 8, : width * 8].reshape(height, 8, width, 8).mean((1, 3))
