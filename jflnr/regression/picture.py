"""A whole picture, with all its materials, denoised by one regression.

What reflects or transmits is `light = (beauty - emission - environment) / albedo`; the albedo
follows mirrors and glass, as a path tracer's denoising albedo does, and beyond white shows the
lamps that are seen in them. Emission and environment know no noise but that of their edges, and are
filtered as features are.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

import numpy as np

from jflnr.frame import Array, Frame
from jflnr.images.guides import FAR, FILTERS, Filters, Scene, draw_near, mean_light, scene_of
from jflnr.images.inputs import same_size
from jflnr.images.noisy_guides import antialiased, holds_light
from jflnr.lazy import jax, jit, jnp, pytree
from jflnr.regression.adaptive import AdaptiveFLR, light_of
from jflnr.regression.detail import BLOCK as DETAIL_BLOCK
from jflnr.regression.detail import REACH, find_detail
from jflnr.regression.features import FARTHEST, SAMPLES, combine, coverage, filter_features
from jflnr.regression.lobes import split
from jflnr.stages import Known, Parts, Stage, regress

# Side in pixels of the blocks of the first pass.
BLOCK = 2
# Darker surfaces are not divided by their albedo, which is hardly known.
LEAST_ALBEDO = 0.02
# Of what covers less of a pixel too little is known to learn from it.
LEAST_ALPHA = 0.02
# A pixel so many times brighter than those around weighs as little as if it were no brighter.
FIREFLY, AROUND = 20, 3
# The noise of what covers a pixel falls with the number of samples to such a power. Pixels on each
# side that tell it from what is there.
STRATIFIED, NEARBY = 1.25, 2
# Guides of the lobes, which are fitted coarsely: normal, albedo and normal of what is seen.
LOBE_GUIDES = 3
# On a device numpy does what JAX does elsewhere: pixels that are not finite are no mistake.
QUIETLY = np.errstate(divide="ignore", invalid="ignore", over="ignore")
# Pixels beyond any frame.
EVERYTHING = 1 << 20


GUIDES = "normal", "albedo", "seen_normal", "depth", "position"


class Picture(NamedTuple):
    """What a renderer tells of a picture, `(H, W, C)` each; None where it does not.

    beauty: the noisy picture. albedo: of the light that is seen, also through mirrors and glass;
    with emission and environment added everywhere, as Cycles does, or nowhere. normal: unit.
    seen_normal: of what is seen in mirrors and through glass. depth: over its median. position:
    about a point of the scene, over the median depth. emission: seen directly. environment: seen
    directly. alpha: share of the pixel that is covered, on a transparent film, whose beauty does
    not hold the environment, and whose other layers hold 0 beyond. colours: `(H, W, 3 n)`, of lobes
    (`lobes.split`).
    """

    beauty: Array
    albedo: Array
    normal: Array
    seen_normal: Array | None = None
    depth: Array | None = None
    position: Array | None = None
    emission: Array | None = None
    environment: Array | None = None
    alpha: Array | None = None
    colours: Array | None = None


def cleaned(
    picture: Picture,
    unit: Array,
    samples: Array | float | None,
    averaged: Array,
    filtered: Callable[..., Any] | None = None,
) -> Picture:
    """The picture with layers, but for the beauty, that are free of noise.

    unit: brightness of the picture, `()`. samples: per pixel, or `(H, W, 1)`; 0 if nobody says how
    many, None if there may be none but of the pixels' centres. averaged: whether the layers show
    that they are means of several, `()`. filtered: `filter_layers`, or that of a device.
    """
    xp: Any = picture.beauty.__array_namespace__()
    layers = {name: layer for name, layer in picture._asdict().items() if layer is not None}
    layers.pop("beauty")
    number = sample_count(samples, averaged)
    found = (filtered or filter_layers)(layers, xp.maximum(unit, 1e-12), number)
    clean = dict(zip(layers, found, strict=True))
    if samples is None:
        clean = {name: xp.where(averaged, clean[name], layer) for name, layer in layers.items()}
    return picture._replace(**clean)


def sample_count(samples: Array | float | None, averaged: Array) -> Array:
    """Samples per pixel, a guess where nobody says how many. The rest is as of `cleaned`."""
    xp: Any = averaged.__array_namespace__()
    guess = xp.where(averaged, SAMPLES, 1)
    return guess if samples is None else xp.where(samples > 0, samples, guess)


def own_cover(noisy: Array, filtered: Array, samples: Array) -> Array:
    """Alpha, with what its noise does not explain of what the filter took (the Wiener filter).

    All `(H, W, 1)`. samples: per pixel; they lie apart, so that the noise falls a little faster
    than one over their number.
    """
    xp: Any = noisy.__array_namespace__()
    taken = xp.where(xp.isfinite(noisy), noisy, filtered) - filtered
    noise = filtered * (1 - filtered) / samples**STRATIFIED
    square, noise = (
        combine(image[..., 0], NEARBY, xp.add)[..., None] for image in (taken**2, noise)
    )
    share = xp.maximum(square - noise, 0) / xp.where(square > 0, square, 1)
    return xp.clip(filtered + share * taken, 0, 1)


def images_of(picture: Picture, clean: Picture, samples: Array, unit: Array, lit: Array) -> Parts:
    """What `flr_adaptive` takes: light, guides and weight; and what makes it a picture again.

    samples: per pixel. unit: brightness of the picture, `()`. lit: whether its albedo shows what
    shines, as `holds_light` says.
    """
    xp: Any = picture.beauty.__array_namespace__()
    covered = xp.ones((1,) * 3, xp.float32) if clean.alpha is None else xp.clip(clean.alpha, 0, 1)
    shining = xp.where(lit, light_in(clean, clean.emission, clean.environment), 0)
    surface = xp.maximum(clean.albedo - shining, LEAST_ALBEDO * covered)
    light = xp.maximum(picture.beauty - own_light(picture), 0) / xp.maximum(surface, 1e-6)
    weight = firefly_weight(light_of(light)) * (covered > LEAST_ALPHA)[..., 0]
    guiding = clean._replace(albedo=xp.clip(clean.albedo, 0, 1))
    layers = [getattr(guiding, name) for name in GUIDES]
    guides = tuple(layer for layer in layers if layer is not None)
    noisy, film = picture.alpha, clean.alpha
    if noisy is not None and film is not None:
        film = own_cover(noisy, film, samples)
    images = {"target": light, "guides": guides, "guides_map": None, "weight": weight}
    images |= {"surface": surface, "own": own_light(clean), "alpha": clean.alpha}
    # The brightness by rows, as parts of a frame are.
    rows = xp.broadcast_to(unit, (len(light), 1, 1))
    images |= {"beauty": picture.beauty, "film": film, "brightness": rows}
    if picture.colours is None:
        return images
    for name, own in (("own_noisy", picture), ("own_clean", clean)):
        images[name] = tuple(light_in(own, layer) for layer in (own.emission, own.environment))
    return images | {"colours": (picture.colours, clean.colours)}


def composed(images: Parts) -> Array:
    """The picture `(H, W, 3)` from `image`, its light without noise, with its detail.

    It is nowhere darker than what is emitted and seen of the environment.
    """
    noisy, fitted = (
        jnp.maximum(images[light], 0) * images["surface"] + images["own"]
        for light in ("target", "image")
    )
    detail = find_detail(noisy, fitted, images["weight"], images["brightness"])
    return jnp.maximum(fitted + detail, images["own"])


@pytree
@dataclass(frozen=True)
class WholePicture(AdaptiveFLR):
    """The method: adaptive FLR of what the surfaces of a picture reflect and transmit.

    lobes: give the light passes too. The rest is of `AdaptiveFLR`; the error is that of the
    picture's brightness.
    """

    name: ClassVar[str] = "picture"
    # A firefly is told from pixels around it, and these are divided by a filtered albedo.
    margin: ClassVar[int] = AROUND + FARTHEST
    guides: ClassVar[tuple[str, ...]] = (
        *("normal", "seen_albedo", "seen_normal", "depth", "position"),
    )

    # What is read besides, of the frame, its scene and the guides.
    others: ClassVar[Callable[..., Parts]] = staticmethod(lambda frame, scene, guides: {})

    slack: jax.Array | float = 0.005
    worth: jax.Array | float | None = 0.5
    block: int = field(default=BLOCK, metadata={"static": True})
    lobes: bool = field(default=False, metadata={"static": True})

    @property
    def features(self) -> tuple[str, ...]:
        """The layers that it reads."""
        lobes = ("lobes", "lobe_colours") if self.lobes else ()
        return ("beauty", "alpha", "emitted", "environment", "samples", *self.guides, *lobes)

    def for_frame(self, frame: Frame, names: tuple[str, ...]) -> WholePicture:
        if frame.beauty is None or frame.seen_albedo is None:
            raise ValueError("method picture is for pictures of other programs: there is no beauty")
        same_size(frame, self.name)
        if self.lobes and frame.lobes is None:
            raise ValueError("lobes are made of light passes with their colours: there are none")
        return self

    @QUIETLY
    def images(
        self,
        frame: Frame,
        names: tuple[str, ...],
        scene: Scene | None = None,
        filters: Filters = FILTERS,
    ) -> Parts:
        """The light of the surfaces, the guides, and what makes it a picture again."""
        scene = scene_of(frame) if scene is None else scene
        make = _images if filters.layers is None else _images.__wrapped__
        return make(frame, scene, filters.layers, self.others)

    def stages(self) -> tuple[Stage, ...]:
        fit = super().stages()
        given = tuple(name for name, _ in fit[-1].gives)
        gives = tuple((name, 0) for name in (*given, *(["passes"] if self.lobes else [])))
        # The shares of the passes are fitted to the whole frame.
        reach = EVERYTHING if self.lobes else REACH
        last = Stage(compose, gives, given, True, reach, align=DETAIL_BLOCK, composes=True)
        return *fit, last


DEFAULT = WholePicture()


def denoise_picture(
    picture: Picture,
    method: WholePicture = DEFAULT,
    *,
    samples: jax.Array | float | None = None,
    **options: Any,
) -> Picture:
    """The picture without noise: beauty, and filtered every layer that came with it.

    Scales with beauty, emission and environment. No light is negative.

    method: constants and options, without `lobes`; options: fields of it to replace. samples: as of
    `cleaned`.
    """
    unit, averaged = mean_light(picture.beauty), antialiased(picture.normal)
    clean = cleaned(picture, unit, samples, averaged)
    lit = holds_light(picture.albedo, light_in(picture, picture.emission, picture.environment))
    images = images_of(picture, clean, sample_count(samples, averaged), unit, lit)
    given = regress(dataclasses.replace(method, **options), images)
    return clean._replace(beauty=given["image"][..., :3], alpha=images["film"])


@QUIETLY
def compose(method: WholePicture, parts: Parts, known: Known) -> Parts:
    """What `finished` says, of the light that the fit gave."""
    picture = known.get("composed", composed)(parts)
    if method.with_error:
        parts = parts | {"error": parts["error"] * light_of(parts["surface"])[..., None]}
    return finished(method, picture, parts)


def finished(method: WholePicture, image: Array, parts: Parts) -> Parts:
    """The picture, `(H, W, 3)`, or with its alpha `(H, W, 4)`; its error; and its light passes, as
    in `Frame.lobes`, their colours, and what is emitted and seen of the environment, as planes of
    `(H, W, C)`.

    image: `(H, W, 3)`; the beauty passes through where a layer that makes it is no number. parts:
    with `error`, of the picture, if the method tells it.
    """
    alpha = parts["film"]
    xp: Any = image.__array_namespace__()
    known = xp.all(xp.isfinite(image), axis=-1, keepdims=True)
    image = xp.where(known, image, parts["beauty"])
    given = {"image": image if alpha is None else xp.concatenate([image, alpha], axis=-1)}
    if method.lobes:
        images = parts["lobes"], parts["colours"], parts["guides"][:LOBE_GUIDES], parts["weight"]
        noisy, own = parts["target"] * parts["surface"], parts["own"]
        # What is emitted is no brighter than the picture.
        share = xp.minimum(image / xp.where(own > 0, own, 1), 1)
        share = xp.where(own > 0, share, 1)
        emitted, environment = parts["own_clean"]
        emitted, environment = share * emitted, environment * (share if alpha is None else 1)
        reflected = xp.where(known, xp.maximum(image - share * own, 0), 0)
        passes, left = split(reflected, noisy, *images)
        planes = passes, parts["colours"][1], emitted + left, environment
        before = parts["lobes"], parts["colours"][0], *parts["own_noisy"]
        written = (xp.concatenate(each, axis=-1) for each in (planes, before))
        given["passes"] = xp.where(known, *written)
    if method.with_error:
        given["error"] = parts["error"]
    return given


@functools.partial(jit, static_argnames=("filtered", "others"))
def _images(
    frame: Frame, scene: Scene, filtered: Callable[..., Any] | None, others: Callable[..., Parts]
) -> Parts:
    picture = picture_in(frame, scene)
    clean = cleaned(picture, scene.light, frame.samples, scene.averaged, filtered)
    samples = sample_count(frame.samples, scene.averaged)
    images = images_of(picture, clean, samples, scene.light, scene.lit)
    return images | {"lobes": frame.lobes} | others(frame, scene, images["guides"])


def picture_in(frame: Frame, scene: Scene) -> Picture:
    """The picture in a frame, its lengths over the median depth; what is nowhere is far."""
    xp: Any = frame.depth.__array_namespace__()
    there, scale = frame.depth > 0, 1 / scene.depth
    depth = xp.where(frame.depth == 0, FAR + 1, draw_near(frame.depth * scale))
    position = frame.position
    if position is not None:
        position = xp.where(there, (position - scene.middle) * scale, 0)
    layers: dict[str, Any]
    layers = {"beauty": frame.beauty, "albedo": frame.seen_albedo, "normal": frame.normal}
    layers |= {"seen_normal": frame.seen_normal, "depth": depth, "position": position}
    layers |= {"emission": frame.emitted, "environment": frame.environment}
    return Picture(**layers, alpha=frame.alpha, colours=frame.lobe_colours)


def own_light(picture: Picture) -> Array:
    """What no surface reflects and beauty holds, `(H, W, 3)`: emission, and what is behind all."""
    behind = None if picture.alpha is not None else picture.environment
    return light_in(picture, picture.emission, behind)


def light_in(picture: Picture, *parts: Array | None) -> Array:
    """The sum of those parts that there are, `(H, W, 3)`."""
    xp: Any = picture.beauty.__array_namespace__()
    there = [part for part in parts if part is not None]
    return functools.reduce(xp.add, there) if there else xp.zeros_like(picture.beauty)


def filter_layers(
    layers: dict[str, Array], unit: Array, samples: Array | float
) -> tuple[Array, ...]:
    """The layers of a picture without their noise. unit, samples: as of `cleaned`."""
    how = {name: steer_of(name, unit) for name in layers}
    steering = [steer(layers[name], steered) for name, steered in how.items() if steered]
    return filter_features(steering, list(layers.values()), samples)


class Steer(NamedTuple):
    """How a layer is scaled to vary by about 1, to tell the edges.

    mean: of its channels only. least: of what covers a pixel, the brightness of what counts as
    bright; None for a layer that is multiplied by `factor` instead.
    """

    mean: bool = False
    least: Any = None
    factor: float = 1.0


def steer_of(name: str, unit: Array) -> Steer | None:
    """How a layer steers; None for depth and position of the pixels' centres, which are aliased and
    would break thin lines, and others that do not. unit: brightness of the picture, `()`."""
    if name in ("emission", "environment"):
        return Steer(mean=True, least=unit)
    if name == "albedo":
        return Steer(least=1.0)
    if name == "alpha":
        return Steer()
    return Steer(factor=0.5) if name in ("normal", "seen_normal") else None


def steer(layer: Array, how: Steer) -> Array:
    """A layer so scaled that it varies by about 1."""
    if how.mean:
        layer = jnp.mean(layer, axis=-1, keepdims=True)
    return how.factor * layer if how.least is None else coverage(layer, how.least)


def firefly_weight(light: Array) -> Array:
    """Less than 1 where a pixel is far brighter than those around it, `(H, W)` to `(H, W)`."""
    xp: Any = light.__array_namespace__()
    light = xp.where(xp.isfinite(light), light, 0)
    around = xp.maximum(combine(light, AROUND, xp.add) - light, 0) / ((2 * AROUND + 1) ** 2 - 1)
    return xp.minimum(1, FIREFLY * around / xp.where(light > 0, light, 1))
