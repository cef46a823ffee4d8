"""Training of the network: batches, steps of Adam, validation, checkpoints."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec

from jflnr import metrics
from jflnr.network import adam, examples, flnr, loss, unet
from jflnr.network.adam import Adam
from jflnr.network.checkpoint import load_state, save_state
from jflnr.network.examples import Example, before_network, draw

# Channels of the networks, fine to coarse.
WIDTHS = {
    "flnr-small": (10, 16, 24, 32),
    "flnr": (20, 32, 56, 80),
    "flnr-picture": (64, 80, 112, 160),
}
# Samples per pixel that are validated.
COUNTS = (1, 4, 16)
# Steps until they have their size; the size of the last ones.
WARM_UP, LEAST_RATE = 200, 2e-5


@dataclass(frozen=True)
class Settings:
    """What a run is made of.

    method: whose network it is. batch: crops per step. rate: size of the first steps, which falls
    with a cosine to nearly nothing. every: steps between validations.
    """

    method: Any = flnr.DEFAULT
    widths: tuple[int, ...] = WIDTHS["flnr"]
    seed: int = 0
    batch: int = 8
    rate: float = 2e-3
    every: int = 500


class Progress(NamedTuple):
    """seconds: since the run began. loss: mean since the last report. validation: mean PSNR in dB
    of the averaged weights, by samples per pixel."""

    step: int
    seconds: float
    loss: float
    validation: dict[str, float]

    @property
    def score(self) -> float:
        """NaN without validation."""
        return float(np.mean([*self.validation.values()])) if self.validation else float("nan")


class Result(NamedTuple):
    """params: the best by validation; if none was better than the untrained, the last. history:
    one entry per validation, the first untrained. stopped: whether Ctrl-C ended the run."""

    params: unet.Params
    best: Progress
    history: list[Progress]
    stopped: bool


def train(
    records: Sequence[np.ndarray],
    validation: Sequence[Path],
    settings: Settings,
    *,
    seconds: float = float("inf"),
    steps: float = float("inf"),
    state_file: Path | None = None,
    report: Callable[[Progress], None] = lambda progress: None,
) -> Result:
    """Train for so many seconds or steps, whichever end first; the steps' size follows.

    Seconds count from the first step, which is compiled before. After Ctrl-C the state is written.

    records: of `examples.prepared`. validation: frames with a reference. With a `state_file` that
    exists, go on where it was written: with a limit of steps to the weights of a run that was never
    interrupted. The batch is divided over all local devices.

    Raises `ValueError` if there is nothing to train on, or if the state is of another run.
    """
    if not records:
        raise ValueError("there are no frames to train on")
    method = settings.method
    params = flnr.init(jax.random.key(settings.seed), settings.widths, method.read)
    state, best = adam.start(params), params
    score = functools.partial(validate, list(before_validation(validation, method)))
    history = [Progress(0, 0.0, float("nan"), score(params))]
    run = {"settings": repr(settings)}
    if state_file is not None and state_file.exists():
        (state, best), saved = load_state(state_file, (state, best), run)
        history = [Progress(*entry) for entry in saved]
    top = max(history, key=lambda entry: (np.nan_to_num(entry.score), entry.step))
    step, losses = int(state.step), list[float]()
    stopped, began = False, 0.0
    spent = lambda: time.monotonic() - began

    def save() -> None:
        if state_file is not None:
            save_state(state_file, (state, best), history, run)

    try:
        with Batches(records, settings) as batches:
            # As it comes out of a step, or that would be compiled twice.
            state = jax.device_put(state, batches.replicated)
            if max(history[-1].seconds / seconds, step / steps) < 1:
                _update(state, batches(step), np.float32(0))  # compiled, and nothing else
            began = time.monotonic() - history[-1].seconds
            while (done := max(spent() / seconds, step / steps)) < 1:
                state, value = _update(state, batches(step), rate_at(step, done, settings))
                losses.append(float(value))
                step += 1
                if step % settings.every == 0 or spent() >= seconds or step >= steps:
                    loss = float(np.mean(losses))
                    entry = Progress(step, spent(), loss, score(state.average))
                    # Without validation frames nothing compares, and the last is the best.
                    if not entry.score < top.score:
                        best, top = state.average, entry
                    history.append(entry)
                    losses.clear()
                    save()
                    report(entry)
    except KeyboardInterrupt:
        if not losses and len(history) == 1:
            raise
        stopped = True
        last = Progress(int(state.step), spent(), float(np.mean(losses or [np.nan])), {})
        if top.step == 0 or np.isnan(top.score):
            best, top = state.average, last
        history.append(last)
        save()
    return Result(jax.tree.map(np.asarray, best), top, history, stopped)


def rate_at(step: int, done: float, settings: Settings) -> np.float32:
    """The size of a step. done: share of the run that lies behind it."""
    falling = 0.5 + 0.5 * np.cos(np.pi * min(done, 1))
    return np.float32(settings.rate * min(1, (step + 1) / WARM_UP) * falling + LEAST_RATE)


@jax.jit
def _update(state: Adam, batch: Example, rate: Any) -> tuple[Adam, jax.Array]:
    """A step, and the mean loss before it."""

    def mean_loss(params: unet.Params) -> jax.Array:
        return jnp.mean(jax.vmap(loss.relative_error, in_axes=(None, 0))(params, batch))

    value, gradient = jax.value_and_grad(mean_loss)(state.params)
    return adam.update(state, gradient, rate), value


class Batches:
    """Batches by the number of the step, each drawn while the one before is worked on."""

    def __init__(self, records: Sequence[np.ndarray], settings: Settings) -> None:
        self.records, self.settings = records, settings
        devices = jax.local_devices()
        if settings.batch % len(devices):
            raise ValueError(
                f"batch is {settings.batch}; it must be a multiple of the {len(devices)} devices"
            )
        mesh = Mesh(np.array(devices), ("batch",))
        self.sharding = NamedSharding(mesh, PartitionSpec("batch"))
        self.replicated = NamedSharding(mesh, PartitionSpec())
        self.pool = ThreadPoolExecutor(1)
        self.next: dict[int, Any] = {}

    def __enter__(self) -> Batches:
        return self

    def __exit__(self, *error: object) -> None:
        self.pool.shutdown(cancel_futures=True)

    def __call__(self, step: int) -> Example:
        """The examples of this step, on the devices."""
        drawn = self.next.pop(step, None) or self.pool.submit(self._draw, step)
        self.next[step + 1] = self.pool.submit(self._draw, step + 1)
        return jax.device_put(drawn.result(), self.sharding)

    def _draw(self, step: int) -> Example:
        random = np.random.default_rng([self.settings.seed, step])
        chosen = random.choice(len(self.records), self.settings.batch)
        drawn = (draw(self.settings.method, self.records[i], random) for i in chosen)
        return jax.tree.map(lambda *a: np.stack(a), *drawn)


class Shown(NamedTuple):
    """A frame of validation before the network: what is read, its picture's factor and target."""

    spp: int
    read: Any
    factor: np.ndarray
    target: np.ndarray


