"""FLNR of whole pictures: the regression of all materials, and a network that corrects its picture.

The network is that of `flnr.py`; it reads the denoised and the noisy picture, what is known of the
surfaces, and what was taken from their albedo and normals as noise.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from jflnr.frame import Frame
from jflnr.images.guides import Scene
from jflnr.lazy import jax, jnp, pytree
from jflnr.network import unet
from jflnr.network.features import BRIGHTEST, DARK, doubts, factors, luminance
from jflnr.network.flnr import COLOURS, DEEPEST, said
from jflnr.regression.adaptive import light_of
from jflnr.regression.detail import BLOCK as DETAIL_BLOCK
from jflnr.regression.detail import REACH
from jflnr.regression.features import blur
from jflnr.regression.picture import (
    EVERYTHING,
    GUIDES,
    LEAST_ALBEDO,
    QUIETLY,
    WholePicture,
    composed,
    finished,
    own_light,
    picture_in,
    sample_count,
)
from jflnr.stages import Known, Parts, Stage

# The network has seen no means of more.
MOST_SAMPLES = 64
# Pixels between which light is lent, and the luminance that is too little to be.
NEAR, LEAST_LIGHT = 3, 1e-3
# Of what a surface reflects, the most that is put down to the texture that was taken from it.
MOST_TEXTURE = 4


class Read(NamedTuple):
    """The images that are read, `(H, W, 3)` or `(H, W, 1)`.

    light, noisy: the denoised picture and that before it, over the frame's mean brightness. error:
    standard error of its brightness. own: of the picture, what no surface reflects. albedo, normal,
    seen_normal, depth, alpha: without noise; albedo_left, normal_left: what of them was noise, the
    latter the length of the difference. weight: less than 1 for fireflies. samples: that a pixel is
    a mean of.
    """

    # As of `features.Read`.
    PIXEL = 27  # type: ignore[misc]
    SAID = 7  # type: ignore[misc]
    GUIDES = WholePicture.guides  # type: ignore[misc]
    LAYER, COVER = "beauty", "alpha"  # type: ignore[misc]
    OF_NOISE = (  # type: ignore[misc]
        *("light", "noisy", "error", "own", "albedo", "albedo_left", "normal", "normal_left"),
        *("seen_normal", "depth", "alpha", "weight", "samples"),
    )
    LIGHT = ("light", "noisy", "own")  # type: ignore[misc]
    COLOURS = (*LIGHT, "albedo", "albedo_left")  # type: ignore[misc]
    DIRECTIONS = ("normal", "seen_normal")  # type: ignore[misc]

    light: Any
    noisy: Any
    error: Any
    own: Any
    albedo: Any
    albedo_left: Any
    normal: Any
    normal_left: Any
    seen_normal: Any
    depth: Any
    alpha: Any
    weight: Any
    samples: Any

    def pixels(self) -> jax.Array:
        """What is read of every pixel, `(H, W, 27)`."""
        light, noisy = luminance(self.light), luminance(self.noisy)
        planes = [
            jnp.log(self.light + DARK),
            jnp.clip((self.noisy - self.light) / (light + 0.05), -1, 4) / 2,
            *doubts(light, noisy, self.error),
            jnp.minimum(self.error, 3),
            2 * jnp.sqrt(self.albedo + 1e-4) - 1,
            2 * self.albedo_left,
            self.normal,
            self.normal_left,
            self.seen_normal,
            jnp.log(self.depth + 0.05),
            2 * self.alpha - 1,
            jnp.minimum(luminance(self.own) / (light + DARK), 1),
            self.weight,
            jnp.log2(jnp.clip(self.samples, 1, MOST_SAMPLES)) / 4,
        ]
        return jnp.concatenate(planes, axis=-1)

    def corrected(self, said: jax.Array) -> jax.Array:
        """The picture `(H, W, 3)` by what the network says of it, `(H, W, 7)`.

        Factors on its light: what is dark may brighten where something covers it. How much it takes
        of what is left of the noisy picture, at the pixel and as a mean of those around; of what
        shines near it, which wires thinner than a pixel need where no sample met them, and the less
        the more samples did not; and of what the light would be with the albedo that was taken for
        noise.
        """
        dark, left = DARK * self.alpha, self.left()
        lent = self.shining() / jnp.maximum(self.samples, 1)
        offered = left, _blurred(left), lent, self.textured()
        shares = jnp.split(jnp.tanh(said[..., COLOURS:]), len(offered), axis=-1)
        taken = sum(share * image for share, image in zip(shares, offered, strict=True))
        gains = factors(said[..., :COLOURS])
        return jnp.maximum((self.light + dark) * gains - dark + taken, 0)

    def shining(self) -> jax.Array:
        """The light within `NEAR` pixels, the brighter the more it counts, `(H, W, 3)`."""
        bright = luminance(self.light)
        sums = jnp.concatenate([self.light * bright, bright], axis=-1)
        for _ in range(NEAR):
            sums = _blurred(sums)
        return sums[..., :COLOURS] / (sums[..., COLOURS:] + LEAST_LIGHT)

    def textured(self) -> jax.Array:
        """What the light lacks if the albedo's noise is its texture, `(H, W, 3)`."""
        taken = self.albedo_left / jnp.maximum(self.albedo, LEAST_ALBEDO)
        return jnp.maximum(self.light - self.own, 0) * jnp.clip(taken, -1, MOST_TEXTURE)

    def left(self) -> jax.Array:
        """What is left of the noisy picture, `(H, W, 3)`; fireflies are no brighter than that."""
        light, noisy = luminance(self.light), luminance(self.noisy)
        weight = self.weight * jnp.minimum((4 * light + 0.1) / jnp.maximum(noisy, 1e-6), 1)
        return jnp.where(self.weight > 0, self.noisy * weight - self.light, 0)


