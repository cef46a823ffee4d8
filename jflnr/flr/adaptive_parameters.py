"""The fitted constants of adaptive FLR."""

from __future__ import annotations

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp


class AdaptiveParameters(NamedTuple):
    """The constants of adaptive FLR, kept as logarithms: every real value is a valid model.

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
    """

    sigma: jax.Array | float
    eps: jax.Array | float
    eps_prime: jax.Array | float
    noise_ridge: jax.Array | float
    position_ridge: jax.Array | float
    exponent: jax.Array | float
    offset: jax.Array | float
    guide_scale: jax.Array | float
    brightness_scale: jax.Array | float
    caution: jax.Array | float
    slack: jax.Array | float
    floor: jax.Array | float

    def but(self, **numbers: float) -> AdaptiveParameters:
        """These, with some of the numbers (not their logarithms) replaced."""
        for name, value in numbers.items():
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name} is {value}; it must be a positive number")
        return self._replace(**{name: math.log(value) for name, value in numbers.items()})

    def numbers(self) -> AdaptiveParameters:
        """The numbers themselves instead of their logarithms."""
        return jax.tree.map(jnp.exp, self)

    @classmethod
    def of(cls, **numbers: float) -> AdaptiveParameters:
        """From all the numbers; `ValueError` unless they are positive."""
        return cls(*([0.0] * len(cls._fields))).but(**numbers)


ADAPTIVE_DEFAULT = AdaptiveParameters.of(
    sigma=2.0,
    eps=1e-4,
    eps_prime=1e-4,
    noise_ridge=0.07,
    position_ridge=0.2,
    exponent=1.0,
    offset=0.2,
    guide_scale=2.0,
    brightness_scale=2.0,
    caution=1.0,
    slack=0.025,
    floor=0.2,
)
