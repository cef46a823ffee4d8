"""JAX, loaded when something of it is first used: the OpenCL back end starts without it."""

from __future__ import annotations

import functools
import importlib
import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import wrapt

if TYPE_CHECKING:
    import jax as jax
    import jax.numpy as jnp
    from jax import lax as lax
else:

    class _Lazy:
        def __init__(self, name: str) -> None:
            self.name = name

        def __getattr__(self, attribute: str) -> Any:
            if self.name != "jax":  # which has settings too
                check_not_forked("JAX")
            return getattr(importlib.import_module(self.name), attribute)

    jax, jnp, lax = _Lazy("jax"), _Lazy("jax.numpy"), _Lazy("jax.lax")

T = TypeVar("T", bound=type)


def pytree(dataclass: T) -> T:
    """A dataclass that JAX knows as a pytree as soon as JAX is there, whoever loads it."""
    wrapt.register_post_import_hook(
        lambda module: module.tree_util.register_dataclass(dataclass), "jax"
    )
    return dataclass


@functools.cache
def _first_user(what: str) -> int:
    """The process that used it first; a forked one inherits the answer."""
    return os.getpid()


def check_not_forked(what: str, error: type[ImportError] = ImportError) -> None:
    """Raise the error where a process was forked that had used what has threads of its own."""
    if _first_user(what) != os.getpid():
        raise error(
            f"{what} was used before this process was forked, and its threads do not live on here; "
            "start processes with multiprocessing's method 'spawn' or 'forkserver'"
        )


def jit(function: Callable[..., Any], **options: Any) -> Any:
    """`jax.jit` of a function, from its first call on; `compiled()` is what that made."""

    @functools.cache
    def compiled() -> Any:
        return jax.jit(function, **options)

    @functools.wraps(function)
    def run(*given: Any, **named: Any) -> Any:
        return compiled()(*given, **named)

    run.compiled = compiled  # type: ignore[attr-defined]
    return run
