"""info: show what is in an EXR file and what the denoiser would use of it.

Names the program whose layout it is, each layer with its range, and where `jflnr denoise` would
take the noisy light and the guides from.
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from jflnr import exr, layouts
from jflnr.cli.common import add_map, printable, table, to_json
from jflnr.denoising import backend_for
from jflnr.frame import Frame
from jflnr.images.inputs import guides_of
from jflnr.methods import AUTO, PICTURES, default_of, method_of

EXAMPLES = """\
  jflnr info render.exr
  jflnr info render.exr --map albedo=diffuse.colour
  jflnr info render.exr --json
"""


# Layers of a frame, and those of the layout that they are made of.
ELSEWHERE = {"emitted": "emission", "seen_albedo": "albedo"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", metavar="FILE", type=Path, help="an EXR file")
    add_map(parser)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")


def run(arguments: argparse.Namespace) -> int:
    facts = describe(arguments.file, dict(arguments.map))
    print(to_json(facts) if arguments.json else as_text(facts))
    return 0


def describe(path: Path, layers: dict[str, str] | None = None) -> dict[str, Any]:
    """Size, layers and use of the file at `path`, as plain values."""
    source = layouts.load(path, layers=layers)
    attributes, channels = source.attributes, source.channels
    height, width = next(iter(channels.values())).shape
    return {
        "file": str(path),
        "width": width,
        "height": height,
        "origin": list(attributes.window.origin),
        "compression": attributes.compression,
        "parts": attributes.parts,
        "layers": [_layer(*layer, channels) for layer in exr.layers_of(channels).items()],
        "denoiser": _use(source),
    }


def as_text(facts: dict[str, Any]) -> str:
    """The facts for a person."""
    x, y = facts["origin"]
    rows = [["layer", "channels", "type", "min", "max", "not finite"]]
    for layer in facts["layers"]:
        low, high = ("-" if layer[k] is None else f"{layer[k]:.4g}" for k in ("min", "max"))
        name, odd = layer["layer"] or "(none)", str(layer["not_finite_pixels"])
        rows.append([name, layer["channels"], layer["type"], low, high, odd])
    parts = f"{facts['parts']} parts" if facts["parts"] > 1 else "1 part"
    size = f"{facts['width']} x {facts['height']} pixels from ({x}, {y})"
    stored = f"{size}, {facts['compression']} compression, {parts}"
    used = map(printable, _use_text(facts["denoiser"]))
    return "\n".join([printable(facts["file"]), stored, "", table(rows, left=3), "", *used])


def _layer(name: str, parts: list[str], channels: dict[str, np.ndarray]) -> dict[str, Any]:
    names = [f"{name}.{c}" if name else c for c in parts]
    pixels = np.stack([channels[n] for n in names], axis=-1)
    finite = np.isfinite(pixels)
    values = pixels[finite]
    return {
        "layer": name,
        "channels": " ".join(parts),
        "type": "/".join(sorted({exr.TYPES[channels[n].dtype.name] for n in names})),
        "min": float(values.min()) if values.size else None,
        "max": float(values.max()) if values.size else None,
        "not_finite_pixels": int((~finite.all(axis=-1)).sum()),
    }


def _use(source: layouts.Source) -> dict[str, Any]:
    """What `denoise` would take, or why it cannot."""
    layout = source.layout
    use: dict[str, Any] = {"layout": layout.program, "notes": list(layout.notes)}
    try:
        images = layouts.assemble(source)
    except ValueError as error:
        return use | {"usable": False, "why": str(error)}
    frame = Frame(**images)
    method = default_of(frame)
    whole = method in PICTURES
    pixels, why = layouts.denoised(images, whole)
    present = [layer for layer, image in images.items() if image is not None]
    named = {n: c for n, c in layout.channels.items() if set(c) <= set(source.channels)}
    parts = ("emitted", "environment") if whole else ("albedo", "direct", "emission")
    return use | {
        "usable": True,
        "method": method,
        "backend": backend_for(AUTO, method_of(method)),
        "spp": layouts.native.spp_present(source.channels),
        "light": "beauty" if whole else layout.light,
        "pixels": pixels,
        "warnings": [why] if why else [],
        "guides": guides_of(frame, None, method_of(method)),
        "composite": [name for name in parts if name in present],
        "reference": "reference" in present,
        "absent": [layer for layer in layouts.LAYERS if layer not in present],
        "channels": {layer: list(channels) for layer, channels in named.items()},
    }


def _use_text(use: dict[str, Any]) -> list[str]:
    notes = [f"  note         {note}" for note in [*use.get("warnings", ()), *use["notes"]]]
    if not use["usable"]:
        return [f"layout: {use['layout']}; jflnr denoise cannot use it: {use['why']}", *notes]
    light = exr.layer_of(use["channels"][use["light"]][0]) or "plain R, G, B"
    noisy = [f"indirect_{spp} (--spp {spp})" for spp in use["spp"]] or [light]
    denoised = "denoised indirect"
    if use["method"] in PICTURES:
        noisy, denoised = [f"the whole picture, {light}"], "denoised picture"
    return [
        f"layout: {use['layout']}; jflnr denoise would use",
        f"  method       {use['method']}, if no other is named, by {use['backend']}",
        f"  noisy light  {', '.join(noisy)}",
        f"  pixels       {use['pixels']} will be denoised",
        f"  guides       {', '.join(_named(name, use['channels']) for name in use['guides'])}",
        f"  composite    {', '.join([denoised, *use['composite']])}",
        f"  reference    {'yes (--reference)' if use['reference'] else 'none'}",
        f"  absent       {', '.join(use['absent']) or 'nothing'}",
        *notes,
    ]


def _named(guide: str, channels: dict[str, list[str]]) -> str:
    """The guide, with where it comes from unless that is a layer of the same name."""
    name = guide if guide in channels else ELSEWHERE.get(guide)
    if name not in channels:
        return f"{guide} (from position)" if guide == "depth" else guide
    first = channels[name][0]
    source = exr.layer_of(first) or first
    return guide if source == guide else f"{guide} ({source})"
