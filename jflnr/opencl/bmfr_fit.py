"""Host side of kernels_cl/bmfr/fit.cl and weighted_sum.cl; the twin is bmfr/fit.py."""

from typing import Any

from jflnr.bmfr.fit import FLAT, grid_offset
from jflnr.bmfr.pipeline import BMFR
from jflnr.opencl.context import Context
from jflnr.opencl.moments import guide_arguments, guide_defines

CHANNELS = 3
# Of the matrix [T, z]: 1, six features, three squares and the light.
COLUMNS = 10 + CHANNELS
SCALED = 9


def fit(
    context: Context, light: Any, count: Any, layers: dict[str, Any], number: Any, method: BMFR
) -> Any:
    """Phase II: `jflnr.bmfr.fit.fit` of normal and position with its squares, not below 0.

    light: `(H, W, 3)`. count: `(H, W, 1)`, samples in it. layers: normal and position, `(H, W, 3)`,
    and surface, `(H, W, 1)`, above 0 where there is one. All are device arrays. number: of the
    frame. Returns `(H, W, 3)`.
    """
    block = method.block
    features, surface = (layers["normal"], layers["position"]), layers["surface"]
    height, width = light.shape[:2]
    y, x = (int(at) for at in grid_offset(number, block))
    h, w = -(-(height + y) // block), -(-(width + x) // block)
    lanes = context.width(block)
    defines = {**guide_defines(features, CHANNELS), "BLOCK": block, "WIDTH": lanes}
    reached = context.empty((h, w, SCALED, 2))
    alpha = context.empty((h, w, COLUMNS - CHANNELS, CHANNELS))
    guides = guide_arguments(features)
    most = min(context.work_group, context.device.max_work_group_size)
    workers = 1 if context.on_cpu else 1 << (most.bit_length() - 1)  # a power of two
    matrix = COLUMNS * block * block
    scratch: tuple[Any, ...] = ()
    extra = {"WORKERS": workers}
    if 4 * (matrix + COLUMNS * (workers + COLUMNS)) > context.device.local_mem_size:
        extra["SCRATCH_GLOBAL"] = 1
        scratch = (context.empty((h, w, matrix)),)
    arguments = (
        width, height, number, x, y, method.noise, FLAT, light, count, surface, *guides, *scratch,
        reached, alpha,
    )  # fmt: skip
    size = workers * w, h
    context.run("fit", "bmfr/fit.cl", defines | extra, size, arguments, group=workers)
    fitted, size = context.empty(light.shape), (w * block // lanes, height)
    evaluated = width, height, w, x, y, surface, *guides, reached, alpha, fitted
    context.run("weighted_sum", "bmfr/weighted_sum.cl", defines, size, evaluated)
    return fitted
