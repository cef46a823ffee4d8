"""Host side of kernels_cl/centre.cl, moments.cl and weighted_moments.cl.

The twin in JAX is jflnr/regression/moments.py.
"""

from typing import Any

from jflnr.opencl.context import Context
from jflnr.opencl.grids import Grid, Images, Run, brightness_defines, lanes_of
from jflnr.regression.moments import plane_count

PARTS = 5


def guide_defines(guides: tuple[Any, ...], channels: int) -> dict[str, int]:
    """The defines of kernels_cl/sizes.h and images.h for guides `(H, W, Q_i)`, at most five."""
    parts = [layer.shape[2] for layer in guides] + [0] * (PARTS - len(guides))
    defines = {f"PART_{i}": count for i, count in enumerate(parts)}
    if any(layer.dtype == "float16" for layer in guides):
        defines["HALF_GUIDES"] = 1
    return {"Q": sum(parts), "C": channels, **defines}


def guide_arguments(guides: tuple[Any, ...]) -> tuple[Any, ...]:
    """The guides as the kernels take them."""
    return (*guides, *(None for _ in range(PARTS - len(guides))))


def run_on_rows(
    context: Context, name: str, file: str, defines: dict[str, Any], arguments: tuple[Any, ...]
) -> None:
    """Enqueue a kernel over vectors of neighbours in a row, which may overlap.

    arguments: the first two are width and height of the frame.
    """
    width, height = arguments[:2]
    lanes = context.width() if width >= context.width() else 1
    context.run(name, file, {**defines, "WIDTH": lanes}, (-(-width // lanes), height), arguments)


def weight_defines(weight: Any | None) -> dict[str, int]:
    """The defines of kernels_cl/moments.cl for weights `(H, W)`, float32 or bool, or None."""
    if weight is None:
        return {}
    return {"WEIGHTED": 1, "MASKED": 1} if weight.dtype == bool else {"WEIGHTED": 1}


def pixel_defines(
    target: Any, guides: tuple[Any, ...], weight: Any | None, block: int
) -> dict[str, int]:
    """The defines of kernels_cl/products.h for a target `(H, W, C)`, guides and weights."""
    defines = guide_defines(guides, target.shape[2]) | weight_defines(weight) | {"BLOCK": block}
    if target.dtype == "float16":
        defines["HALF_TARGET"] = 1
    return defines


def centre(context: Context, guides: tuple[Any, ...], weight: Any | None = None) -> Any:
    """`jflnr.regression.moments.centre` of device arrays `(H, W, Q_i)`: `(max(Q, 1),)`."""
    defines = {**guide_defines(guides, 1), **weight_defines(weight), "WIDTH": 1, "BLOCK": 1}
    count = defines["Q"]
    shift = context.empty((max(count, 1),))
    if count == 0:
        return shift
    height, width = guides[0].shape[:2]
    step_y, step_x = (max(size // 32, 1) for size in (height, width))
    rows = -(-height // step_y)
    partial = context.empty((rows, count, 2))
    arguments = (width, rows, step_x, step_y, *guide_arguments(guides), weight, partial)
    sampled = sum(layer.nbytes for layer in guides) // (step_x * step_y)
    context.run("centre_rows", "centre.cl", defines, (rows,), arguments, sampled)
    context.run("centre", "centre.cl", defines, (count,), (rows, partial, shift))
    return shift


def collect(
    context: Context,
    target: Any,
    guides: tuple[Any, ...],
    shift: Any,
    block: int,
    weight: Any | None = None,
    light: bool = False,
) -> Any:
    """`jflnr.regression.moments.collect` of device arrays, the guides each `(H, W, Q_i)`.

    light: take the brightness for Y (C = 1).
    Returns `(K, ceil(H/block), pitch)`, zero from column ceil(W/block) on.
    """
    height, width = target.shape[:2]
    defines = pixel_defines(target, guides, weight, block) | {"WIDTH": context.width(block)}
    if light:
        defines |= brightness_defines(target.shape[2]) | {"C": 1, "LIGHT": target.shape[2]}
    h, w = -(-height // block), -(-width // block)
    pitch = -(-w // context.width()) * context.width()
    moments = context.empty((plane_count(defines["Q"], defines["C"]), h, pitch))
    arguments = (
        width, height, h, pitch, target, *guide_arguments(guides), weight, shift, moments
    )  # fmt: skip
    context.run("moments", "moments.cl", defines, (pitch, h), arguments)
    return moments


def collect_weighted(run: Run, images: Images, pilot: Grid, block: int) -> Grid:
    """Pass 2: moments of the weighted pixels on the finest blocks, and one plane of noise.

    pilot: models of the brightness on blocks four times as large.
    """
    target, guides, weight, _ = images
    height, width, channels = target.shape
    h, w = -(-height // block), -(-width // block)
    moments = run.grid(plane_count(run.guides, channels) + 1, h, w)
    lanes = lanes_of(run, block)
    pitch = moments.size[1]
    defines = pixel_defines(target, guides, weight, block) | brightness_defines(channels)
    defines["WIDTH"] = lanes
    if run.numbers.exponent == 1:
        defines["PROPORTIONAL"] = 1
    arguments = (
        width, height, h, pitch, *pilot.sizes, run.numbers.exponent, run.numbers.offset, target,
        *guide_arguments(guides), weight, run.shift, pilot.planes, run.mean, moments.planes,
    )  # fmt: skip
    size = pitch // (2 if lanes > block else 1), h
    file = "weighted_moments.cl"
    run.context.run("weighted_moments", file, defines, size, arguments, alone=True)
    return moments
