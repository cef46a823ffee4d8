"""The learned numbers of Fast Local Regression, and the small file that those of a method are kept
in."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jflnr import checks
from jflnr.flr.adaptive_parameters import AdaptiveParameters

FORMAT = "jflnr-parameters"
VERSION = 1


class Parameters(NamedTuple):
    """Window width and regularisation of FLR, kept as logarithms.

    An optimiser may move the three scalars anywhere: every real value is a valid model.

    log_sigma: log of the Gaussian window's standard deviation, in pixels of the output.
    log_eps: log of the multiplicative regularisation (Appendix, Eq. 18).
    log_eps_prime: log of the additive regularisation (Appendix, Eq. 18 and 22).
    """

    log_sigma: jax.Array | float
    log_eps: jax.Array | float
    log_eps_prime: jax.Array | float

    @classmethod
    def of(cls, sigma: float, eps: float, eps_prime: float) -> Parameters:
        """Parameters from the numbers themselves; `ValueError` unless all are positive."""
        values = {"sigma": sigma, "eps": eps, "eps_prime": eps_prime}
        for name, value in values.items():
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name} is {value}; it must be a positive number")
        return cls(*(math.log(value) for value in values.values()))

    @property
    def sigma(self) -> jax.Array:
        return jnp.exp(self.log_sigma)

    @property
    def eps(self) -> jax.Array:
        return jnp.exp(self.log_eps)

    @property
    def eps_prime(self) -> jax.Array:
        return jnp.exp(self.log_eps_prime)


# Fitted on the training frames at 1 spp: `jflnr fit`, see docs/method.md.
DEFAULT = Parameters.of(sigma=15.0, eps=1.3e-5, eps_prime=6.5e-3)


# What a file is of, and the numbers that it must hold.
NUMBERS = {"flr": ("sigma", "eps", "eps_prime"), "flr-adaptive": AdaptiveParameters._fields}


def save_parameters(
    path: str | Path, parameters: Parameters | AdaptiveParameters, **about: Any
) -> None:
    """Write the parameters as JSON, with anything else worth knowing about the fit."""
    from jflnr.files import write_atomically

    text = {
        "format": FORMAT,
        "version": VERSION,
        "method": method_of(parameters),
        **numbers_of(parameters),
        **about,
    }
    write_atomically(path, (json.dumps(text, indent=2) + "\n").encode())


def method_of(parameters: Parameters | AdaptiveParameters) -> str:
    """The method whose parameters these are."""
    return "flr" if isinstance(parameters, Parameters) else "flr-adaptive"


def numbers_of(parameters: Parameters | AdaptiveParameters) -> dict[str, float]:
    """The numbers by name, not their logarithms."""
    known = parameters if isinstance(parameters, Parameters) else parameters.numbers()
    return {name: float(getattr(known, name)) for name in NUMBERS[method_of(parameters)]}


def load_parameters(path: str | Path) -> tuple[Parameters | AdaptiveParameters, dict[str, Any]]:
    """Parameters and the rest of the file; `ValueError` if it is not such a file."""
    wanted = f"a JSON file that `jflnr fit` wrote (format {FORMAT!r}, version {VERSION})"
    try:
        text = json.loads(Path(path).read_bytes())
    except FileNotFoundError:
        raise ValueError(f"{path}: there is no such file; --params wants {wanted}") from None
    except (OSError, ValueError, RecursionError) as error:
        raise ValueError(f"{path}: cannot be read ({error}); it should be {wanted}") from None
    if not isinstance(text, dict) or text.get("format") != FORMAT or text.get("version") != VERSION:
        raise ValueError(f"{path}: not a parameter file; it should be {wanted}")
    method = text.get("method", "flr")
    if method not in list(NUMBERS):
        raise ValueError(f"{path}: its method is {method!r}; it should be {' or '.join(NUMBERS)}")
    values: dict[str, Any] = {name: text.get(name) for name in NUMBERS[method]}
    if not all(type(value) in (int, float) for value in values.values()):
        raise ValueError(
            f"{path}: {', '.join(NUMBERS[method])} must all be there as numbers; "
            f"it should be {wanted}"
        )
    kind = Parameters if method == "flr" else AdaptiveParameters
    try:
        _check_use(text)
        return kind.of(**values), text
    except (ValueError, TypeError, OverflowError) as error:
        raise ValueError(f"{path}: {error}") from None


def _check_use(about: dict[str, Any]) -> None:
    """Raise unless the guides and the block that a file names, if it does, are such."""
    from jflnr.guides import NAMES

    guides = about.get("guides", [])
    if not isinstance(guides, list) or not all(guide in NAMES for guide in guides):
        raise ValueError(f"guides must be a list of names out of {', '.join(NAMES)}; got {guides}")
    checks.positive_integer("block", about.get("block", 1))