def before_validation(paths: Sequence[Path], method: Any = flnr.DEFAULT) -> Iterator[Shown]:
    """Frames with a reference, all before the network done once."""
    for path in paths:
        noisy = examples.Noisy.of(path, method)
        albedo = np.asarray(noisy.albedo(), np.float64)
        wanted = albedo * noisy.target()
        scale = metrics.exposure(wanted)
        for spp in (spp for spp in COUNTS if spp in noisy.streams):
            read, unit = before_network(noisy.frame(spp, noisy.streams[spp][0]), method)
            factor, target = albedo * (unit * scale), metrics.display(wanted, scale)
            yield Shown(spp, read, factor, target)


def validate(frames: Sequence[Shown], params: unet.Params) -> dict[str, float]:
    """Mean PSNR in dB by samples per pixel, by the protocol of DESIGN.md."""
    found: dict[str, list[float]] = {}
    for spp, read, factor, target in frames:
        picture = factor * np.asarray(_corrected(params, read), np.float64)
        psnr = metrics.psnr(metrics.display(picture, 1), target)
        found.setdefault(str(spp), []).append(psnr)
    return {spp: float(np.mean(values)) for spp, values in found.items()}


@jax.jit
def _corrected(params: unet.Params, read: Any) -> jax.Array:
    return read.corrected(flnr.said(params, read))
