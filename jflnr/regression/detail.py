"""Detail of a picture that no guide shows, given back where it is more than noise.

What the fit leaves of the noisy picture is averaged along the edges of the fit. Noise alone would
leave there what the spread in each window tells; the share of what is left that exceeds it, over
the blocks nearby, is signal (the Wiener filter), and so much of the average is added.
"""

from __future__ import annotations

from jflnr.images.guides import shrink
from jflnr.lazy import jax, jnp
from jflnr.regression.apply import apply
from jflnr.regression.division import divide
from jflnr.regression.features import FARTHEST, average
from jflnr.regression.moments import planes

# Side in pixels of the blocks on which signal is told from noise.
BLOCK = 16
# How far the logarithms of the fit may differ within a window, one standard deviation.
ALIKE = 0.15
# Of the mean brightness, what is dark: noise grows with the light above.
DARK = 0.1
# Windows of fewer pixels beyond the first tell no more of the noise than so many.
FEWEST = 0.3
# Pixels beyond one that its result depends on.
REACH = FARTHEST + 2 * BLOCK


def find_detail(
    noisy: jax.Array, fitted: jax.Array, weight: jax.Array, unit: jax.Array
) -> jax.Array:
    """What the fitted picture lacks of the noisy one's detail, `(H, W, 3)`.

    noisy, fitted: `(H, W, 3)`. weight: `(H, W)`, how much each pixel counts, 0 to 1; one that is
    not finite does not. unit: mean brightness of the picture, `(1, 1, 1)` or of its size.
    """
    unit = jnp.maximum(unit, 1e-12)
    scale = jnp.mean(fitted, axis=-1, keepdims=True) + DARK * unit
    left = jnp.stack(planes((noisy - fitted) / scale))
    usable = jnp.all(jnp.isfinite(left), axis=0)
    left = jnp.where(usable, left * weight, 0)
    follow = jnp.concatenate([left, jnp.mean(left**2, axis=0, keepdims=True)])
    steer = jnp.where(usable, jnp.stack(planes(jnp.log1p(fitted / unit))), 0)
    number, (*mean, square) = average(steer, follow, usable, ALIKE)
    detail = jnp.stack(mean, axis=-1)
    signal = jnp.mean(detail**2, axis=-1)
    noise = jnp.maximum(square - signal, 0) / jnp.maximum(number - 1, FEWEST)
    found = shrink(jnp.stack([signal, signal - noise], axis=-1), BLOCK)
    share = divide(jnp.maximum(found[..., 1], 0), found[..., 0])[None, None]
    none = jnp.zeros((*usable.shape, 0), share.dtype)
    share = apply(share, none, jnp.zeros(0, share.dtype), BLOCK)
    return share * detail * scale
