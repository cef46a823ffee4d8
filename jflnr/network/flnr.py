"""FLNR: the pyramid of adaptive FLR under windows that a small network steers (section 3.3).

The paper's network gives the regression better guides at every pixel. One sample per pixel is so
sparse that most of what such a network does is averaging, which the pyramid does already. So here
a first regression comes before the network, which reads on blocks what its fits found. It says for
every block what else must be alike in a window, how wide the window is and how much the block
counts, and the fits are made anew; and it says where their light is too much or missing (shadows
that no guide shows, fireflies). It ends in zeros before training: FLNR then is adaptive FLR.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

from jflnr.frame import Array, Frame
from jflnr.images.guides import Scene
from jflnr.images.inputs import robust_images
from jflnr.images.noisy_guides import smooth_guide
from jflnr.lazy import jax, jnp, pytree
from jflnr.network import features, unet
from jflnr.regression import adaptive, energy, widths
from jflnr.regression.adaptive import AdaptiveFLR
from jflnr.regression.arguments import check_regression
from jflnr.regression.floor import with_own_light
from jflnr.regression.level import Grid, mean_guides
from jflnr.regression.moments import Guides
from jflnr.regression.pyramid import halve
from jflnr.stages import Known, Parts, Stage, regress

# Planes in which the blocks of a window must be alike: the guides and the brightness.
ALIKE = 6
# Planes that the network gives, and where its parts end.
PLANES, ENDS = ALIKE + 2 + features.CHANNELS, (ALIKE, ALIKE + 1, ALIKE + 2)
# Logarithms of the largest factors on a block's gain, on what it counts and on its window's width.
LARGEST_GAIN, LARGEST_WEIGHT, LARGEST_WIDTH = 2.0, 2.0, 0.7


@pytree
@dataclass(frozen=True)
class FLNR(AdaptiveFLR):
    """Adaptive FLR, steered by a network (docs/flnr.md).

    params: weights, as from `jflnr.network.weights.load`; those that ship for the `size` if None.
    size: of the network: tiny, small or base.
    """

    guides: ClassVar[tuple[str, ...]] = features.GUIDES

    params: Any = None
    size: str = field(default="base", metadata={"static": True})

    @property
    def name(self) -> str:  # type: ignore[override]
        return "flnr" if self.size == "base" else f"flnr-{self.size}"

    @staticmethod
    def images(
        frame: Frame,
        names: Sequence[str],
        scene: Scene | None = None,
        smooth: Callable[..., Array] = smooth_guide,
    ) -> Parts:
        """Those of the guides that the network was trained with, in their order."""
        return robust_images(frame, features.GUIDES, scene, smooth)

    def for_frame(self, frame: Frame, names: tuple[str, ...]) -> FLNR:
        light, normal = frame.indirect.shape, frame.normal.shape
        if sorted(names) != sorted(self.guides):
            raise ValueError(
                f"method {self.name} was trained with the guides {', '.join(self.guides)} and "
                f"works with no others; got {', '.join(names) or 'none'}. flr and flr-adaptive "
                "take any"
            )
        if light != normal:
            raise ValueError(
                f"method {self.name} needs frame.indirect of three channels and as large as the "
                f"guides; got {light} and {normal}"
            )
        return self.with_weights()

    def with_weights(self) -> FLNR:
        """With the weights that ship, if it has none."""
        if self.block != AdaptiveFLR.block:
            raise ValueError(f"method {self.name} works with block {AdaptiveFLR.block} only")
        if self.with_error:
            raise ValueError(f"method {self.name} tells no error; flr-adaptive does")
        if self.params is not None:
            return self
        from jflnr.network.weights import shipped

        return dataclasses.replace(self, params=shipped(self.name))

    def stages(self) -> tuple[Stage, ...]:
        return (*self.before_network(), *self.with_network())

    def before_network(self) -> tuple[Stage, ...]:
        """Passes 1 and 2 and a first fit, in which nothing depends on the weights."""
        side = self.finest
        return (
            *adaptive.first_stages(side),
            Stage(
                fit_first,
                (("read", 2 * side), ("output", 2 * side)),
                ("moments", "light"),
                reach=adaptive.reach_of(self.levels) * side,
                align=side << features.BLURS,
                totals=(("kept", 2 * side), ("light_of_models", side)),
                learn=learn_first,
            ),
        )

    def with_network(self) -> tuple[Stage, ...]:
        """What the network says, the fits as it says, and pass 3."""
        side, scales = self.finest, unet.scales_of(self.with_weights().params)
        return (
            Stage(
                steer,
                (("steering", side),),
                ("read",),
                reach=2 * side * unet.reach_of(scales),
                align=2 * side << (scales - 1),
            ),
            Stage(
                fit_steered,
                (("models", side),),
                ("moments", "steering", "output"),
                reach=adaptive.reach_of(self.levels) * side,
                align=side << (self.levels - 1),
            ),
            *adaptive.last_stages(evaluate, side, ("models",), self),
        )


DEFAULT = FLNR()


def flnr(
    target: jax.Array,
    guides: Guides,
    method: FLNR = DEFAULT,
    *,
    weight: jax.Array | None = None,
    **options: Any,
) -> jax.Array:
    """Denoise with the network's help. Scales with `target`.

    target: `(H, W, 3)`, the noisy radiance, not negative. guides: `(H, W, 5)` or several arrays:
    normal, depth over its typical value, ambient occlusion. method, options: as of `flr_adaptive`.
    weight: `(H, W)`, a mask; 0 removes a pixel, as does any value that is not finite.
    Returns `(H, W, 3)`.
    """
    method = dataclasses.replace(method, **options).with_weights()
    check_regression(target, guides, None, weight)
    return regress(method, {"target": target, "guides": guides, "weight": weight})["image"]


def init(key: jax.Array, widths: Sequence[int]) -> unet.Params:
    """Weights with which FLNR is adaptive FLR. widths: channels of the network, fine to coarse."""
    return unet.init(key, features.COUNT, widths, (4 * PLANES,))


class Steering(NamedTuple):
    """What the network says of the finest blocks; 0 everywhere changes nothing.

    alike: `(ALIKE, h, w)`, added to what must be alike in a window. wider, weight: `(1, h, w)`,
    logarithms of factors on the window's width and on what the block counts in windows. gain:
    `(C, h, w)`, logarithm of a factor on the light.
    """

    alike: jax.Array
    wider: jax.Array
    weight: jax.Array
    gain: jax.Array


def fit_first(method: FLNR, parts: Parts, known: Known) -> Parts:
    """The first fit: what the network reads of it, and the brightness of its models."""
    grid = adaptive.grid_of(parts["moments"], method.finest)
    coarsest, steps = adaptive.fit_steps(method, grid, known)
    mean, guides = known["mean"], known["shift"].size
    given = adaptive.merged_parts(coarsest, steps, parts["light"], grid, known)
    colour = features.colour_of(steps[-1].merged, grid.moments, guides)
    return {
        "read": features.of_steps(steps, guides, mean),
        "output": given["output"],
        "kept": given["kept"],
        "light_of_models": features.light_planes(colour, mean),
    }


def learn_first(method: FLNR, known: Known, sums: Parts) -> Known:
    """How much brightness is given back, and means of the light of the models."""
    linear, logarithmic, count = sums["light_of_models"]
    return adaptive.learn_rate(method, known, sums) | {
        "means": jnp.stack([linear, logarithmic]) / count
    }


def steer(method: FLNR, parts: Parts, known: Known) -> Parts:
    """Let the network read, `(PLANES, h, w)`."""
    read = parts["read"]
    x = features.with_means(read, known["means"], known["mean"])
    planes = unet.unpack(unet.apply(method.params, x)[0], 2 * read.shape[1], 2 * read.shape[2])
    alike, wider, weight, gain = jnp.split(planes, ENDS)
    steering = Steering(
        alike,
        _within(wider, LARGEST_WIDTH),
        _within(weight, LARGEST_WEIGHT),
        _within(gain, LARGEST_GAIN),
    )
    return {"steering": jnp.concatenate(steering)}


def fit_steered(method: FLNR, parts: Parts, known: Known) -> Parts:
    """Fit anew and correct the light as the network says: models `(Q + 2, C, h, w)`."""
    size = parts["moments"].shape[1:]
    says = Steering(*jnp.split(parts["steering"][:, : size[0], : size[1]], ENDS))
    grid, weight = adaptive.grid_of(parts["moments"], method.finest), jnp.exp(says.weight)
    weighted = Grid(grid.moments * weight, grid.noise * weight**2, grid.block)
    # Coarser blocks are steered by the mean of the finest in them.
    planes = jnp.concatenate([says.alike, says.wider])
    said = list[widths.Said]()
    for _ in range(method.levels):
        said.append(widths.Said(planes[:-1], jnp.exp(planes[-1])))
        planes = halve(planes)
    shift, mean = known["shift"], known["mean"]
    levels = widths.fit_levels(
        weighted, shift, features.CHANNELS, method.levels, mean, method, said
    )
    merged = energy.scale(widths.merged_models(*levels), parts["output"], known["rate"])
    # Without light there is none for the gain to act on, either.
    dark = jnp.where(known["wanted"] > 0, features.DARK * mean, 0)
    gain = jnp.exp(says.gain)
    light = (merged[:1] + dark) * gain - dark
    models = jnp.concatenate([light, merged[1:] * gain])
    return {"models": with_own_light(models, mean_guides(grid.moments, shift.size))}


def evaluate(method: FLNR, parts: Parts, known: Known) -> Parts:
    """Pass 3."""
    return adaptive.light_parts(method, parts["models"], parts, known)


def _within(x: jax.Array, limit: float) -> jax.Array:
    return limit * jnp.tanh(x / limit)
