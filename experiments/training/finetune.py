"""What a network gains on a scene from noisy frames of that scene alone, without references."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import jax
import numpy as np

from experiments import data, noise, resume
from experiments.results import Parts, pivoted
from jflnr.frame import Frame
from jflnr.images.inputs import frame_inputs
from jflnr.network import examples, weights
from jflnr.network.train import Settings, train

NAME = "training-finetune"

METHOD = "flnr-tiny"
STEPS, EVERY = 120, 30


def run(quick: bool) -> Parts:
    """Validation PSNR by steps, one scene after the other.

    Each frame has three realisations of 1 spp: of two each is the target of the other, in
    `loss.to_noisy`; the third is what is denoised to judge.
    """
    paths = [data.SHIPPED] if quick else data.one_view_each("val")

    def on_scene(path: str) -> list[dict[str, Any]]:
        frame = data.read(Path(path))
        noisy = [np.asarray(frame.indirect)] * 3
        if not quick:
            noisy = list(noise.layers(Path(path), (1,), 3).values())
        settings = Settings(
            widths=tuple(weights.load(weights.FOLDER / f"{METHOD}.npz")[1]["widths"]),
            rate=3e-4,
            every=1 if quick else EVERY,
            noisy_targets=True,
        )
        result = train(
            crops_of(frame, noisy[:2]),
            [dataclasses.replace(frame, indirect=noisy[2])],
            settings,
            initial=weights.shipped(METHOD),
            stop=lambda step: step >= (1 if quick else STEPS),
        )
        return [
            {"frame": data.label(Path(path)), "steps": entry.step, "psnr": entry.validation}
            for entry in result.history
        ]

    found = resume.rows(f"{NAME}{'-quick' * quick}", [str(path) for path in paths], on_scene)
    rows = [row for rows in found for row in rows]
    return {"own frames, PSNR by steps": pivoted(rows, "frame", "steps", "psnr")}


def crops_of(frame: Frame, noisy: list[np.ndarray]) -> list[examples.Crop]:
    """The frame in crops side by side, without its reference."""
    kept = frame_inputs(frame, ("normal", "depth", "ao"))
    kept = dataclasses.replace(kept, albedo=frame.albedo)
    height, width = frame.depth.shape[:2]
    crops = []
    for y in range(0, height - examples.HEIGHT + 1, examples.HEIGHT):
        for x in range(0, width - examples.WIDTH + 1, examples.WIDTH):
            at = np.s_[y : y + examples.HEIGHT, x : x + examples.WIDTH]
            part = jax.tree.map(lambda a, at=at: np.ascontiguousarray(a[at]), kept)
            crops.append(examples.Crop(part, {1: np.stack([image[at] for image in noisy])}))
    return crops
