"""What the network reads: of every pixel, and of means over 2, 4, 8 and 16 pixels; free of units.

Light is divided by the frame's mean before, so what is read does not change with its scale.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from jflnr.lazy import jax, jnp

# Of every mean.
POOLED = 6
# Light below such shares of the frame's mean is as good as dark.
DARK = 0.02
# No light is brighter, in means of the frame: squares of fireflies must not overflow.
BRIGHTEST = 6e4
LUMINANCE = (0.2126, 0.7152, 0.0722)
# Logarithm of the largest factor on the light.
LARGEST = 1.5


class Read(NamedTuple):
    """The images that are read, `(H, W, 3)` or `(H, W, 1)`; zeros where `mask` is 0.

    light, noisy: the light of adaptive FLR, and that before it, over the frame's mean brightness.
    error: standard error of its brightness. depth: over its median. ao: 1 where there is none.
    """

    # How many values are read of a pixel, and said of it; the guides of a frame that they come
    # from, the noisy layer of training frames, and the image that says where there is something.
    PIXEL = 15  # type: ignore[misc]
    SAID = 3  # type: ignore[misc]
    GUIDES = ("normal", "depth", "ao")  # type: ignore[misc]
    LAYER, COVER = "indirect", "mask"  # type: ignore[misc]
    # What changes with the noise, and the images that are colours, light, and directions.
    OF_NOISE = ("light", "noisy", "error", "ao")  # type: ignore[misc]
    COLOURS = LIGHT = ("light", "noisy")  # type: ignore[misc]
    DIRECTIONS = ("normal",)  # type: ignore[misc]

    light: Any
    noisy: Any
    error: Any
    normal: Any
    depth: Any
    ao: Any
    mask: Any

    def pixels(self) -> jax.Array:
        """What is read of every pixel, `(H, W, 15)`."""
        light, noisy = luminance(self.light), luminance(self.noisy)
        residual = (noisy - light) / (light + 0.05)
        planes = [
            jnp.log(light + DARK),
            jnp.clip(residual, -1, 4) / 2,
            *doubts(light, noisy, self.error),
            jnp.log((self.light + DARK) / (light + DARK)),
            self.normal,
            jnp.log(self.depth + 0.05),
            2 * self.ao - 1,
            jnp.minimum(self.error, 3),
            self.mask,
            jnp.log(noisy + 0.03),
        ]
        return jnp.concatenate(planes, axis=-1)

    def corrected(self, said: jax.Array) -> jax.Array:
        """The light by what the network says of it, `(H, W, 3)` both."""
        return self.light * factors(said)


def factors(said: jax.Array) -> jax.Array:
    """Those on the light, of what the network says of them."""
    return jnp.exp(LARGEST * jnp.tanh(said / LARGEST))


def luminance(light: jax.Array) -> jax.Array:
    """`(H, W, 3)` to `(H, W, 1)`."""
    return light @ jnp.asarray(LUMINANCE, light.dtype)[:, None]


def doubts(light: jax.Array, noisy: jax.Array, error: jax.Array) -> list[jax.Array]:
    """How much brighter the noisy light is than the denoised one, and how far that may be off.

    All `(H, W, 1)`.
    """
    bright = light + 0.05
    return [jnp.log1p((noisy + 0.05) / bright), jnp.log(error / bright + 0.01) + 1.5]


def of_means(read: Any, scales: int) -> list[jax.Array]:
    """What is left in the means: noisy over denoised light, and the noise.

    read: with `light` and `noisy`, `(H, W, 3)`. The noisy light also without what exceeds the
    denoised one four times.
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
