"""What of a frame is denoised, what is said of it, and the picture that comes out."""

import argparse
import dataclasses
from collections import Counter
from collections.abc import Iterable
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


@dataclasses.dataclass
class Pixels:
    """What is counted of the pixels of a frame, whole or strip by strip."""

    not_finite: Counter[str] = dataclasses.field(default_factory=Counter)
    denoised: int = 0
    why: str = ""

    def add(self, frame: "Frame") -> None:
        from jflnr.frame import not_finite

        self.not_finite.update(not_finite(frame))
        count, why = layouts.denoised(vars(frame))
        self.denoised, self.why = self.denoised + count, self.why or why


def warnings_of(
    caught: Iterable[Any],
    pixels: Pixels,
    about: dict[str, Any],
    frame: "Frame",
    arguments: argparse.Namespace,
) -> list[str]:
    """What a user should know of a frame that was denoised. caught: what Python was warned of."""
    said = list(dict.fromkeys(str(warning.message) for warning in caught))
    if counts := pixels.not_finite:
        listed = ", ".join(f"{count} of {layer}" for layer, count in counts.items())
        said.append(f"pixels that are NaN or infinite (the fit leaves them out): {listed}")
    if not pixels.denoised:
        said.append(pixels.why)
    # Our own files hold converged direct light; other programs' is as noisy as the rest.
    if about["spp"] is None and frame.direct is not None and not arguments.direct:
        said.append("Direct light is left as it was rendered; --direct denoises it too.")
    return said
