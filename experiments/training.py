"""FLNR exactly as in section 3.3 of its paper, trained here on the frames of ours, beside ours."""

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
from experiments.peers import paper_network as paper
from experiments.results import Parts
from experiments.sweeps import Sweep, everything, method, named
from experiments.tune import quick_psnr
from jflnr.frame import Array, Frame
from jflnr.images.inputs import frame_inputs, robust_images
from jflnr.network import adam, examples, loss
from jflnr.network.checkpoint import load_state, save_state
from jflnr.network.examples import Example
from jflnr.network.flnr import GUIDES
from jflnr.network.train import Batches, Settings
from jflnr.regression.flr import DEFAULT

NAME = "training"
QUESTION = "What does the network reach in the paper's own form, trained as ours?"
MINUTES = 30

# Of a processor, and steps between validations.
TRAINING, EVERY = 25 * 60, 100
BLOCK, SUPPORT = 8, 72
OURS = ("flr", "flr-adaptive", "flnr")
FRAMES = resume.ROOT / "cache" / "training" / "train"


class Trained(NamedTuple):
    """Weights of the U-Net, and sigma, eps and eps' trained with them."""

    network: paper.Params
    parameters: Any


def run(quick: bool) -> Parts:
    """Train on the frames of `render data`, choose on val, measure on test."""
    paths = [data.SHIPPED] if quick else sorted(FRAMES.glob("*.exr"))
    records = [examples.prepared(path, resume.FOLDER / "prepared") for path in paths]
    kept = [data.read(path) for path in ([data.SHIPPED] if quick else data.frames("val"))]
    file = resume.FOLDER / f"{NAME}{'-quick' * quick}.state"
    best, history = train(records, kept, quick, file)
    mine = Method("FLNR, the paper's form", "jflnr", of_paper, {"trained": best})
    cases = named([*(method(name, method=name) for name in OURS), mine], timed=True)
    found = Sweep(NAME, "", 0, lambda: cases, measure=everything).run(quick)
    weights = sum(leaf.size for leaf in jax.tree.leaves(best.network))
    at = max(history, key=lambda entry: entry["psnr"])
    facts = {"frames": len(paths), "weights": weights, "best step": at["step"]}
    facts["PSNR on val, dB"] = at["psnr"]
    file.unlink()  # not before: what is trained survives an interruption of the measurement
    parts = {f"the paper's form, {title}": rows for title, rows in found.items()}
    return parts | {"the paper's form, training": [facts]}


def train(
    records: Sequence[np.ndarray], kept: Sequence[Frame], quick: bool, file: Path
) -> tuple[Trained, list[dict[str, float]]]:
    """The weights best on `kept`, and PSNR there by steps; goes on from the state in `file`."""
    settings = Settings(batch=4, rate=1e-3, every=1 if quick else EVERY)
    network = paper.init(jax.random.key(0), 5 + 3, 5)
    best = Trained(network, jax.tree.map(jnp.float32, DEFAULT))
    state, spent = adam.start(best), 0.0
    history: list[dict[str, float]] = []
    about = {"frames": len(records), "every": settings.every}
    if file.exists():
        (state, best), history = load_state(file, (state, best), about)
        spent = history[-1]["seconds"]
    with Batches(records, settings) as batches:
        while spent < (1 if quick else TRAINING):
            start, losses = time.process_time(), []
            for step in range(int(state.step), int(state.step) + settings.every):
                # A slow start, then steps that shrink with the root of their number.
                rate = settings.rate * min(1, (step + 1) / 100) / (1 + step / 2000) ** 0.5
                state, value = _update(state, batches(step), np.float32(rate))
                losses.append(float(value))
            spent += time.process_time() - start
            scores = [quick_psnr(frame, of_paper(frame, state.average)) for frame in kept]
            entry = {"step": int(state.step), "seconds": spent, "loss": float(np.mean(losses))}
            entry["psnr"] = float(np.mean(scores))
            if entry["psnr"] > max((other["psnr"] for other in history), default=-np.inf):
                best = state.average
            history.append(entry)
            file.parent.mkdir(parents=True, exist_ok=True)
            save_state(file, (state, best), history, about)
            print(f"  step {entry['step']}: {entry['psnr']:.2f} dB on val", flush=True)
    return best, history


def of_paper(frame: Frame, trained: Trained) -> Array:
    """Denoise by the paper's network."""
    return _denoise(frame_inputs(frame, GUIDES), trained)


@jax.jit
def _denoise(frame: Frame, trained: Trained) -> jax.Array:
    weight = None if frame.mask is None else frame.mask[..., 0]
    guides = jnp.concatenate(robust_images(frame, GUIDES)["guides"], axis=-1)
    return _light(trained, jnp.asarray(frame.indirect), guides, weight)


def _light(trained: Trained, light: jax.Array, guides: jax.Array, weight: Any) -> jax.Array:
    """`flnr_of_paper` as it is trained and used."""
    options = {"block": BLOCK, "support": SUPPORT}
    network, parameters = trained
    return paper.flnr_of_paper(light, guides, network, parameters, weight=weight, **options)


@jax.jit
def _update(state: adam.Adam, batch: Example, rate: Any) -> tuple[adam.Adam, jax.Array]:
    def one(trained: Trained, example: Example) -> jax.Array:
        read, albedo = example.read, example.albedo
        guides = jnp.concatenate([read.normal, read.depth, read.ao], axis=-1)
        light = _light(trained, read.noisy, guides, read.mask[..., 0])
        return loss.shown_error(light * albedo * example.exposure, albedo * example.target)

    def mean(trained: Trained) -> jax.Array:
        return jnp.mean(jax.vmap(one, in_axes=(None, 0))(trained, batch))

    value, gradient = jax.value_and_grad(mean)(state.params)
    return adam.update(state, gradient, rate), value
