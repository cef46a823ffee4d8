"""The methods of the atlas: a case in, an image out, in a chosen arithmetic."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from experiments.stability import solvers
from experiments.stability.cases import Case, Type
from jflnr.bmfr.fit import fit
from jflnr.network.flnr import FLNR, flnr
from jflnr.regression.adaptive import AdaptiveFLR, flr_adaptive
from jflnr.regression.flr import DEFAULT, flr

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
    return np.exp(-0.5 * (distance * block / float(DEFAULT.sigma)) ** 2)


def _bilinear(size: int) -> np.ndarray:
    """Interpolation between block centres along one axis: `(size, blocks)`."""
    blocks = np.arange(-(-size // BLOCK))
    position = np.clip((np.arange(size) + 0.5) / BLOCK - 0.5, 0, blocks[-1])
    return np.maximum(1 - np.abs(position[:, None] - blocks), 0)


# Optimising large programs takes longer than the whole atlas, and changes the last bits at most.
unoptimised = functools.partial(jax.jit, compiler_options={"xla_backend_optimization_level": 0})


@functools.cache
def _compiled(solver: Any, guides: int) -> Callable[..., jax.Array]:
    compiled = jax.jit if guides <= 8 else unoptimised
    return compiled(
        lambda y, x, usable: flr(
            y, x, DEFAULT, block=BLOCK, support=SUPPORT, weight=usable, solver=solver
        )
    )


def by_jax(solver: str, case: Case, dtype: Type) -> np.ndarray:
    """`flr` on the arrays as they are stored, in float64 if the arithmetic asks for it."""
    guides = case.guides.shape[2]
    # `flr` widens half to float32 on reading; doing it here saves compiling for each type.
    read = case.target.dtype if solver == "cholesky" and guides <= 8 else dtype
    with jax.enable_x64(dtype == np.float64):
        y, x = (jnp.asarray(a.astype(read)) for a in (case.target, case.guides))
        return np.asarray(_compiled(solver, guides)(y, x, jnp.asarray(case.usable)))


def channel_by_channel(method: Method, case: Case, dtype: Type) -> np.ndarray:
    """The noisy image and the light apart, for a method that is not linear in its input."""
    parts = [case._replace(target=case.target[..., c : c + 1]) for c in range(2)]
    return np.concatenate([method(part, dtype)[..., :1] for part in parts], axis=-1)


def _in_jax(program: Callable[..., jax.Array], case: Case, dtype: Type) -> np.ndarray:
    with jax.enable_x64(dtype == np.float64):
        y, x = (jnp.asarray(a.astype(dtype)) for a in (case.target, case.guides))
        return np.asarray(program(y, x, jnp.asarray(case.usable)))


@functools.cache
def _adaptive() -> Callable[..., jax.Array]:
    return unoptimised(lambda y, x, usable: flr_adaptive(y, x, AdaptiveFLR(), weight=usable))


def by_adaptive(case: Case, dtype: Type) -> np.ndarray:
    """Adaptive FLR of one channel."""
    return _in_jax(_adaptive(), case, dtype)


@functools.cache
def _flnr() -> Callable[..., jax.Array]:
    return unoptimised(
        lambda y, x, usable: flnr(jnp.repeat(y, 3, axis=-1), x, FLNR(), weight=usable)
    )


def by_flnr(case: Case, dtype: Type) -> np.ndarray:
    """FLNR with the weights that ship, of one channel as grey."""
    return _in_jax(_flnr(), case, dtype)


@jax.jit
def _bmfr(y: jax.Array, x: jax.Array, usable: jax.Array) -> jax.Array:
    return fit(y, x, usable[..., None], 3, jnp.array([5, 7]))


def by_bmfr(case: Case, dtype: Type) -> np.ndarray:
    """The fit of method `bmfr`, in its own blocks of 32."""
    return _in_jax(_bmfr, case, dtype)


def by_opencl(case: Case, dtype: Type) -> np.ndarray:
    """The OpenCL kernels, which compute in float32 and read float32 or half."""
    from jflnr.opencl.flr import flr as on_device

    return on_device(
        case.target, case.guides, DEFAULT, block=BLOCK, support=SUPPORT, weight=case.usable
    )


def by_adaptive_opencl(case: Case, dtype: Type) -> np.ndarray:
    """Adaptive FLR's kernels, of one channel."""
    from jflnr.opencl.adaptive import flr_adaptive as on_device

    target = np.ascontiguousarray(case.target)
    return on_device(target, case.guides, AdaptiveFLR(), weight=case.usable)


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
    "ours, adaptive": functools.partial(channel_by_channel, by_adaptive),
    "ours, adaptive OpenCL": functools.partial(channel_by_channel, by_adaptive_opencl),
    "ours, FLNR": functools.partial(channel_by_channel, by_flnr),
    "ours, BMFR's fit": by_bmfr,
}
ON_DEVICE = ("ours, OpenCL", "ours, adaptive OpenCL")
# Their arithmetic is float32.
SINGLE = (*ON_DEVICE, "ours, FLNR", "ours, BMFR's fit")
# The exact answer to the problem that a method solves, in float64.
UNREGULARISED = functools.partial(by_numpy, solvers.svd)
TRUTHS: dict[str, Method] = {
    name: UNREGULARISED for name in ("inverse (Eq. 7)", "LU", "Householder QR", "SVD")
} | {"Tikhonov (Eq. 11)": functools.partial(by_numpy, solvers.tikhonov_exact)}
EXACT: Method = functools.partial(by_numpy, solvers.exact)
OURS = tuple(name for name in METHODS if name.startswith("ours"))


def exists(method: str, case: Case, dtype: Type) -> bool:
    """Whether the method can be asked: not all compute in float64, and FLNR takes five guides."""
    if method == "ours, FLNR" and case.guides.shape[2] != 5:
        return False
    return dtype != np.float64 or method not in SINGLE
