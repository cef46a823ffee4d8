"""info: show what is in an EXR file and what the denoiser would use of it."""

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from jflnr import exr, layouts
from jflnr.cli.common import table, to_json


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", metavar="FILE", type=Path, help="an EXR file")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")


def run(arguments: argparse.Namespace) -> int:
    facts = describe(arguments.file)
    print(to_json(facts) if arguments.json else as_text(facts))
    return 0


def describe(path: Path) -> dict[str, Any]:
    """Size, layers and use of the file at `path`, as plain values."""
    attributes, channels = exr.read_attributes(path), exr.read_channels(path)
    height, width = next(iter(channels.values())).shape
    return {
        "file": str(path),
        "width": width,
        "height": height,
        "origin": list(attributes.window.origin),
        "compression": attributes.compression,
        "parts": attributes.parts,
        "layers": [_layer(*layer, channels) for layer in exr.layers_of(channels).items()],
        "denoiser": _use(channels, str(path)),
    }


def as_text(facts: dict[str, Any]) -> str:
    """The facts for a person."""
    x, y = facts["origin"]
    rows = [["layer", "channels", "type", "min", "max", "not finite"]]
    for layer in facts["layers"]:
        low, high = ("-" if layer[k] is None else f"{layer[k]:.4g}" for k in ("min", "max"))
        name = layer["layer"] or "(none)"
        rows.append(
            [name, layer["channels"], layer["type"], low, high, str(layer["not_finite_pixels"])]
        )
    parts = f"{facts['parts']} parts" if facts["parts"] > 1 else "1 part"
    return "\n".join(
        [
            facts["file"],
            f"{facts['width']} x {facts['height']} pixels from ({x}, {y}), "
            f"{facts['compression']} compression, {parts}",
            "",
            table(rows, left=3),
            "",
            *_use_text(facts["denoiser"]),
        ]
    )


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


def _use(channels: dict[str, np.ndarray], source: str) -> dict[str, Any]:
    """What `denoise` would take, or why it cannot."""
    counts = layouts.spp_present(channels)
    try:
        layers = layouts.assemble(channels, layouts.native(counts[0] if counts else 1), source)
    except ValueError as error:
        return {"usable": False, "why": str(error)}
    present = [layer for layer, image in layers.items() if image is not None]
    return {
        "usable": True,
        "spp": counts,
        "guides": [name for name in ("normal", "depth", "ao") if name in present],
        "composite": [name for name in ("albedo", "direct", "emission") if name in present],
        "reference": "reference" in present,
        "absent": [layer for layer in layouts.COMPONENTS if layer not in present],
    }


def _use_text(use: dict[str, Any]) -> list[str]:
    if not use["usable"]:
        return [f"jflnr denoise cannot use it: {use['why']}"]
    noisy = ", ".join(f"indirect_{spp} (--spp {spp})" for spp in use["spp"])
    return [
        "jflnr denoise would use",
        f"  noisy light  {noisy}",
        f"  guides       {', '.join(use['guides'])}",
        f"  composite    {', '.join(['denoised indirect', *use['composite']])}",
        f"  reference    {'yes (--reference)' if use['reference'] else 'none'}",
        f"  absent       {', '.join(use['absent']) or 'nothing'}",
    ]
