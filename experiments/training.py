"""What the experiments on training share: examples drawn once, and runs on a budget of time."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from experiments import data
from experiments.resume import ROOT
from jflnr.network import examples, loss, unet

# Crops in a step of a stochastic method.
BATCH = 4


def frames() -> list[Path]:
    """Frames to train on: those rendered here, and those of the training split."""
    rendered = sorted((ROOT / "cache" / "frames" / "train").glob("*.exr"))
    return rendered + [path for path in data.frames("train") if path != data.SHIPPED]


def scene_of(path: Path) -> str:
    """The name of the scene that a frame shows."""
    return path.stem.split("_")[0]


def pool(paths: Sequence[Path], each: int, seed: int = 0) -> Any:
    """Up to `each` crops of every frame under one realisation of the noise: stacked examples."""
    random = np.random.default_rng(seed)
    found = [
        examples.draw(crop, random) for crops in examples.read(paths, seed) for crop in crops[:each]
    ]
    return jax.tree.map(lambda *a: jnp.asarray(np.stack(a)), *found)


def count(examples: Any) -> int:
    """Of stacked examples."""
    return len(examples.albedo)


def objective(params: unet.Params, data: tuple[Any, jax.Array]) -> jax.Array:
    """The mean loss of some examples. data: stacked examples, and the numbers of those to take."""
    known, chosen = data
    some = jax.tree.map(lambda a: a[chosen], known)
    return jnp.mean(jax.vmap(loss.to_reference, in_axes=(None, 0))(params, some))


def mean_loss(params: unet.Params, known: Any, evaluate: Callable[..., jax.Array]) -> float:
    """Over all examples, one by one: a large batch at once takes more memory than time it saves."""
    losses = [float(evaluate(params, (known, np.array([i])))) for i in range(count(known))]
    return float(np.mean(losses))


def descend(
    solver: Any, params: unet.Params, known: Any, batch: int, seconds: float, seed: int = 0
) -> Iterator[tuple[float, int, unet.Params]]:
    """Minimise `objective` by a solver of jaxopt; yields seconds, steps and weights ever again.

    Processor time counts, without compilation and what the caller does in between. batch: number
    of examples per step. Weights are the running mean where the solver keeps one.
    """
    random = np.random.default_rng(seed)
    update = jax.jit(solver.update)
    first = known, random.permutation(count(known))[:batch]
    state = solver.init_state(params, data=first)
    jax.block_until_ready(update(params, state, data=first))
    spent, steps, reported = 0.0, 0, 0.0
    yield spent, steps, params
    while spent < seconds:
        start = time.process_time()
        chosen = random.permutation(count(known))[:batch]
        params, state = update(params, state, data=(known, chosen))
        jax.block_until_ready(params)
        spent, steps = spent + time.process_time() - start, steps + 1
        if spent - reported >= seconds / 15 or spent >= seconds:
            reported = spent
            yield spent, steps, getattr(state, "average", params)
