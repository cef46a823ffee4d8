"""Training of the network: batches, steps of Adam, validation, checkpoints."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec

from jflnr import metrics
from jflnr.frame import Frame
from jflnr.network import flnr, loss, unet
from jflnr.network.adam import Adam
from jflnr.network.checkpoint import load_state, save_state
from jflnr.network.examples import Crop, Example, draw, prepared
from jflnr.stages import Known, Parts

# Channels of the network, fine to coarse: of flnr-tiny, flnr-small and flnr.
CONFIGS = {
    "tiny": (8, 12, 16),
    "small": (16, 24, 32),
    "base": (32, 48, 64),
}


@dataclass(frozen=True)
class Settings:
    """What a run is made of; with the crops it decides the trajectory.

    batch: crops per step. rate: size of the first steps, which shrinks slowly. every: steps
    between validations. noisy_targets: whether targets have noise of their own.
    """

    widths: tuple[int, ...] = CONFIGS["base"]
    seed: int = 0
    batch: int = 4
    rate: float = 1e-3
    every: int = 500
    noisy_targets: bool = False


class Progress(NamedTuple):
    """loss: mean since the last report. validation: PSNR in dB of the averaged weights."""

    step: int
    loss: float
    validation: float


class Result(NamedTuple):
    """params: the best by validation. history: one entry per validation."""

    params: unet.Params
    best: Progress
    history: list[Progress]


def train(
    crops: Sequence[Crop],
    validation: Sequence[Frame],
    settings: Settings,
    *,
    initial: unet.Params | None = None,
    state_file: Path | None = None,
    stop: Callable[[int], bool],
    report: Callable[[Progress], None] = lambda progress: None,
) -> Result:
    """Train until `stop(step)`; with a `state_file` that exists, go on where it was written.

    Steps depend on the settings, the crops and their number only, so a run that was interrupted and
    one that was not come to the same weights. The batch is divided over all local devices.

    Raises `ValueError` if there is nothing to train on, or if the state is of another run.
    """
    if not crops:
        raise ValueError("crops is empty: no frame shows enough surface and light")
    params = initial or flnr.init(jax.random.key(settings.seed), settings.widths)
    solver, update = _solver(settings)
    state = solver.init_state(params)
    score = Validation(validation)
    history = [Progress(0, float("nan"), score(params))]
    best, top = params, history[0]
    run = {"settings": repr(settings), "crops": len(crops)}
    if state_file is not None and state_file.exists():
        (params, state, best), saved = load_state(state_file, (params, state, best), run)
        history = [Progress(*entry) for entry in saved]
        top = max(history, key=lambda entry: (np.nan_to_num(entry.validation), entry.step))
    step, losses = int(state.iter_num), list[float]()
    with Batches(crops, settings) as batches:
        while not stop(step):
            params, state = update(params, state, data=batches(step))
            losses.append(float(state.value))
            step += 1
            if step % settings.every == 0 or stop(step):
                progress = Progress(step, float(np.mean(losses)), score(state.average))
                # Without validation frames nothing compares, and the last is the best.
                if not progress.validation < top.validation:
                    best, top = state.average, progress
                history.append(progress)
                losses.clear()
                if state_file is not None:
                    save_state(state_file, (params, state, best), history, run)
                report(progress)
    return Result(jax.tree.map(np.asarray, best), top, history)


@functools.cache
def _solver(settings: Settings) -> tuple[Adam, Callable[..., Any]]:
    """The solver and its step, compiled once for all runs with the same settings."""
    solver = Adam(_batch_loss(settings), rate_of(settings))
    return solver, jax.jit(solver.update)


def rate_of(settings: Settings) -> Callable[[jax.Array], jax.Array]:
    """A slow start, then steps that shrink with the root of their number; no end is needed."""
    return lambda t: settings.rate * jnp.minimum(1, (t + 1) / 100) / jnp.sqrt(1 + t / 2000)


def _batch_loss(settings: Settings) -> Callable[..., jax.Array]:
    one = loss.to_noisy if settings.noisy_targets else loss.to_reference

    def mean(params: unet.Params, data: Example) -> jax.Array:
        return jnp.mean(jax.vmap(one, in_axes=(None, 0))(params, data))

    return mean


class Batches:
    """Batches by the number of the step, each drawn while the one before is worked on."""

    def __init__(self, crops: Sequence[Crop], settings: Settings) -> None:
        self.crops, self.settings = crops, settings
        devices = jax.local_devices()
        if settings.batch % len(devices):
            raise ValueError(
                f"batch is {settings.batch}; it must be a multiple of the {len(devices)} devices"
            )
        mesh = Mesh(np.array(devices), ("batch",))
        self.sharding = NamedSharding(mesh, PartitionSpec("batch"))
        self.pool = ThreadPoolExecutor(1)
        self.next: dict[int, Any] = {}

    def __enter__(self) -> Batches:
        return self

    def __exit__(self, *error: object) -> None:
        self.pool.shutdown(cancel_futures=True)

    def __call__(self, step: int) -> Example:
        """The examples of this step, on the devices."""
        draw = self.next.pop(step, None) or self.pool.submit(self._draw, step)
        self.next[step + 1] = self.pool.submit(self._draw, step + 1)
        return jax.device_put(draw.result(), self.sharding)

    def _draw(self, step: int) -> Example:
        random = np.random.default_rng([self.settings.seed, step])
        chosen = random.choice(len(self.crops), self.settings.batch)
        return jax.tree.map(lambda *a: np.stack(a), *(draw(self.crops[i], random) for i in chosen))


class Validation:
    """Mean PSNR over frames with a reference, all before the network done once."""

    def __init__(self, frames: Sequence[Frame]) -> None:
        self.known = [(frame, prepared(frame)) for frame in frames]

    def __call__(self, params: unet.Params) -> float:
        """In dB, by the protocol of DESIGN.md; NaN without frames."""
        scores = [self._one(params, frame, *known) for frame, known in self.known]
        return float(np.mean(scores)) if scores else float("nan")

    def _one(self, params: unet.Params, frame: Frame, parts: Parts, known: Known) -> float:
        light = np.asarray(_light(params, parts, known), np.float64)
        albedo, reference = np.asarray(frame.albedo), np.asarray(frame.reference)
        wanted = albedo * reference.astype(np.float64)
        scale = metrics.exposure(wanted)
        return metrics.psnr(metrics.display(albedo * light, scale), metrics.display(wanted, scale))


_light = jax.jit(loss.light)
