"""FLR that adapts to the noise and to edges: weights and windows from the data.

Pass 1 over the pixels collects moments of the brightness; a first fit, the pilot, comes from them.
Pass 2 weighs every pixel by the variance that the pilot predicts and collects the moments of all
channels at fine blocks. Everything else happens on blocks: a pyramid of grids, on each the same
edge-aware window, and from each finer grid as much of the difference to the coarser one as is
signal. Pass 3 evaluates the models. docs/adaptive.md derives the steps.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any, ClassVar

from jflnr.frame import Frame
from jflnr.images.guides import shrink
from jflnr.images.inputs import factor_of, robust_images
from jflnr.lazy import jax, jnp, pytree
from jflnr.regression import energy
from jflnr.regression.apply import apply, guides_to_map
from jflnr.regression.arguments import channel_count, check_options, check_regression
from jflnr.regression.floor import with_own_light
from jflnr.regression.level import Grid, brightness, fit_level, mean_guides
from jflnr.regression.moments import (
    Guides,
    centre,
    collect,
    collect_weighted,
    index_xy,
    unit_of,
    usable,
)
from jflnr.regression.multiscale import TILE, fit_levels
from jflnr.regression.resampling import halve
from jflnr.regression.uncertainty import DETAIL, block_error
from jflnr.regression.window import REACH
from jflnr.stages import Known, Parts, Stage, regress


@pytree
@dataclass(frozen=True)
class AdaptiveFLR:
    """The method of docs/adaptive.md, and its fitted constants.

    sigma: standard deviation of the window, in blocks of its level.
    eps, eps_prime: regularisation where there is no noise (Appendix, Eq. 18).
    noise_ridge: how much of the relative variance is added to both.
    position_ridge: regularisation of the slope across the window, whose variance is about 1.
    exponent, offset: a pixel weighs `1 / ((pilot / mean)^exponent + offset)`.
    guide_scale: guides may differ inside a window by one over this.
    brightness_scale: so may the logarithm of the brightness.
    caution: factor on the noise that is expected in what a finer level adds.
    slack: share by which the mean brightness may differ from the input's.
    floor: least brightness of a pixel, relative to what its model gives the whole block.
    worth: the finest models are fitted only where of what the next coarser ones added more than
    this share is signal; everywhere if None.
    block: side in pixels of the blocks of pass 1; the finest models have half of it. levels: number
    of grids, each twice as coarse. factor: how many times larger the guides are than the light,
    from the frame. keep_energy: give every frame exactly the mean brightness of its input, instead
    of nearly. with_error: tell the standard error of the result too.

    Raises `ValueError` for a number that is not positive.
    """

    name: ClassVar[str] = "flr-adaptive"
    # Occlusion is averaged over 3 x 3 pixels.
    margin: ClassVar[int] = 1
    images: ClassVar[Any] = staticmethod(robust_images)

    sigma: jax.Array | float = 2.0
    eps: jax.Array | float = 1e-4
    eps_prime: jax.Array | float = 1e-4
    noise_ridge: jax.Array | float = 0.07
    position_ridge: jax.Array | float = 0.2
    exponent: jax.Array | float = 1.0
    offset: jax.Array | float = 0.2
    guide_scale: jax.Array | float = 2.0
    brightness_scale: jax.Array | float = 2.0
    caution: jax.Array | float = 1.0
    slack: jax.Array | float = 0.025
    floor: jax.Array | float = 0.2
    worth: jax.Array | float | None = None
    block: int = field(default=8, metadata={"static": True})
    levels: int = field(default=4, metadata={"static": True})
    factor: int = field(default=1, metadata={"static": True})
    keep_energy: bool = field(default=False, metadata={"static": True})
    with_error: bool = field(default=False, metadata={"static": True})

    def __post_init__(self) -> None:
        check_options(self)

    @property
    def finest(self) -> int:
        """Pixels of the light on a side of the finest blocks."""
        return max(self.block // 2, 1)

    @property
    def side(self) -> int:
        """Those of the guides."""
        return self.finest * self.factor

    @property
    def tells_error(self) -> bool:
        """Whether the fits give the error of their models too."""
        return self.with_error

    def for_frame(self, frame: Frame, names: tuple[str, ...]) -> AdaptiveFLR:
        """With the block in pixels of the light."""
        factor = factor_of(frame)
        return dataclasses.replace(self, block=max(self.block // factor, 1), factor=factor)

    def ready(self, guides: int, channels: int) -> AdaptiveFLR:
        """With all that it needs for so many guides and channels of light."""
        return self

    def known(self, images: Parts) -> Known:
        """What guides are measured from, and what the light is divided by."""
        return {"shift": centre(images["guides"]), "unit": unit_of(images["target"])}

    def stages(self) -> tuple[Stage, ...]:
        side = self.side
        light = Stage(
            collect_light,
            (("light", 2 * side),),
            pixels=True,
            totals=(("counted", 2 * side),),
            learn=learn_mean,
        )
        pilot = Stage(
            fit_pilot, (("pilot", 4 * side),), ("light",), reach=REACH * 4 * side, align=4 * side
        )
        moments = Stage(
            collect_moments, (("moments", side),), ("pilot",), pixels=True, reach=4 * side
        )
        models = Stage(
            fit_models,
            (("models", side), ("output", 2 * side), *[("block_error", side)] * self.tells_error),
            ("moments", "light"),
            reach=(reach_of(self.levels) + TILE * (self.worth is not None)) * side,
            align=max(side << (self.levels - 1), TILE * side),
            totals=(("kept", 2 * side),),
            learn=learn_rate,
        )
        gives = (("image", 0), *[("error", 0)] * self.with_error)
        image = Stage(evaluate, gives, models.names, pixels=True, reach=2 * side)
        stages = light, pilot, moments, models
        if not self.keep_energy:
            return (*stages, image)
        image = dataclasses.replace(image, totals=(("sums", self.factor),), learn=learn_kept)
        return (*stages, image, Stage(keep_energy, gives, image.names))


def reach_of(levels: int) -> int:
    """How many of its own blocks the finest fit looks beyond a block, or beyond its tile.

    On every level `REACH` for its window, over fits that follow the coarser level; for the share of
    signal as many of twice the size, with one for what is halved and one for what is interpolated.
    """
    reach = REACH
    for _ in range(levels - 1):
        reach = REACH + 2 * (REACH + 1) + 1 + 2 * (reach + 1)
    return reach


DEFAULT = AdaptiveFLR()


def flr_adaptive(
    target: jax.Array,
    guides: Guides,
    method: AdaptiveFLR = DEFAULT,
    *,
    guides_map: Guides | None = None,
    weight: jax.Array | None = None,
    **options: Any,
) -> Any:
    """Fit the guides to a noisy image, adapting to its noise and its edges.

    Scales with `target`. Not linear in it, but the channels are treated alike: images of three
    channels denoised together as light groups (C = 3, 6, ...) sum to the denoised sum.

    target: `(H, W, C)`, the noisy radiance Y, not negative. guides: `(H, W, Q)`, X without the
    constant, or several such arrays. method: constants and options; options: fields of it to
    replace. guides_map: `(f H, f W, Q)`, as of `flr`, the guides that the models are evaluated on,
    such as those of this frame where light and guides are averaged over several; None evaluates on
    `guides`.
    weight: `(H, W)`, numbers or a boolean mask; 0 removes a pixel, as does any value that is not
    finite.
    Returns `(H, W, C)` or `(f H, f W, C)`; `with_error` also the standard error of its brightness,
    of one channel.

    Raises `ValueError` or `TypeError`, naming the argument, if shapes, types or options are wrong.
    """
    factor = check_regression(target, guides, guides_map, weight)
    method = dataclasses.replace(method, **options, factor=factor)
    method = method.ready(channel_count(guides), target.shape[-1])
    images = {"target": target, "guides": guides, "guides_map": guides_map, "weight": weight}
    given = regress(method, images)
    return (given["image"], given["error"]) if method.with_error else given["image"]


def collect_light(method: Any, parts: Parts, known: Known) -> Parts:
    """Pass 1: unweighted moments of the brightness, on blocks of twice the finest."""
    light = light_of(parts["target"], known["unit"])[..., None]
    images = light, parts["guides"], known["shift"]
    return counted(collect(*images, 2 * method.finest, parts["weight"]), known["shift"].size)


def counted(light: jax.Array, guides: int) -> Parts:
    """Moments of the brightness, and its planes whose sums over the frame are wanted."""
    own = light[index_xy(0, 0, guides, 1)]
    return {"light": light, "counted": jnp.stack([light[0], own])}


def learn_mean(method: Any, known: Known, sums: Parts) -> Known:
    """The brightness of the usable pixels, in sum and in the mean, which is 1 if there is no light,
    where any scale will do."""
    count, light = sums["counted"]
    mean = light / jnp.maximum(count, 1e-12)
    return {"mean": jnp.where(mean > 0, mean, 1), "wanted": light}


def fit_pilot(method: Any, parts: Parts, known: Known) -> Parts:
    """Models of the brightness from the moments of pass 1, `(Q + 1, 1, h, w)`."""
    light = halve(parts["light"])
    grid = Grid(light, jnp.zeros_like(light[:1]), 4 * method.finest)
    return {"pilot": fit_level(grid, known["shift"], 1, known["mean"], method).coefficients}


def collect_moments(method: Any, parts: Parts, known: Known) -> Parts:
    """Pass 2: moments of the weighted pixels on the finest blocks, and one plane of their noise.

    The variance of a pixel grows with its brightness, and the best weight is one over it.
    """
    target, guides, shift = parts["target"], parts["guides"], known["shift"]
    expected = apply(parts["pilot"], guides, shift, 4 * method.finest)[..., 0]
    light = light_of(target, known["unit"])
    weights = weight_of(expected, known["mean"], method)
    weights *= 1 if parts["weight"] is None else parts["weight"]
    there = usable(light[..., None], guides, parts["weight"])
    weights = jnp.where(there, weights, 0)
    squares = jnp.where(there, weights * (light - expected), 0) ** 2
    weighted = target, guides, shift, weights, squares, method.finest, known["unit"]
    return {"moments": jnp.concatenate(collect_weighted(*weighted))}


def fit_models(method: AdaptiveFLR, parts: Parts, known: Known) -> Parts:
    """All levels: models `(Q + 2, C, h, w)`, the last row from `floor.with_own_light`; the
    brightness that they give blocks twice as large; and, asked for, their error."""
    light, moments, count = parts["light"], parts["moments"], known["shift"].size
    coarsest, steps = fit_levels(method, moments, known)
    models = steps[-1].merged if steps else coarsest.coefficients
    output = energy.block_light(models, light, count)
    given = {
        "models": with_own_light(models, mean_guides(moments[:-1], count)),
        "output": output,
        "kept": jnp.stack([light[0] * output, light[0] * output**2]),
    }
    return given | ({"block_error": block_error(coarsest, steps)} if method.tells_error else {})


def learn_rate(method: Any, known: Known, sums: Parts) -> Known:
    """How much brightness is given back."""
    before, squares = sums["kept"]
    return {"rate": energy.rate(known["wanted"], before, squares, method.slack)}


def evaluate(method: AdaptiveFLR, parts: Parts, known: Known) -> Parts:
    """Pass 3: the light of every pixel, `(H, W, C)`, and its error."""
    models = energy.scale(parts["models"], parts["output"], known["rate"])
    shift, unit = known["shift"], known["unit"]
    image = apply(models, guides_to_map(parts), shift, method.side, method.floor) * unit
    given = {"image": image}
    if method.keep_energy:
        coarse = image if method.factor == 1 else shrink(image, method.factor)
        given["sums"] = before_and_after(coarse, parts, unit)
    if method.tells_error:
        own = jnp.einsum("chw,c->hw", models[-1], brightness(models.shape[1], models.dtype))
        # The bound is there for its root's derivative, and for pixels that see no light.
        error = jnp.sqrt(parts["block_error"] + DETAIL * own**2 + 1e-6 * known["mean"] ** 2)
        none = jnp.zeros((*image.shape[:2], 0), error.dtype)
        given["error"] = apply(error[None, None], none, shift[:0], method.side) * unit
    return given


def before_and_after(image: jax.Array, parts: Parts, unit: jax.Array) -> jax.Array:
    """Brightness of the pixels that count, noisy and denoised, over `unit`: `(2, H, W)`."""
    light = light_of(parts["target"])
    counts = usable(light[..., None], (), parts["weight"])
    return jnp.where(counts, jnp.stack([light / unit, light_of(image) / unit]), 0)


def learn_kept(method: Any, known: Known, sums: Parts) -> Known:
    """What brings the brightness of the result to the input's, or near it, over the pixels that
    count."""
    before, after = sums["sums"]
    slack = 0 if method.keep_energy else method.slack
    wanted = jnp.clip(after, (1 - slack) * before, (1 + slack) * before)
    return {"share": jnp.where(after > 0, wanted / jnp.where(after > 0, after, 1), 1)}


def keep_energy(method: Any, parts: Parts, known: Known) -> Parts:
    """The result with the brightness of the input."""
    return {name: parts[name] * known["share"] for name in ("image", "error") if name in parts}


def light_of(target: jax.Array, unit: jax.Array | float = 1) -> jax.Array:
    """Brightness of the pixels over `unit`, `(H, W, C)` to `(H, W)`."""
    weights = brightness(target.shape[-1], target.dtype)
    return sum((w * (target[..., c] / unit) for c, w in enumerate(weights)))


def weight_of(expected: jax.Array, mean: jax.Array, numbers: Any) -> jax.Array:
    """What a place weighs whose brightness is expected to be so much: one over its variance."""
    # The bound is there for the logarithm; written so, the power takes a quarter of the time.
    relative = jnp.log(jnp.maximum(expected / mean, 1e-6))
    return 1 / (jnp.exp(numbers.exponent * relative) + numbers.offset)
