"""metrics: measure an image against its reference.

A is what to judge: a file that `jflnr denoise` wrote (its layer `indirect`), or a frame (its noisy
layer `indirect_N`, N from --spp). B is a frame with the layers `albedo` and `reference`; without B,
A is measured against its own reference. --map reference=FILE gives B another reference: of another
program's file a picture, of our own light.
If neither file has a layer `reference`, their pictures are compared, B being the reference: the
plain R, G, B, or what another program calls its picture (Blender's Combined).

PSNR, SSIM and FLIP are taken on the pictures as displayed (albedo * light, mean of the reference
brought to 0.35, clipped, gamma 2.2); rMSE, SMAPE and the squared errors on linear radiance.
`mse_unbiased` has the reference's own noise removed; it needs the layer `reference_a`.
"""

import argparse
import functools
from collections.abc import Mapping
from pathlib import Path

from jflnr import exr, layouts, metrics
from jflnr.cli.common import add_map, metrics_table, to_json
from jflnr.frame import frame_of

EXAMPLES = """\
  jflnr metrics clean/room.exr room.exr       against the frame's own reference
  jflnr metrics room.exr --spp 4              how noisy the frame is
  jflnr metrics a.exr b.exr --json            two pictures
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("a", metavar="A", type=Path, help="the image to judge, EXR")
    parser.add_argument("b", metavar="B", type=Path, nargs="?", help="its reference, EXR")
    parser.add_argument("--spp", type=int, default=1, metavar="N", help="noisy layer of a frame: 1")
    add_map(parser)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")


def run(arguments: argparse.Namespace) -> int:
    a, b, layers = arguments.a, arguments.b or arguments.a, dict(arguments.map)
    measured = measure_files(a, b, arguments.spp, layers)
    print(to_json(measured) if arguments.json else metrics_table({arguments.a.name: measured}))
    return 0


def measure_files(a: Path, b: Path, spp: int, layers: Mapping[str, str]) -> dict[str, float | None]:
    """The metrics of file `a` against file `b`, as this module's docstring says."""
    exr.check_aligned(a, b)
    channels_a, source = exr.read_channels(a), layouts.load(b, spp, layers)
    picture = functools.partial(layouts.picture, channels_a, str(a))
    if "reference" in {*exr.layers_of(source.channels), *layers}:
        frame = frame_of(source)
        if frame.beauty is not None:
            return metrics.measure(frame, picture())
        light = "indirect" if "indirect.R" in channels_a else f"indirect_{spp}"
        names = tuple(f"{light}.{c}" for c in "RGB")
        return metrics.measure(frame, layouts.layer(channels_a, "indirect", names, str(a)))
    if "beauty" in layers:
        names = source.layout.channels["beauty"]
        return metrics.compare(picture(), layouts.layer(source.channels, "beauty", names, str(b)))
    return metrics.compare(picture(), layouts.picture(source.channels, str(b)))
