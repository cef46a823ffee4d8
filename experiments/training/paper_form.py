"""FLNR exactly as in section 3.3 of its paper, trained here, beside ours."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from experiments import data, resume
from experiments.methods import Method
from experiments.results import Parts
from experiments.sweeps import Sweep, everything, method, named
from experiments.training import shared
from experiments.tune import quick_psnr
from jflnr.frame import Array, Frame
from jflnr.images.inputs import frame_inputs, robust_images
from jflnr.network import examples, features, loss, paper
from jflnr.network.adam import Adam
from jflnr.network.checkpoint import load_state, save_state
from jflnr.network.train import Settings, rate_of
from jflnr.regression.flr import DEFAULT

NAME = "training-paper_form"

# Of a processor, and steps between validations.
TRAINING, EVERY = 25 * 60, 100
BLOCK, SUPPORT = 8, 72
OURS = ("flr", "flr-adaptive", "flnr")


class Trained(NamedTuple):
    """Weights of the U-Net, and sigma, eps and eps' trained with them."""

    network: paper.Params
    parameters: Any


class Known(NamedTuple):
    """A frame as it is read and judged; see `jflnr.network.examples.Example`."""

    light: Any
    guides: Any
    weight: Any
    albedo: Any
    target: Any
    exposure: Any


def run(quick: bool) -> Parts:
    """Train on the frames that there are, choose on val, measure on test."""
    paths = [data.SHIPPED] if quick else shared.frames()
    crops = [crop for some in examples.read(paths, 0) for crop in some]
    kept = [data.read(path) for path in ([data.SHIPPED] if quick else data.frames("val"))]
    file = resume.FOLDER / f"{NAME}{'-quick' * quick}.state"
    best, history = train(crops, kept, quick, file)
    mine = Method("FLNR, the paper's form", "jflnr", of_paper, {"trained": best})
    cases = named([*(method(name, method=name) for name in OURS), mine], timed=True)
    found = Sweep(NAME, "", 0, lambda: cases, measure=everything).run(quick)
    weights = sum(leaf.size for leaf in jax.tree.leaves(best.network))
    facts = {"frames": len(paths), "crops": len(crops), "weights": weights}
    at = max(history, key=lambda entry: entry["psnr"])
    facts |= {"best step": at["step"], "PSNR on val, dB": at["psnr"]}
    file.unlink()  # not before: what is trained survives an interruption of the measurement
    parts = {f"the paper's form, {title}": rows for title, rows in found.items()}
    return parts | {"the paper's form, training": [facts]}


def train(
    crops: Sequence[examples.Crop], kept: Sequence[Frame], quick: bool, file: Path
) -> tuple[Trained, list[dict[str, float]]]:
    """The weights best on `kept`, and PSNR there by steps; goes on from the state in `file`."""
    settings = Settings(every=1 if quick else EVERY)
    solver = Adam(_loss, rate_of(settings))
    update = jax.jit(solver.update)
    guides = known_of(kept[0], np.float32(1)).guides.shape[-1]
    network = paper.init(jax.random.key(0), guides + features.CHANNELS, guides)
    params = Trained(network, jax.tree.map(jnp.float32, DEFAULT))
    state, best, spent = solver.init_state(params), params, 0.0
    history: list[dict[str, float]] = []
    about = {"crops": len(crops), "every": settings.every}
    if file.exists():
        (params, state, best), history = load_state(file, (params, state, best), about)
        spent = history[-1]["seconds"]
    while spent < (1 if quick else TRAINING):
        start, losses = time.process_time(), []
        for _ in range(settings.every):
            params, state = update(params, state, data=_batch(crops, settings, int(state.iter_num)))
            losses.append(float(state.value))
        spent += time.process_time() - start
        scores = [quick_psnr(frame, of_paper(frame, state.average)) for frame in kept]
        entry = {"step": int(state.iter_num), "seconds": spent, "loss": float(np.mean(losses))}
        entry["psnr"] = float(np.mean(scores))
        if entry["psnr"] > max((other["psnr"] for other in history), default=-np.inf):
            best = state.average
        history.append(entry)
        file.parent.mkdir(parents=True, exist_ok=True)
        save_state(file, (params, state, best), history, about)
        print(f"  step {entry['step']}: {entry['psnr']:.2f} dB on val", flush=True)
    return best, history


def of_paper(frame: Frame, trained: Trained) -> Array:
    """Denoise by the paper's network."""
    return _denoise(frame_inputs(frame, features.GUIDES), trained)


@jax.jit
def _denoise(frame: Frame, trained: Trained) -> jax.Array:
    weight = None if frame.mask is None else frame.mask[..., 0]
    return light_of(trained, jnp.asarray(frame.indirect), guides_of(frame), weight)


@jax.jit
def guides_of(frame: Frame) -> jax.Array:
    """The guides that ours have, in one array."""
    return jnp.concatenate(robust_images(frame, features.GUIDES)["guides"], axis=-1)


def light_of(trained: Trained, light: jax.Array, guides: jax.Array, weight: Any) -> jax.Array:
    """`flnr_of_paper` as it is trained and used."""
    options = {"block": BLOCK, "support": SUPPORT}
    network, parameters = trained
    return paper.flnr_of_paper(light, guides, network, parameters, weight=weight, **options)


def known_of(frame: Frame, exposure: np.float32) -> Known:
    """A frame with its guides, and with what it should look like."""
    guides = np.asarray(guides_of(frame_inputs(frame, features.GUIDES)))
    weight = np.ones(guides.shape[:2]) if frame.mask is None else frame.mask[..., 0]
    light, albedo = np.asarray(frame.indirect), np.asarray(frame.albedo)
    target = examples.shown(frame, exposure)
    return Known(light, guides, np.float32(weight), albedo, target, exposure)


def _batch(crops: Sequence[examples.Crop], settings: Settings, step: int) -> Known:
    random = np.random.default_rng([settings.seed, step])
    chosen = random.choice(len(crops), settings.batch)
    drawn = [known_of(*examples.renewed(crops[i], random)) for i in chosen]
    return jax.tree.map(lambda *a: np.stack(a), *drawn)


def _loss(trained: Trained, data: Known) -> jax.Array:
    def one(known: Known) -> jax.Array:
        light = light_of(trained, known.light, known.guides, known.weight)
        return loss.shown_error(light * known.albedo * known.exposure, known.target)

    return jnp.mean(jax.vmap(one)(data))
