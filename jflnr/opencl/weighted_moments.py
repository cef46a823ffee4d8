"""Host side of kernels_cl/weighted_moments.cl; the twin is in jflnr/regression/moments.py."""

from jflnr.opencl.grids import Grid, Images, Run, brightness_defines, lanes_of
from jflnr.opencl.moments import guide_arguments, pixel_defines
from jflnr.regression.moments import plane_count


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
    defines = {**pixel_defines(target, guides, weight, block), **brightness_defines(channels)}
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
