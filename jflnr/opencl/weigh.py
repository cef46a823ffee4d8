"""Host side of kernels_cl/block_moments.cl and weigh.cl; the twin is jflnr/regression/auto.py."""

from typing import Any

from jflnr.opencl.energy import frame_mean
from jflnr.opencl.grids import GROUP, Grid, Images, Run, brightness_defines, lanes_of
from jflnr.opencl.level import fit_pilot
from jflnr.opencl.moments import guide_arguments, pixel_defines
from jflnr.regression.moments import plane_count


def collect_blocks(run: Run, images: Images, block: int) -> tuple[Run, Any, Grid]:
    """The run with the frame's mean brightness, moments of the brightness on blocks of 2 `block`,
    and the weighted moments on blocks of `block` with one plane of noise."""
    blocks = _block_moments(run, images, block)
    (h, pitch), w = blocks.size, -(-blocks.w // 2)
    size = -(-h // 2), -(-w // GROUP) * GROUP
    light = run.context.empty((plane_count(run.guides, 1), *size))
    fine = run.grid(2 * (run.guides + 1) + 1, size[0], w)
    run.launch("light_moments", "weigh.cl", fine, (*size, h, pitch, blocks.planes, light))
    run = run._replace(mean=frame_mean(run, light, w))
    pilot = fit_pilot(run, light, w, block)
    doubled = *fine.size, *pilot.sizes, pilot.planes, fine.planes
    run.launch("double_pilot", "weigh.cl", fine, doubled)
    numbers = run.numbers.exponent, run.numbers.offset
    moments = run.grid(blocks.number - 1, h, blocks.w)
    planes = run.mean, fine.planes, blocks.planes, moments.planes
    run.launch("weigh", "weigh.cl", moments, (h, pitch, *fine.sizes, *numbers, *planes))
    return run, light, moments


def _block_moments(run: Run, images: Images, block: int) -> Grid:
    """Unweighted moments on blocks of `block`, and the mean squares of brightness and weight."""
    target, guides, weight, _ = images
    height, width, channels = target.shape
    lanes = lanes_of(run, block)
    h, w = -(-height // block), -(-width // block)
    blocks = run.grid(plane_count(run.guides, channels) + 2, h, w)
    pitch = blocks.size[1]
    defines = pixel_defines(target, guides, weight, block) | brightness_defines(channels)
    defines["WIDTH"] = lanes
    arguments = (
        width, height, h, pitch, target, *guide_arguments(guides), weight, run.shift, blocks.planes
    )  # fmt: skip
    size, file = (pitch // GROUP, h), "block_moments.cl"
    run.context.run("block_moments", file, defines, size, arguments, alone=True)
    return blocks
