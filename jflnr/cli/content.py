"""What of a frame is denoised, what is said of it, and the picture that comes out."""

import argparse
import dataclasses
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from jflnr import layouts
from jflnr.denoising import Denoiser
from jflnr.frame import Frame, composite, not_finite
from jflnr.images.inputs import guides_of
from jflnr.methods import PICTURES

# So much of its light a picture may lose or gain without a word.
LOST = 0.02


class Result(NamedTuple):
    """What became of a frame.

    picture: `(H, W, 3)`. light: `(H, W, 3)`, denoised, if that was what was denoised. lit: the
    picture without what shines by itself. alpha: `(H, W, 1)` if it was denoised too. error: `(H, W,
    1)`, of the brightness, and passes: `(H, W, C)`, light passes, if asked for.
    """

    picture: np.ndarray
    light: np.ndarray | None
    lit: np.ndarray
    alpha: np.ndarray | None = None
    error: np.ndarray | None = None
    passes: np.ndarray | None = None


def result_of(frame: Frame, method: Any, given: Mapping[str, Any]) -> Result:
    """The picture with denoised light in it. given: by name, what the method's last stage gave."""
    image = np.asarray(given["image"], np.float32)
    if method.name in PICTURES:
        shining = 0 if frame.emitted is None else frame.emitted
        if frame.environment is not None:
            seen = 1 if frame.alpha is None else frame.alpha == 1
            shining = shining + seen * frame.environment
        picture, alpha = image[..., :3], image[..., 3:] if image.shape[-1] > 3 else None
        others = given.get("error"), given.get("passes")
        return Result(picture, None, picture - shining, alpha, *others)
    picture, lit = (
        np.asarray(composite(some, image), np.float32)
        for some in (frame, dataclasses.replace(frame, emission=None))
    )
    return Result(picture, image, lit, error=given.get("error"))


def channels_of(
    source: layouts.Source, frame: Frame, result: Result, arguments: argparse.Namespace
) -> dict[str, np.ndarray]:
    """What to write."""
    mask = None if frame.mask is None else np.asarray(frame.mask)
    images = result.picture, result.light, mask, result.alpha, result.passes
    channels = layouts.output_channels(source, *images, arguments.channels)
    return channels if result.error is None else channels | {"error.Y": result.error[..., 0]}


def about_of(
    frame: Frame, denoiser: Denoiser, source: layouts.Source, arguments: argparse.Namespace
) -> dict[str, Any]:
    """What was done, for the record and for the header of the output; `spp` of a file of ours."""
    method = denoiser.method_for(frame)
    names = ("sigma", "eps", "eps_prime") if method.name == "flr" else ()
    return {
        "method": method.name,
        "backend": denoiser.backend,
        "spp": arguments.spp if layouts.native.spp_present(source.channels) else None,
        "guides": guides_of(frame, denoiser.guides, method),
        **({"block": method.block} if hasattr(method, "block") else {}),
        **{name: float(getattr(method, name)) for name in names},
    }


@dataclasses.dataclass
class Pixels:
    """What is counted of the pixels of a frame, whole or strip by strip."""

    not_finite: Counter[str] = dataclasses.field(default_factory=Counter)
    denoised: int = 0
    why: str = ""
    light: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(2))

    def add(self, frame: Frame, method: Any, picture: np.ndarray) -> None:
        whole = method.name in PICTURES
        names = method.features if whole else layouts.LAYERS
        self.not_finite.update({n: c for n, c in not_finite(frame).items() if n in names})
        count, why = layouts.denoised(vars(frame), whole)
        self.denoised, self.why = self.denoised + count, self.why or why
        if whole:
            images = np.asarray(frame.beauty), picture
            good = np.isfinite(images[0]) & np.isfinite(picture)
            self.light += [np.sum(image, dtype=np.float64, where=good) for image in images]


def warnings_of(caught: Iterable[Any], pixels: Pixels) -> list[str]:
    """What a user should know of a frame that was denoised. caught: what Python was warned of."""
    said = list(dict.fromkeys(str(warning.message) for warning in caught))
    if counts := pixels.not_finite:
        listed = ", ".join(f"{count} of {layer}" for layer, count in counts.items())
        said.append(f"pixels that are NaN or infinite (the fit leaves them out): {listed}")
    if not pixels.denoised:
        said.append(pixels.why)
    before, after = pixels.light
    if before > 0 and not abs(after / before - 1) < LOST:
        said.append(
            f"the picture holds {after / before:.1%} of the light of its input: pixels far "
            "brighter than those around them (fireflies) count less"
        )
    return said
