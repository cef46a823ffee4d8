"""Adaptive FLR on OpenCL devices: the steps of jflnr/regression/adaptive.py (docs/adaptive.md)."""

import dataclasses
from typing import Any

from jflnr.checks import one_sentence
from jflnr.opencl.apply import Restored, apply
from jflnr.opencl.arguments import run_on_images
from jflnr.opencl.context import Context
from jflnr.opencl.energy import frame_mean, own_light, rescale, restore
from jflnr.opencl.grids import Grid, Images, Run
from jflnr.opencl.level import Step, fit_level, fit_pilot
from jflnr.opencl.merge import choose, merge, signal_share
from jflnr.opencl.moments import centre, collect, collect_weighted
from jflnr.opencl.resampling import halve
from jflnr.opencl.uncertainty import standard_error
from jflnr.opencl.weigh import collect_blocks
from jflnr.parameters import numbers_of
from jflnr.regression.adaptive import DEFAULT, AdaptiveFLR
from jflnr.regression.arguments import channel_count
from jflnr.regression.auto import Auto


@one_sentence()
def flr_adaptive(target: Any, guides: Any, method: AdaptiveFLR = DEFAULT, **options: Any) -> Any:
    """`jflnr.flr_adaptive` on an OpenCL device: same arguments, same result.

    target, guides and weight may be arrays of numpy or JAX, or device arrays; context, out and
    on_device: as in `jflnr.opencl.flr`.
    Returns `(H, W, C)` or `(f H, f W, C)`, float32 unless `out` is given; `with_error` also the
    error, of one channel.

    Raises `ValueError` or `TypeError`, naming the argument; `NoDevice` without a device.
    """
    return run_on_images(write, target, guides, method, **options)


def write(
    context: Context, images: Images, method: AdaptiveFLR, output: Any, error: Any | None
) -> None:
    """Write the light, `(H, W, C)`, with the brightness of the input if that is to be kept, and, if
    that is not None, its error."""
    image = context.empty(output.shape) if method.keep_energy else output
    write_light(context, images, method, image, error)
    if method.keep_energy:
        rescale(context, image, images, output, error=error)


def write_light(
    context: Context, images: Images, method: AdaptiveFLR, image: Any, error: Any | None = None
) -> Run:
    """The passes over the pixels, and what happens on blocks between them.

    Writes `image`, `(H, W, C)`, and, if it is given, the standard error to `error`, `(H, W, 1)`.
    """
    target, guides, _, guides_map = images
    block, shift = method.finest, centre(context, guides)
    plain: dict[str, Any] = numbers_of(method)
    numbers = dataclasses.replace(method, **plain)
    run = Run(context, channel_count(guides), target.shape[2], numbers, shift, None)
    collect = collect_blocks if isinstance(method, Auto) else collect_pixels
    run, light, grid = collect(run, images, block)
    w = -(-target.shape[1] // (2 * block))
    steps, merged = fit_levels(run, grid, block, method.levels)
    scale, own = restore(run, merged, light, w), own_light(run, merged, grid)
    restored = Restored(*scale, own, run.numbers.floor)
    apply(context, merged.planes, guides_map, shift, method.side, merged.sizes, image, restored)
    if error is not None:
        standard_error(run, steps, scale, own, method.side, error)
    return run


def collect_pixels(run: Run, images: Images, block: int) -> tuple[Run, Any, Grid]:
    """Passes 1 and 2; all as of `collect_blocks`."""
    target, guides, weight, _ = images
    light = collect(run.context, target, guides, run.shift, 2 * block, weight, light=True)
    w = -(-target.shape[1] // (2 * block))
    run = run._replace(mean=frame_mean(run, light, w))
    pilot = fit_pilot(run, light, w, block)
    return run, light, collect_weighted(run, images, pilot, block)


def fit_levels(run: Run, moments: Grid, block: int, levels: int) -> tuple[list[Step], Grid]:
    """The steps from the coarsest grid to the finest, and the models put together from all levels.

    block: side of the finest blocks.
    """
    grids = [moments]
    for _ in range(levels - 1):
        grids.append(halve(run, grids[-1]))
    coarse = fit_level(run, grids[-1], block << (levels - 1))
    steps, merged = list[Step](), coarse.models
    for level in reversed(range(levels - 1)):
        grid, spared = grids[level], level == 0 and steps and run.numbers.worth is not None
        tiles = choose(run, steps[-1].share, *grid.sizes[:2]) if spared else None
        fine = fit_level(run, grid, block << level, merged, slopes=level > 0, tiles=tiles)
        steps.append(Step(fine, coarse, signal_share(run, fine, coarse)))
        merged = merge(run, fine, coarse, merged, steps[-1].share)
        coarse = fine
    return steps, merged
