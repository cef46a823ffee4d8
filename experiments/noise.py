"""Other noise for a finished frame: rendered at sample counts that its file lacks, and kept."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import jflnr
from experiments.resume import ROOT
from jflnr.exr import layers_of, read_channels

FOLDER = ROOT / "cache" / "noise"
# Apart from what the frames themselves were rendered with.
SEED = 7000


def layers(path: Path, counts: tuple[int, ...], realisations: int = 1) -> dict[str, np.ndarray]:
    """Noisy layers `(H, W, 3)` by name: indirect_N for every count, and indirect_1_b and so on.

    What the file has is taken from there, but for more than one realisation all is rendered.
    """
    wanted = {f"indirect_{n}": n for n in counts}
    there = {} if realisations > 1 else layers_of(read_channels(path))
    found = {
        name: np.asarray(jflnr.read_frame(path, spp).indirect)
        for name, spp in wanted.items()
        if name in there
    }
    missing = tuple(spp for name, spp in wanted.items() if name not in there)
    return found | (_rendered(path, missing, realisations) if missing else {})


def _rendered(path: Path, counts: tuple[int, ...], realisations: int) -> dict[str, np.ndarray]:
    label = "-".join(map(str, (path.parent.name, path.stem, *counts, realisations)))
    kept = FOLDER / f"{label}.npz"
    if not kept.exists():
        from experiments.rendering import backend

        backend.start()
        from experiments.rendering import frame
        from experiments.rendering.source import load
        from experiments.rendering.tracer import Tracer
        from jflnr.camera import Camera
        from jflnr.files import replacing

        facts = jflnr.read_header(path)
        spp = (*counts, *(1,) * (realisations - 1))
        settings = frame.Settings(facts["width"], facts["height"], SEED, spp, facts["bounces"])
        camera = Camera(np.array(facts["camera_to_world"]), facts["fov_x_degrees"])
        tracer = Tracer.of(load(facts["scene"]).scene, camera, settings.width, settings.height)
        rendered = frame.noisy(tracer, settings)
        noisy: dict[str, Any] = {k: v.astype(np.float16) for k, v in rendered.items()}
        kept.parent.mkdir(parents=True, exist_ok=True)
        with replacing(kept) as beside, beside.open("wb") as file:
            np.savez(file, **noisy)
    with np.load(kept) as file:
        return {name: file[name].astype(np.float32) for name in file.files}
