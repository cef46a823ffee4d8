"""The paper's open question: how accuracy and stability depend on eps and eps'."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jflnr
from experiments import data, plots, resume
from experiments.tune import quick_psnr
from jflnr import guides
from jflnr.denoising import BLOCK
from jflnr.regression.apply import apply
from jflnr.regression.blur import blur
from jflnr.regression.moments import collect, index_xx, index_xy
from jflnr.regression.parameters import DEFAULT, Parameters
from jflnr.regression.solve import cholesky_solve, solve

NAME = "regularisation"
QUESTION = "How do accuracy and stability depend on eps and eps', and is Tikhonov as good?"
MINUTES = 1

SUPPORT = 72


def run(quick: bool) -> dict[str, Any]:
    """PSNR, and float32's error against float64, over a grid of Eq. 18-23 and a line of Eq. 11.

    Means over the validation frames: the grid is also what one would choose from.
    """
    paths = [data.SHIPPED] if quick else data.frames("val")
    values = [10.0**p for p in (range(-6, 1, 3) if quick else range(-8, 1))]

    def on_frame(path: str) -> dict[str, Any]:
        frame = data.read(Path(path))
        return {
            "normalised": [[scores(frame, normalised, e, p) for p in values] for e in values],
            "tikhonov": [scores(frame, tikhonov, e, e) for e in values],
            "learned": scores(frame, normalised, float(DEFAULT.eps), float(DEFAULT.eps_prime)),
        }

    found = resume.rows(f"{NAME}{'-quick' * quick}", [str(path) for path in paths], on_frame)
    mean = {key: np.mean([f[key] for f in found], axis=0).tolist() for key in found[0]}
    learned = {"eps": float(DEFAULT.eps), "eps_prime": float(DEFAULT.eps_prime)}
    return {"values": values, "learned_at": learned, "mean": mean}


def scores(frame: jflnr.Frame, solver: Any, eps: float, eps_prime: float) -> tuple[float, float]:
    """PSNR in dB, and the rms difference of float32 from float64 per mean of the result."""
    single = np.asarray(denoised(frame, solver, eps, eps_prime))
    with jax.enable_x64(True):
        wide = jax.tree.map(lambda a: np.asarray(a, np.float64), frame)
        double = np.asarray(denoised(wide, solver, eps, eps_prime))
    error = np.sqrt(np.mean((single - double) ** 2)) / np.mean(double)
    return quick_psnr(frame, single), float(error)


def denoised(frame: jflnr.Frame, solver: Any, eps: float, eps_prime: float) -> jax.Array:
    """FLR with another solve step, `(H, W, 3)`."""
    return _denoised(frame, jnp.log(eps), jnp.log(eps_prime), solver)


@functools.partial(jax.jit, static_argnames="solver")
def _denoised(
    frame: jflnr.Frame, log_eps: jax.Array, log_eps_prime: jax.Array, solver: Any
) -> jax.Array:
    parameters = Parameters(jnp.asarray(DEFAULT.log_sigma), log_eps, log_eps_prime)
    layers = guides.layers(frame, guides.DEFAULT)
    # Moments about zero: the paper's equations as they stand, so that Eq. 11 can be formed too.
    shift = jnp.zeros(sum(layer.shape[-1] for layer in layers), layers[0].dtype)
    weight = None if frame.mask is None else jnp.asarray(frame.mask)[..., 0] > 0
    moments = collect(jnp.asarray(frame.indirect), layers, shift, BLOCK, weight)
    moments = blur(moments, parameters.sigma / BLOCK, reach=SUPPORT // BLOCK)
    return apply(solver(moments, shift, parameters), layers, shift, BLOCK)


def normalised(moments: jax.Array, shift: jax.Array, parameters: Parameters) -> jax.Array:
    """Eq. 18 to 23."""
    return solve(moments, shift, parameters, 3)


def tikhonov(moments: jax.Array, shift: jax.Array, parameters: Parameters) -> jax.Array:
    """Eq. 11 with eps: `(X^T X + eps I)^-1 X^T Y`, where the window's weights sum to 1."""
    size = shift.size + 1
    pairs = np.array([index_xx(i, j) for i, j in np.ndindex(size, size)]).reshape(size, size)
    cross = np.array([index_xy(i, c, size - 1, 3) for i, c in np.ndindex(size, 3)])
    ridge = parameters.eps * jnp.eye(size, dtype=moments.dtype)[:, :, None, None]
    return cholesky_solve(moments[pairs] + ridge, moments[cross.reshape(size, 3)])


def draw(result: dict[str, Any], folder: Path) -> None:
    """regularisation.png: PSNR over the grid, Tikhonov's line, and the rounding error of both."""
    values, mean, learned = result["values"], result["mean"], result["learned_at"]
    grid = np.array(mean["normalised"])
    line = np.array(mean["tikhonov"])
    with plots.figure(folder / f"{NAME}.png", columns=3, size=(4.6, 4.2)) as axes:
        shown = axes[0].pcolormesh(values, values, grid[..., 0], shading="nearest", cmap="cividis")
        axes[0].get_figure().colorbar(shown, ax=axes[0], label="PSNR, dB")
        axes[0].plot(learned["eps_prime"], learned["eps"], "*", ms=14, c="white", mec="black")
        axes[0].set(xscale="log", yscale="log", xlabel="eps' (additive)", ylabel="eps")
        axes[0].set_title("normalised, Eq. 18-23 (star: the defaults, learned)", fontsize=9)
        axes[0].grid(False)
        best = grid[..., 0].max(axis=0)
        axes[1].semilogx(values, best, "o-", label="normalised, against eps' (best eps)")
        axes[1].semilogx(values, line[:, 0], "s--", label="Tikhonov, against eps")
        axes[1].axhline(mean["learned"][0], color="grey", ls=":", label="normalised, learned")
        axes[1].set(xlabel="regularisation", ylabel="PSNR, dB")
        worst = grid[..., 1].max(axis=0)
        axes[2].loglog(values, worst, "o-", label="normalised (worst eps)")
        axes[2].loglog(values, line[:, 1], "s--", label="Tikhonov")
        axes[2].set(xlabel="regularisation", ylabel="rms error of float32 / mean light")
        for axis in axes[1:]:
            axis.legend(fontsize=8)
