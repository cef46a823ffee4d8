"""What the network reads: of every pixel, and of means over 2, 4, 8 and 16 pixels; free of units.

Light is divided by the frame's mean before, so what is read does not change with its scale.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from jflnr.lazy import jax, jnp

# Of every pixel, and of every mean.
PIXEL, POOLED = 15, 6
# Light below such shares of the frame's mean is as good as dark.
DARK = 0.02
# No light is brighter, in means of the frame: squares of fireflies must not overflow.
BRIGHTEST = 6e4
LUMINANCE = (0.2126, 0.7152, 0.0722)


class Read(NamedTuple):
    """The images that are read, `(H, W, 3)` or `(H, W, 1)`; zeros where `mask` is 0.

    light, noisy: the light of adaptive FLR, and that before it, over the frame's mean brightness.
    error: standard error of its brightness. depth: over its median. ao: 1 where there is none.
    """

    light: Any
    noisy: Any
    error: Any
    normal: Any
    depth: Any
    ao: Any
    mask: Any


def luminance(light: jax.Array) -> jax.Array:
    """`(H, W, 3)` to `(H, W, 1)`."""
    return light @ jnp.asarray(LUMINANCE, light.dtype)[:, None]


def of_pixels(read: Read) -> jax.Array:
    """`(H, W, PIXEL)`."""
    light, noisy = luminance(read.light), luminance(read.noisy)
    residual = (noisy - light) / (light + 0.05)
    planes = [
        jnp.log(light + DARK),
        jnp.clip(residual, -1, 4) / 2,
        jnp.log1p((noisy + 0.05) / (light + 0.05)),
        jnp.log(read.error / (light + 0.05) + 0.01) + 1.5,
        jnp.log((read.light + DARK) / (light + DARK)),
        read.normal,
        jnp.log(read.depth + 0.05),
        2 * read.ao - 1,
        jnp.minimum(read.error, 3),
        read.mask,
        jnp.log(noisy + 0.03),
    ]
    return jnp.concatenate(planes, axis=-1)


def of_means(read: Read, scales: int) -> list[jax.Array]:
    """What is left in the means: noisy over denoised light, and the noise.

    The noisy light also without what exceeds the denoised one four times.
    Returns `(H / n, W / n, POOLED)` for n = 2, 4, ..., the last of which divides H and W.
    """
    light, noisy = luminance(read.light), luminance(read.noisy)
    robust = jnp.minimum(noisy, 4 * light + 0.1)
    means = [read.light, light, read.noisy, noisy, robust, (noisy - light) ** 2]
    planes = jnp.concatenate(means, axis=-1)
    found = []
    for scale in range(1, scales + 1):
        planes = halved(planes)
        before, after, square = planes[..., :4], planes[..., 4:8], planes[..., 9:]
        light, robust = planes[..., 3:4], planes[..., 8:9]
        noise = square / 4**scale / (light + DARK) ** 2
        left = [_ratio(after, before), _ratio(robust, light), 0.5 * jnp.log(noise + 1e-3)]
        found.append(jnp.concatenate(left, axis=-1))
    return found


def halved(image: jax.Array) -> jax.Array:
    """Means over 2 x 2 pixels of an image of even size."""
    height, width, count = image.shape
    return image.reshape(height // 2, 2, width // 2, 2, count).mean((1, 3))


def _ratio(after: jax.Array, before: jax.Array) -> jax.Array:
    return jnp.log((after + 0.05 * before + DARK) / (1.05 * before + DARK))
