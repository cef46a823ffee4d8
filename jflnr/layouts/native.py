"""The layout of our own files (DESIGN.md, "The frame")."""

from collections.abc import Collection

from jflnr.exr import layers_of
from jflnr.layouts.channels import NATIVE, Layout, present

OTHERS = "layers that go by other names can be given one by one: docs/layouts.md, --map"


def layout(spp: int, channels: Collection[str] = ()) -> Layout:
    """The layout whose noisy light at `spp` samples per pixel is `indirect_{spp}`.

    `channels` are those of a file that is in no other program's layout.
    """
    names = NATIVE | {"indirect": tuple(f"indirect_{spp}.{c}" for c in "RGB")}
    if counts := spp_present(channels):
        listed = ", ".join(map(str, counts))
        advice = {"indirect": f"there is indirect light for spp {listed}"}
        return Layout("jflnr", names, advice=advice)
    advice = dict.fromkeys(names, f"{present(channels)}; {OTHERS}")
    return Layout("unknown", names, advice=advice)


def spp_present(channels: Collection[str]) -> list[int]:
    """The samples per pixel N for which there is a layer `indirect_N`."""
    counts = (layer.removeprefix("indirect_") for layer in layers_of(channels))
    return sorted(int(count) for count in counts if count.isascii() and count.isdigit())
