"""The layout of our own files (DESIGN.md, "The frame")."""

from collections.abc import Collection

from jflnr.exr import layers_of
from jflnr.layouts.channels import LAYERS, NATIVE, PICTURE, Layout, present

OTHERS = "layers that go by other names can be given one by one: docs/layouts.md, --map"


def layout(spp: int, channels: Collection[str] = ()) -> Layout:
    """The layout whose noisy light at `spp` samples per pixel is `indirect_{spp}`.

    `channels` are those of a file that is in no other program's layout. Where there is a whole
    picture, `beauty_{spp}`, its auxiliary layers have that number too.
    """
    if f"beauty_{spp}.R" in channels:
        return _picture(spp, channels)
    names = NATIVE | {"indirect": tuple(f"indirect_{spp}.{c}" for c in "RGB")}
    if counts := spp_present(channels):
        listed = ", ".join(map(str, counts))
        advice = {"indirect": f"there is indirect light for spp {listed}"}
        return Layout("jflnr", names, advice=advice)
    advice = dict.fromkeys(names, f"{present(channels)}; {OTHERS}")
    return Layout("unknown", names, advice=advice)


def _picture(spp: int, channels: Collection[str]) -> Layout:
    numbered = ("beauty", "emission", "environment", "seen_albedo", "seen_normal", "normal")
    parts = LAYERS | PICTURE
    layer = lambda name, stem: tuple(f"{stem}.{c}" for c in parts[name])
    names = {name: layer(name, f"{name}_{spp}") for name in numbered}
    names |= {name: layer(name, name) for name in ("depth", "position")}
    alpha = tuple({f"alpha_{spp}.A"} & set(channels))
    names["albedo"] = names["seen_albedo"]
    return Layout("jflnr", names, names["beauty"] + alpha)


def spp_present(channels: Collection[str]) -> list[int]:
    """The samples per pixel N for which there is a layer `indirect_N` or `beauty_N`."""
    layers = layers_of(channels)
    counts = (layer.removeprefix("indirect_").removeprefix("beauty_") for layer in layers)
    return sorted(int(count) for count in counts if count.isascii() and count.isdigit())
