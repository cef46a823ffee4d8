"""Host side of kernels_cl/energy.cl and rescale.cl; twins: energy.py and floor.py of regression."""

from typing import Any

from jflnr.opencl.context import Context
from jflnr.opencl.grids import Grid, Images, Run, brightness_defines
from jflnr.opencl.moments import pixel_defines
from jflnr.opencl.shrink import shrink


def frame_mean(run: Run, moments: Any, w: int) -> Any:
    """Mean brightness of the usable pixels, 1 if there is no light, and the sum of blocks, `(2,)`.

    moments: `(K, h, pitch)`, of the brightness, with w columns.
    """
    context, (h, pitch) = run.context, moments.shape[1:]
    partial, mean = context.empty((h, 2)), context.empty((2,))
    defines = _defines(run)
    context.run("light_rows", "energy.cl", defines, (h,), (h, w, pitch, moments, partial))
    context.run("light_mean", "energy.cl", defines, (1,), (h, partial, mean))
    return mean


def restore(run: Run, merged: Grid, moments: Any, w: int) -> tuple[Any, Any]:
    """What the models are to be scaled by, as `apply` takes it: rate and brightness of blocks.

    merged: the models of the finest grid. moments: of pass 1, on blocks twice as large, with w
    columns. Returns `(1,)` and `(h, pitch)`.
    """
    context, defines = run.context, _defines(run)
    h, pitch = moments.shape[1:]
    output, partial, rate = (context.empty(shape) for shape in ((h, pitch), (h, 2), (1,)))
    blocks = h, w, pitch, *merged.sizes, moments, merged.planes, output
    context.run("restored", "energy.cl", defines, (w, h), blocks)
    rows = h, w, pitch, moments, output, partial
    context.run("restored_rows", "energy.cl", defines, (h,), rows)
    total = h, run.numbers.slack, partial, run.mean, rate
    context.run("restore", "energy.cl", defines, (1,), total)
    return rate, output


def own_light(run: Run, merged: Grid, moments: Grid) -> Grid:
    """The light that each model gives at its block's mean guides, which is the floor of
    jflnr/regression/floor.py: C planes.

    merged: models. moments: of the same blocks.
    """
    h, w, pitch = merged.sizes
    own = run.grid(run.channels, h, w)
    arguments = h, pitch, moments.planes, merged.planes, own.planes
    defines = _defines(run)
    run.context.run("own_light", "energy.cl", defines, (pitch // defines["WIDTH"], h), arguments)
    return own


def _defines(run: Run) -> dict[str, Any]:
    sizes = {"Q": run.guides, "C": run.channels, "WIDTH": run.context.width()}
    return sizes | brightness_defines(run.channels)


def rescale(
    context: Context,
    image: Any,
    images: Images,
    output: Any,
    slack: float = 0.0,
    error: Any | None = None,
) -> None:
    """Scale the result so that its brightness sums to the input's over the pixels that count.

    image: `(H, W, C)` float32, or larger by a whole factor than the input. output: of its size,
    float32 or float16, is written; it may be `image`. slack: share by which it may differ. error:
    `(H, W, 1)` float32, is scaled likewise.
    """
    target, _, weight, _ = images
    (height, width), channels, pooled = target.shape[:2], image.shape[2], image
    if (factor := -(-image.shape[0] // height)) > 1:
        pooled = shrink(image, factor, context=context)
    partial, ratio = context.empty((height, 2)), context.empty((1,))
    defines = pixel_defines(target, (), weight, 1) | brightness_defines(channels)
    defines["WIDTH"] = context.width()
    arguments = (width, height, target, pooled, weight, partial)
    context.run("energy_rows", "rescale.cl", defines, (height,), arguments)
    context.run("energy_ratio", "rescale.cl", defines, (1,), (height, slack, partial, ratio))
    scaled = [(image, output), *([] if error is None else [(error, error)])]
    for before, after in scaled:
        strips = -(-before.size // defines["WIDTH"])
        half = {"HALF_OUTPUT": 1} if after.dtype == "float16" else {}
        of_image = before.size, ratio, before, after
        context.run("rescale", "rescale.cl", defines | half, (strips,), of_image)
