"""FLNR on an OpenCL device: the steps of jflnr/network/flnr.py (docs/flnr.md)."""

from __future__ import annotations

import dataclasses
from typing import Any

from jflnr.checks import one_sentence
from jflnr.network.flnr import DEFAULT, FLNR
from jflnr.opencl import network
from jflnr.opencl.adaptive import in_unit, write_light
from jflnr.opencl.arguments import check_counts, to_layers, to_output, to_weight
from jflnr.opencl.context import Context, default_context
from jflnr.opencl.energy import rescale
from jflnr.regression.arguments import channel_count, check_regression


@one_sentence
def flnr(
    target: Any,
    guides: Any,
    method: FLNR = DEFAULT,
    *,
    weight: Any | None = None,
    context: Context | None = None,
    out: Any | None = None,
    on_device: bool = False,
    **options: Any,
) -> Any:
    """`jflnr.flnr` on an OpenCL device: same arguments, same result.

    target, guides and weight may be arrays of numpy or JAX, or device arrays; context, out and
    on_device: as in `jflnr.opencl.flr`.
    Returns `(H, W, C)`, float32 unless `out` is given.

    Raises `ValueError` or `TypeError`, naming the argument; `NoDevice` without a device.
    """
    context = default_context() if context is None else context
    method = dataclasses.replace(method, **options).ready(channel_count(guides), target.shape[2])
    if method.with_error:
        raise ValueError("the standard error is told on the jax backend only")
    check_regression(target, guides, None, weight)
    check_counts(channel_count(guides), target.shape[2])
    output, result = to_output(context, target.shape, out, on_device)
    pixels, unit = in_unit(target)
    images = context.array(pixels), to_layers(context, guides)
    counts = to_weight(context, weight)
    light, error = context.empty(target.shape), context.empty((*target.shape[:2], 1))
    regression = dataclasses.replace(method, params=None)
    run = write_light(context, *images, counts, regression, light, error)
    image = context.empty(target.shape)
    network.correct(context, method.params, *images, counts, light, error, run.mean, image)
    slack = 0.0 if method.keep_energy else float(method.slack)
    rescale(context, image, images[0], counts, output, slack)
    if unit != 1:
        context.scale(output, unit)
    return context.finish(output, result)
