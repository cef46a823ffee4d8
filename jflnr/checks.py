"""Argument checks shared by the package: one clear sentence, naming the argument and its value.

They look at static facts only (shapes, types, plain numbers), so they also run while JAX traces.
"""

import contextlib
import sys
from collections.abc import Collection, Iterator
from typing import Any


@contextlib.contextmanager
def one_sentence() -> Iterator[None]:
    """Around a function or some lines: what JAX and OpenCL say in paragraphs, in one sentence.

    Raises `TypeError` for what JAX traces and nothing can trace, `MemoryError` and `OSError` for
    what a device has no room for or fails in.
    """
    try:
        yield
    except Exception as error:
        jax, cl = sys.modules.get("jax"), sys.modules.get("pyopencl")
        first = next(iter(str(error).splitlines()), "")
        if jax and isinstance(error, jax.errors.JAXTypeError):
            raise TypeError(
                "jax.jit, jax.vmap and jax.grad go through methods on the jax backend only, "
                "without tile"
            ) from None
        if jax and isinstance(error, jax.errors.JaxRuntimeError) and "EXHAUSTED" in first:
            raise MemoryError(f"the device has too little memory: {first}") from None
        if cl and isinstance(error, cl.Error):
            raise OSError(f"the OpenCL device failed: {first}") from error
        raise


def choice(name: str, value: object, options: Collection[object]) -> None:
    """Raise ValueError unless `value` is one of `options`."""
    if value not in options:
        listed = ", ".join(str(option) for option in options)
        raise ValueError(f"{name} must be one of {listed}; got {value!r}")


def positive_integer(name: str, value: object) -> None:
    """Raise TypeError unless `value` is a whole number, ValueError unless it is at least 1."""
    if isinstance(value, bool) or not hasattr(value, "__index__"):
        raise TypeError(f"{name} must be a whole number; got {value!r}")
    if value.__index__() < 1:
        raise ValueError(f"{name} must be at least 1; got {value!r}")


def image(name: str, array: Any, channels: int | None = None) -> None:
    """Raise ValueError unless `array` is (H, W, C) with H, W >= 1 and, if given, C = `channels`."""
    shape = getattr(array, "shape", None)
    if shape is None or len(shape) != 3:
        found = f"shape {shape}" if shape is not None else type(array).__name__
        raise ValueError(f"{name} must be an array of shape (H, W, C); got {found}")
    if 0 in shape[:2]:
        raise ValueError(f"{name} has zero size: its shape is {shape}")
    if channels is not None and shape[2] != channels:
        raise ValueError(f"{name} must have {channels} channels; its shape is {shape}")


def same_size(**images: Any) -> None:
    """Raise ValueError unless all (H, W, C) arrays that are not None share H and W."""
    sizes = {name: array.shape[:2] for name, array in images.items() if array is not None}
    if len(set(sizes.values())) > 1:
        listed = ", ".join(f"{name} is {w} x {h}" for name, (h, w) in sizes.items())
        raise ValueError(f"Images must be of one size (width x height): {listed}")


def times_finer(fine: tuple[int, ...], coarse: tuple[int, ...]) -> int | None:
    """The smallest f with `coarse = ceil(fine / f)` in both directions; None if there is none."""
    factor = max(-(-f // c) for f, c in zip(fine, coarse, strict=True))
    return factor if tuple(-(-size // factor) for size in fine) == coarse else None