def to_read(parts: Parts, known: Known) -> tuple[Read, Any]:
    """The images that the network reads, from those of `picture` and its results, and the unit of
    their light."""
    xp: Any = parts["fitted"].__array_namespace__()
    unit = parts["brightness"]
    over = xp.where(unit > 0, unit, 1)

    def shown(image: Any) -> Any:
        return xp.minimum(xp.fmax(image / over, 0), BRIGHTEST)

    noisy = parts["target"] * parts["surface"] + parts["noisy_own"]
    light = [shown(image) for image in (parts["fitted"], noisy, parts["noise"], parts["own"])]
    weight = parts["weight"][..., None]
    alpha = xp.ones_like(weight) if parts["alpha"] is None else xp.clip(parts["alpha"], 0, 1)
    others = {"alpha": alpha, "weight": weight}
    return Read(*light, **parts["surfaces"] | others), unit


def surfaces_of(frame: Frame, scene: Scene, guides: tuple[Any, ...]) -> Parts:
    """What the network reads of the surfaces. guides: as `picture` takes them."""
    picture = picture_in(frame, scene)
    xp: Any = picture.beauty.__array_namespace__()
    there = [name for name in GUIDES if getattr(picture, name) is not None]
    clean = dict(zip(there, guides, strict=True))
    number = lambda image: xp.where(xp.isfinite(image), image, 0)
    albedo, normal = number(clean["albedo"]), number(clean["normal"])
    left = number(picture.normal) - normal
    none, one = xp.zeros_like(normal), xp.ones_like(normal[..., :1])
    surfaces = {
        "albedo": albedo,
        "albedo_left": xp.clip(number(picture.albedo), 0, 1) - albedo,
        "normal": normal,
        "normal_left": xp.sqrt(xp.einsum("...c,...c", left, left))[..., None],
        "seen_normal": number(clean.get("seen_normal", none)),
        "depth": xp.clip(number(clean.get("depth", one)), 0, DEEPEST),
        "samples": sample_count(frame.samples, scene.averaged) * one,
    }
    return {"surfaces": surfaces, "noisy_own": own_light(picture)}


@pytree
@dataclass(frozen=True)
class PictureFLNR(WholePicture):
    """The method: `picture`, corrected by a network (docs/flnr.md).

    params: weights, as from `jflnr.network.weights.load`; those that ship if None. The rest is of
    `WholePicture`; the error is that of what the network corrects.
    """

    name: ClassVar[str] = "flnr-picture"
    read: ClassVar[Any] = Read
    to_read: ClassVar[Any] = staticmethod(to_read)
    others: ClassVar[Any] = staticmethod(surfaces_of)

    # The network has learned from pictures that were refined everywhere.
    worth: jax.Array | float | None = None
    params: Any = None

    @property
    def tells_error(self) -> bool:
        """The network reads it."""
        return True

    def for_frame(self, frame: Frame, names: tuple[str, ...]) -> PictureFLNR:
        super().for_frame(frame, names)
        return self.ready(len(self.guides), COLOURS)

    def ready(self, guides: int, channels: int) -> PictureFLNR:
        """With the weights that ship, if it has none."""
        if self.params is not None:
            return self
        from jflnr.network.weights import shipped

        return dataclasses.replace(self, params=shipped(self.name, Read))

    def before_network(self) -> tuple[Stage, ...]:
        """The stages before the one that corrects."""
        *fit, _ = WholePicture.stages(dataclasses.replace(self, with_error=True, lobes=False))
        gives, reads = (("fitted", 0), ("noise", 0)), ("image", "error")
        return (*fit, Stage(put, gives, reads, True, REACH, align=DETAIL_BLOCK, composes=True))

    def stages(self) -> tuple[Stage, ...]:
        lobes = [("passes", 0)] * self.lobes
        gives = (("image", 0), *[("error", 0)] * self.with_error, *lobes)
        scales = unet.scales_of(self.ready(len(self.guides), COLOURS).params)
        reach = EVERYTHING if self.lobes else unet.reach_of(scales)
        last = Stage(
            correct, gives, ("fitted", "noise"), True, reach, align=1 << scales, composes=True
        )
        return (*self.before_network(), last)


@QUIETLY
def put(method: PictureFLNR, parts: Parts, known: Known) -> Parts:
    """The picture that the network is to correct, `(H, W, 3)`, and its error."""
    error = parts["error"] * light_of(parts["surface"])[..., None]
    return {"fitted": known.get("composed", composed)(parts), "noise": error}


def correct(method: PictureFLNR, parts: Parts, known: Known) -> Parts:
    """The corrected picture, as `regression.picture.compose` gives it."""
    read, unit = to_read(parts, known)
    image = known.get("corrected", corrected)(method.params, read) * unit
    fitted = parts["fitted"]
    xp: Any = fitted.__array_namespace__()
    image = xp.where(xp.isfinite(fitted), image, fitted)
    return finished(method, image, parts | {"error": parts["noise"]})


def corrected(params: unet.Params, read: Read) -> Any:
    """The picture `(H, W, 3)` that the network makes of what it reads."""
    return read.corrected(said(params, read))


def _blurred(image: jax.Array) -> jax.Array:
    """`features.blur` of an image `(H, W, C)`."""
    return jnp.moveaxis(blur(jnp.moveaxis(image, -1, 0)), 0, -1)
