"""What of a frame is denoised, what is said of it, and the picture that comes out."""

import argparse
import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jflnr import layouts

if TYPE_CHECKING:
    from jflnr.frame import Frame


def spp_of(source: layouts.Source, arguments: argparse.Namespace) -> int | None:
    """The samples per pixel of a file of ours."""
    return arguments.spp if layouts.native.spp_present(source.channels) else None


def split(light: np.ndarray) -> dict[str, np.ndarray]:
    """Denoised light `(H, W, 3)` or `(H, W, 6)` by layer."""
    lights = {"indirect": light[..., :3]}
    return lights | ({"direct": light[..., 3:]} if light.shape[-1] > 3 else {})


def with_direct(frame: "Frame", path: Path) -> "Frame":
    """The frame whose light to denoise, (H, W, 6), is the indirect and the direct one."""
    if frame.direct is None:
        raise ValueError(f"{path}: --direct needs a layer of direct light, and there is none")
    light = np.concatenate([frame.indirect, frame.direct], axis=-1)
    return dataclasses.replace(frame, indirect=light)


def picture_of(frame: "Frame", lights: dict[str, np.ndarray]) -> np.ndarray:
    """The picture `(H, W, 3)` with the denoised light in it."""
    from jflnr.frame import composite

    frame = dataclasses.replace(frame, direct=lights.get("direct", frame.direct))
    return np.asarray(composite(frame, lights["indirect"]), np.float32)


def about_of(frame: "Frame", settings: dict[str, Any], spp: int | None) -> dict[str, Any]:
    """What was done, for the record and for the header of the output."""
    from jflnr.images.guides import choose

    method = settings["method"]
    own = getattr(method, "features", None)
    names = ("sigma", "eps", "eps_prime") if method.name == "flr" else ()
    return {
        "method": method.name,
        "backend": settings["backend"],
        "spp": spp,
        "guides": list(own or choose(frame, settings["guides"])),
        **({"block": method.block} if hasattr(method, "block") else {}),
        **{name: float(getattr(method, name)) for name in names},
    }


def not_finite_pixels(frame: "Frame") -> list[str]:
    from jflnr.frame import not_finite

    counts, why = not_finite(frame), layouts.denoised(vars(frame))[1]
    listed = ", ".join(f"{count} of {layer}" for layer, count in counts.items())
    said = f"pixels that are NaN or infinite (the fit leaves them out): {listed}"
    return [*([said] if counts else []), *([why] if why else [])]
