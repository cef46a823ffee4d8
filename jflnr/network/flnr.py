"""FLNR: adaptive FLR, and a small network that corrects its light at every pixel (section 3.3).

The paper's network gives the regression better guides at every pixel. Here the regression comes
first: it averages, which is most of what there is to do at few samples, and tells how far it may be
off. The network then sees where its light and the noisy one differ, on several scales, and what the
guides are there, and says by which factor the light is wrong: edges of shadows, pools of light,
fireflies. It ends in zeros before training: FLNR then is adaptive FLR.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from jflnr.frame import Frame
from jflnr.images.inputs import same_size
from jflnr.lazy import jax, jnp, pytree
from jflnr.network import features, unet
from jflnr.regression import adaptive
from jflnr.regression.adaptive import AdaptiveFLR, flr_adaptive
from jflnr.regression.apply import guides_to_map
from jflnr.regression.arguments import layers_of
from jflnr.regression.moments import Guides, usable
from jflnr.stages import Known, Parts, Stage

# Guides that the network was trained with: normal (3), depth and, where a frame has it, occlusion.
NEEDED, GUIDES = ("normal", "depth"), features.Read.GUIDES
COLOURS = 3
# The largest depth that the network sees, over the median; least and largest of all guides.
DEEPEST = 100
LIMITS = ((-1, -1, -1, 0, 0), (1, 1, 1, DEEPEST, 1))


def to_read(parts: Parts, known: Known) -> tuple[features.Read, jax.Array]:
    """The images that the network reads, from those of adaptive FLR and its results, and the unit
    of their light."""
    target, guides = parts["target"], jnp.concatenate(layers_of(guides_to_map(parts)), axis=-1)
    there = usable(target, guides, parts["weight"])[..., None]

    def shown(image: jax.Array) -> jax.Array:
        # The bound parts two divisions, whose divisors' product may be less than any number.
        bounded = jnp.clip(image / known["unit"], 0, features.BRIGHTEST * known["mean"])
        return jnp.where(there, bounded / known["mean"], 0)

    groups = (*target.shape[:2], target.shape[2] // COLOURS, COLOURS)
    light, noisy = (x.reshape(groups).sum(2) for x in (parts["fitted"], target))
    lowest, highest = jnp.asarray(LIMITS, guides.dtype)[:, : guides.shape[2]]
    guides = jnp.where(there, jnp.clip(guides, lowest, highest), 0)
    ao = guides[..., 4:5] if guides.shape[2] > 4 else jnp.where(there, 1.0, 0.0)
    mask = there.astype(light.dtype)
    images = shown(light), shown(noisy), shown(parts["noise"]), guides[..., :3], guides[..., 3:4]
    read = features.Read(*images, ao.astype(mask.dtype), mask)  # type: ignore[call-arg]
    return read, known["mean"] * known["unit"]


@pytree
@dataclass(frozen=True)
class FLNR(AdaptiveFLR):
    """Adaptive FLR, corrected by a network (docs/flnr.md).

    params: weights, as from `jflnr.network.weights.load`; those that ship for the `size` if None.
    size: of the network: small or base. with_error: tell the error of what the network corrects.
    """

    # What the network reads.
    read: ClassVar[Any] = features.Read
    to_read: ClassVar[Any] = staticmethod(to_read)

    params: Any = None
    size: str = field(default="base", metadata={"static": True})

    @property
    def name(self) -> str:  # type: ignore[override]
        return "flnr" if self.size == "base" else f"flnr-{self.size}"

    @property
    def tells_error(self) -> bool:
        """The network reads it."""
        return True

    def for_frame(self, frame: Frame, names: tuple[str, ...]) -> FLNR:
        same_size(frame, self.name)
        if set(names) not in (set(NEEDED), set(GUIDES)):
            raise ValueError(
                f"method {self.name} was trained with the guides normal, depth and, where there is "
                f"one, ao; got {', '.join(names) or 'none'}. flr and flr-adaptive take any"
            )
        return self.ready(len(names) + 2, frame.indirect.shape[2])

    def ready(self, guides: int, channels: int) -> FLNR:
        """With the weights that ship, if it has none. guides, channels: how many it is to take."""
        if guides not in (4, 5) or channels % COLOURS:
            raise ValueError(
                f"method {self.name} needs 4 or 5 channels of guides, and light of three, or of "
                f"groups of three; got {guides} and {channels}"
            )
        if self.factor > 1:
            raise ValueError(f"method {self.name} needs guides_map at the size of target")
        if self.params is not None:
            return self
        from jflnr.network.weights import shipped

        return dataclasses.replace(self, params=shipped(self.name))

    def before_network(self) -> tuple[Stage, ...]:
        """The stages before the one that corrects."""
        *before, fits, _ = AdaptiveFLR.stages(dataclasses.replace(self, keep_energy=False))
        gives, reach = (("fitted", 0), ("noise", 0)), 2 * self.finest
        return (*before, fits, Stage(evaluate, gives, fits.names, pixels=True, reach=reach))

    def stages(self) -> tuple[Stage, ...]:
        scales = unet.scales_of(self.ready(5, COLOURS).params)
        gives = (("image", 0), *[("error", 0)] * self.with_error)
        return (
            *self.before_network(),
            Stage(
                correct,
                (("image", 0),),
                ("fitted", "noise"),
                pixels=True,
                reach=unet.reach_of(scales),
                align=1 << scales,
                totals=(("sums", 1),),
                learn=adaptive.learn_kept,
            ),
            Stage(restore, gives, ("image", "noise")),
        )


DEFAULT = FLNR()


def flnr(target: jax.Array, guides: Guides, method: FLNR = DEFAULT, **options: Any) -> Any:
    """Denoise with the network's help. Scales with `target`.

    target: `(H, W, C)`, the noisy radiance, not negative; C is 3, or 6, 9, ... for light groups,
    whose results sum to the denoised sum. guides: `(H, W, 5)` or several arrays: normal, depth over
    its typical value, ambient occlusion, which may be missing. All else as of `flr_adaptive`.
    """
    return flr_adaptive(target, guides, method, **options)


def init(key: jax.Array, widths: Sequence[int], read: Any = features.Read) -> unet.Params:
    """Weights that correct nothing. widths: channels of the network, fine to coarse. read: what it
    reads."""
    return unet.init(key, read.PIXEL, features.POOLED, widths, read.SAID)


def evaluate(method: FLNR, parts: Parts, known: Known) -> Parts:
    """Pass 3: the light that the network is to correct, and its error."""
    given = adaptive.evaluate(method, parts, known)
    return {"fitted": given["image"], "noise": given["error"]}


def correct(method: FLNR, parts: Parts, known: Known) -> Parts:
    """The corrected light, `(H, W, C)`, and the brightness before and after."""
    light, (read, _) = parts["fitted"], to_read(parts, known)
    gain = jnp.where(read.mask > 0, features.factors(said(method.params, read)), 1)
    image = light * jnp.tile(gain, light.shape[2] // COLOURS)
    return {"image": image, "sums": adaptive.before_and_after(image, parts, known["unit"])}


def restore(method: FLNR, parts: Parts, known: Known) -> Parts:
    """The result with the brightness of the input, and the error of what was corrected."""
    given = {"image": parts["image"] * known["share"]}
    return given | ({"error": parts["noise"]} if method.with_error else {})


def said(params: unet.Params, read: Any) -> jax.Array:
    """What the network says of every pixel, `(H, W, SAID)`. read: as `features.Read`."""
    height, width = read.light.shape[:2]
    scales = unet.scales_of(params)
    margins = [(0, -size % (1 << scales)) for size in (height, width)] + [(0, 0)]
    read = jax.tree.map(lambda image: jnp.pad(image, margins), read)
    out = unet.apply(params, read.pixels(), features.of_means(read, scales))
    return out[:height, :width]
