"""More channels than the kernels take at once, in passes over some of them, against JAX."""

import dataclasses
import functools
from typing import Any

import jax
import numpy as np
import pytest

import jflnr
from jflnr.opencl import Context
from jflnr.opencl.adaptive import flr_adaptive
from jflnr.opencl.flnr import flnr
from jflnr.opencl.flr import flr
from tests.opencl import tolerances
from tests.opencl.conftest import error, scene


def spoiled(channels: int) -> tuple[np.ndarray, np.ndarray]:
    """Light of very different groups, with a pixel that counts in none of them."""
    target, guides = scene(40, 70, 5, channels)
    guides[..., 3:] = np.clip(np.abs(guides[..., 3:]), 0.05, 1)
    target *= np.geomspace(1, 30, channels, dtype=np.float32)
    target[20, 30, channels - 1] = np.nan
    return target, guides


@pytest.mark.parametrize(
    ("method", "channels"),
    [("flr", 18), ("flr_adaptive", 18), ("flr_adaptive", 10), ("flnr", 18)],
)
def test_passes(context: Context, method: str, channels: int) -> None:
    target, guides = spoiled(channels)
    found: Any = {"flr": flr, "flr_adaptive": flr_adaptive, "flnr": flnr}[method]
    options = {} if method == "flr" else {"with_error": True}
    right = jax.jit(functools.partial(getattr(jflnr, method), **options))(target, guides)
    for one, other in zip(
        jax.tree.leaves(found(target, guides, context=context, **options)),
        jax.tree.leaves(right),
        strict=True,
    ):
        for c in range(one.shape[2]):
            assert error(one[..., c], np.asarray(other)[..., c]) < tolerances.ADAPTIVE


def test_where_the_result_goes(context: Context, gpu_like: Context) -> None:
    target, guides = spoiled(12)
    target = target.astype(np.float16)
    right, wrong = flr_adaptive(target, guides, context=context, with_error=True)
    for device in (context, gpu_like):
        there = device.cl.array.to_device(device.queue, target)
        found = flr_adaptive(there, guides, context=device, on_device=True, with_error=True)
        assert error(found[0].get(), right) < tolerances.ADAPTIVE
        assert error(found[1].get(), wrong) < tolerances.ADAPTIVE
        out = np.empty(target.shape, np.float16)
        assert flr_adaptive(target, guides, context=device, out=out) is out
        assert error(np.float32(out), right) < tolerances.ADAPTIVE


@pytest.mark.parametrize("method", ["flr", "flr-adaptive", "flnr", "flnr-small"])
def test_every_method_takes_six_groups_on_the_device(method: str, frame: jflnr.Frame) -> None:
    """Whoever keeps six lights apart gets what all together give."""
    share = np.random.default_rng(0).dirichlet(np.ones(6), frame.depth.shape[:2])
    groups = np.float32(frame.indirect[:, :, None] * share[..., None])
    apart = dataclasses.replace(frame, indirect=groups.reshape(*share.shape[:2], 18))
    denoiser = jflnr.Denoiser(method, backend="auto")
    assert denoiser.backend == "opencl"
    total = denoiser(apart).reshape(*share.shape, 3).sum(2)
    assert error(total, denoiser(frame)) < tolerances.ADAPTIVE
