"""The method flnr of `jflnr.denoise`."""

from __future__ import annotations

from collections.abc import Sequence

import jax
import jax.numpy as jnp

from jflnr.flnr import features, regression, unet, weights
from jflnr.flr.adaptive import light_of
from jflnr.flr.energy import rescale
from jflnr.flr.moments import Guides
from jflnr.frame import Array, Frame
from jflnr.inputs import adaptive_images


def denoise_flnr(
    frame: Frame,
    method: str,
    params: unet.Params | None = None,
    *,
    names: Sequence[str] = features.GUIDES,
    keep_energy: bool = False,
    backend: str = "jax",
) -> Array:
    """Denoise with the network of a method, or with weights of one's own.

    frame: as from `read_frame`, with `ao`. params: as from `weights.load`; those that come with the
    package if None. names: the guides asked for. keep_energy: keep the mean radiance exactly.
    backend: `jax` or `opencl`.
    Returns `(H, W, 3)`. Raises as `check` does.
    """
    check(method, names, frame.indirect.shape, frame.normal.shape)
    params = weights.shipped(method) if params is None else params
    if backend == "opencl":
        from jflnr import opencl

        images = adaptive_images(frame, features.GUIDES, smooth=opencl.smooth_guide)
        return opencl.flnr(params=params, keep_energy=keep_energy, **images)
    known, shift, guides = prepared(frame)
    image = evaluate(heard(params, known), known, shift, guides)
    return _with_energy(image, frame) if keep_energy else image


def check(
    method: str, names: Sequence[str], light: tuple[int, ...], normal: tuple[int, ...]
) -> None:
    """Raise `ValueError` for another set of guides than the network was trained with, and for light
    of other than three channels or of another size than the guides. light, normal: their shapes."""
    if sorted(names) != sorted(features.GUIDES):
        raise ValueError(
            f"method {method} was trained with the guides {', '.join(features.GUIDES)} and works "
            f"with no others; got {', '.join(names) or 'none'}. flr and flr-adaptive take any"
        )
    if light != normal:
        raise ValueError(
            f"method {method} needs frame.indirect of three channels and as large as the guides; "
            f"got {light} and {normal}"
        )


def prepared(frame: Frame) -> tuple[regression.Prepared, jax.Array, Guides]:
    """What precedes the network, the shift of the guides and the guides themselves."""
    known, shift, made = _prepared(frame)
    return known, shift, (frame.normal, *made)


@jax.jit
def _prepared(frame: Frame) -> tuple[regression.Prepared, jax.Array, Guides]:
    """`prepared`, with the guides but the normal, which would be copied on its way out.

    A program of its own, as is what follows the network: networks of all sizes share both.
    """
    images = adaptive_images(frame, features.GUIDES)
    known, shift = regression.prepare(images["target"], images["guides"], images["weight"])
    return known, shift, images["guides"][1:]


@jax.jit
def heard(params: unet.Params, known: regression.Prepared) -> regression.Heard:
    """What the network says; the one program that is a size's own."""
    return regression.heard(params, known.x, known.size)


evaluate = jax.jit(regression.evaluate)


@jax.jit
def _with_energy(image: jax.Array, frame: Frame) -> jax.Array:
    weight = None if frame.mask is None else jnp.asarray(frame.mask[..., 0] > 0)
    return rescale(image, light_of(jnp.asarray(frame.indirect)), weight)
