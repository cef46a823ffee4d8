"""The methods of the atlas: a case in, an image out, in a chosen arithmetic."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from experiments.stability import solvers
from experiments.stability.cases import Case, Type
from jflnr.flr.adaptive import flr_adaptive
from jflnr.flr.adaptive_parameters import ADAPTIVE_DEFAULT
from jflnr.flr.parameters import DEFAULT
from jflnr.flr.regression import flr

BLOCK = 8
SUPPORT = 96  # covers the whole of a small frame, as the truth does

Method = Callable[[Case, Type], np.ndarray]


def by_numpy(solver: Callable[[solvers.Window], np.ndarray], case: Case, dtype: Type) -> np.ndarray:
    """Windows, models and their evaluation in `dtype`. Returns `(H, W, C)`."""
    height, width, channels = case.target.shape
    rows, columns = _weights(height, BLOCK), _weights(width, BLOCK)
    w = np.einsum("iy,jx->ijyx", rows, columns).reshape(-1, height * width)
    used = case.usable.reshape(-1)
    w = w[:, used] / w[:, used].sum(1, keepdims=True)
    x = case.guides.reshape(height * width, -1).astype(dtype)
    y = case.target.reshape(height * width, -1).astype(dtype)
    with np.errstate(all="ignore"):
        models = solver(solvers.Window(x[used], y[used], w.astype(dtype)))
        grid = models.reshape(len(rows), len(columns), -1, channels)
        up, across = (_bilinear(size).astype(dtype) for size in (height, width))
        full = np.einsum("yi,ijpc->yjpc", up, grid)
        full = np.einsum("xj,yjpc->yxpc", across, full)
        slopes = np.einsum("yxq,yxqc->yxc", x.reshape(height, width, -1), full[..., 1:, :])
        return full[..., 0, :] + slopes


def _weights(size: int, block: int) -> np.ndarray:
    """Gaussian weight of every pixel for every block, along one axis: `(blocks, size)`."""
    distance = np.arange(-(-size // block))[:, None] - np.arange(size) // block
    return np.exp(-0.5 * (distance * block / math.exp(DEFAULT.log_sigma)) ** 2)


def _bilinear(size: int) -> np.ndarray:
    """Interpolation between block centres along one axis: `(size, blocks)`."""
    blocks = np.arange(-(-size // BLOCK))
    position = np.clip((np.arange(size) + 0.5) / BLOCK - 0.5, 0, blocks[-1])
    return np.maximum(1 - np.abs(position[:, None] - blocks), 0)


@functools.cache
def _compiled(solver: Any, guides: int) -> Callable[..., jax.Array]:
    # Optimising the program of 16 guides takes minutes, and changes the last bits at most.
    options = {"xla_backend_optimization_level": 0} if guides > 8 else None
    return jax.jit(
        lambda y, x, usable: flr(
            y, x, DEFAULT, block=BLOCK, support=SUPPORT, weight=usable, solver=solver
        ),
        compiler_options=options,
    )


def by_jax(solver: str, case: Case, dtype: Type) -> np.ndarray:
    """`flr` on the arrays as they are stored, in float64 if the arithmetic asks for it."""
    guides = case.guides.shape[2]
    # `flr` widens half to float32 on reading; doing it here saves compiling for each type.
    read = case.target.dtype if solver == "cholesky" and guides <= 8 else dtype
    with jax.enable_x64(dtype == np.float64):
        y, x = (jnp.asarray(a.astype(read)) for a in (case.target, case.guides))
        return np.asarray(_compiled(solver, guides)(y, x, jnp.asarray(case.usable)))


@functools.cache
def _adaptive() -> Callable[..., jax.Array]:
    return jax.jit(lambda y, x, usable: flr_adaptive(y, x, ADAPTIVE_DEFAULT, weight=usable))


def by_adaptive(case: Case, dtype: Type) -> np.ndarray:
    """Adaptive FLR, of the noisy image and of the light apart: it is not linear in its input."""
    with jax.enable_x64(dtype == np.float64):
        y, x = (jnp.asarray(a.astype(dtype)) for a in (case.target, case.guides))
        usable = jnp.asarray(case.usable)
        found = [_adaptive()(y[..., c : c + 1], x, usable) for c in range(y.shape[2])]
        return np.concatenate([np.asarray(image) for image in found], axis=-1)


def by_opencl(case: Case, dtype: Type) -> np.ndarray:
    """The OpenCL kernels, which compute in float32 and read float32 or half."""
    from jflnr.opencl.regression import flr as on_device

    return on_device(
        case.target, case.guides, DEFAULT, block=BLOCK, support=SUPPORT, weight=case.usable
    )


METHODS: dict[str, Method] = {
    "inverse (Eq. 7)": functools.partial(by_numpy, solvers.inverse),
    "LU": functools.partial(by_numpy, solvers.lu),
    "Tikhonov (Eq. 11)": functools.partial(by_numpy, solvers.tikhonov),
    "Householder QR": functools.partial(by_numpy, solvers.householder),
    "QR + noise (BMFR)": functools.partial(by_numpy, solvers.householder_noise),
    "SVD": functools.partial(by_numpy, solvers.svd),
    "Appendix as printed": functools.partial(by_numpy, solvers.paper),
    "ours, block inverse": functools.partial(by_jax, "block-inverse"),
    "ours, Cholesky": functools.partial(by_jax, "cholesky"),
    "ours, OpenCL": by_opencl,
    "ours, adaptive": by_adaptive,
}
# The exact answer to the problem that a method solves, in float64.
UNREGULARISED = functools.partial(by_numpy, solvers.svd)
TRUTHS: dict[str, Method] = {
    name: UNREGULARISED for name in ("inverse (Eq. 7)", "LU", "Householder QR", "SVD")
} | {"Tikhonov (Eq. 11)": functools.partial(by_numpy, solvers.tikhonov_exact)}
EXACT: Method = functools.partial(by_numpy, solvers.exact)
OURS = ("ours, block inverse", "ours, Cholesky", "ours, OpenCL", "ours, adaptive")
