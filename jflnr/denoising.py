"""From a frame to denoised light: the one call most people need."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import importlib
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jflnr import checks
from jflnr.frame import Array, Frame
from jflnr.images.inputs import prepare
from jflnr.lazy import check_not_forked, jax
from jflnr.methods import AUTO, BACKENDS, DEFAULT, default_of, method_of
from jflnr.regression.arguments import block_for
from jflnr.stages import Parts, on_frame

if TYPE_CHECKING:
    from jflnr.large.source import Rows

SHIPPED_FRAME = Path(__file__).parent / "data" / "room.exr"


@contextlib.contextmanager
def _own_settings(backend: str) -> Iterator[None]:
    """Float32, and the promotions that the code was written for, whatever JAX is told.

    NumPy, which prepares images for the devices, is as silent as JAX about what is not finite.
    """
    with checks.one_sentence(), np.errstate(all="ignore"), contextlib.ExitStack() as settings:
        if backend == "jax":
            check_not_forked("JAX")
        if "jax" in sys.modules or backend == "jax":
            settings.enter_context(jax.numpy_rank_promotion("allow"))
            settings.enter_context(jax.numpy_dtype_promotion("standard"))
            settings.enter_context(jax.enable_x64(False))
        yield


def _native(frame: Frame) -> Frame:
    """The frame with layers `(H, W, C)`, numpy's in float32 or half, in this machine's byte order.

    Raises `TypeError` if it is no frame.
    """
    if not isinstance(frame, Frame):
        raise TypeError(
            "denoise takes a frame, jflnr.Frame(indirect=light, normal=normal, depth=depth), or "
            f"what jflnr.read_frame returns; got {type(frame).__name__}"
        )

    def native(layer: Array) -> Array:
        layer = layer[..., None] if getattr(layer, "ndim", 3) == 2 else layer
        if not isinstance(layer, np.ndarray) or layer.dtype.kind != "f":
            return layer
        return layer.astype(np.float16 if layer.dtype.itemsize == 2 else np.float32, copy=False)

    return frame.map(native)


def denoise(
    frame: Frame,
    method: Any = None,
    *,
    backend: str = "jax",
    guides: Sequence[str] | None = None,
    tile: int | None = None,
    **options: Any,
) -> Any:
    """Denoise the indirect light of a frame, or the whole picture of another program.

    frame: as from `read_frame`. Its `indirect` may have any number of channels C: several light
    groups side by side are denoised together, and their results sum to the denoised sum. For `flr`,
    `flr-adaptive` and `auto` it may also be smaller than the other layers by a whole factor; the
    result then has their size.
    method: an object such as `FLR(sigma=12)`, or a name: `picture`, the whole picture
    (docs/layouts.md), `flr` (section 3.2 of the paper), `flr-adaptive` (docs/adaptive.md), `flnr`,
    the same corrected by a network, `flnr-small`, by a smaller one (docs/flnr.md), `bmfr`, as in
    the first frame of a sequence (docs/bmfr.md), or `auto`, `flr-adaptive` in less time, refined
    only where it pays (docs/select.md). If None, `picture` where the frame has a `beauty` and no
    guides are named, else `flr`. options: fields of the method to replace, such as `block=4`, the
    pixels on a side that share one model, or `keep_energy=True`, to keep the mean radiance exactly.
    guides: names out of normal, depth, ao, position, albedo; by default normal, depth and, where
    the frame has it, ao.
    backend: `jax`, `opencl`, or `auto`: OpenCL where there is a device and it can do what is asked
    for, else JAX. `jax.jit` and gradients need `jax`.
    tile: work on about `tile` x `tile` pixels at a time, with the same result in less memory
    (docs/large.md); on all of them if None.
    Pixels outside `frame.mask`, and any with a NaN or infinity, are left out of the fit.
    Returns `(H, W, C)` float32, demodulated indirect radiance, of `picture` the picture itself, RGB
    or, where the frame has an `alpha`, RGBA; with the option `with_error=True` of `flr-adaptive`,
    `flnr` and `picture` also its standard error, `(H, W, 1)`: nine pixels of ten are within 1.645
    of the truth. They are arrays of numpy if the frame's are, else of JAX.

    Raises `ValueError` or `TypeError` naming the argument, also if no pixel can be used. Warns if
    the frame has no ambient occlusion.
    """
    return Denoiser(method, backend=backend, guides=guides, tile=tile, **options)(frame)


def backend_for(backend: str, method: Any, tile: int | None = None) -> str:
    """What runs a method: `backend`, or, if that is `auto`, OpenCL where it can, else JAX.

    It can where there is a device, kernels of the method (all of ours have some) and no tiles.
    """
    checks.choice("backend", backend, (*BACKENDS, AUTO))
    if backend != AUTO:
        return backend
    if tile is not None or "opencl" not in getattr(method, "backends", BACKENDS):
        return "jax"
    from jflnr.opencl.devices import NoDevice, all_devices

    try:
        all_devices()
    except NoDevice:
        return "jax"
    return "opencl"


class Denoiser:
    """A method made ready once, called frame by frame.

    Arguments as of `denoise`. device: of the opencl backend, as `jflnr doctor` numbers or names
    it, or a `jflnr.opencl.Context`; the best one if None. Called with a frame it returns what
    `denoise` does; `next` takes the frames of a shot in their order. `backend` is what runs it.
    """

    def __init__(
        self,
        method: Any = None,
        *,
        backend: str = "jax",
        guides: Sequence[str] | None = None,
        tile: int | None = None,
        device: Any = None,
        **options: Any,
    ) -> None:
        if tile is not None:
            checks.positive_integer("tile", tile)
        method = None if method is None else method_of(method, **options)
        self.backend = backend_for(backend, method, tile)
        self.guides, self.options = guides, options
        self.tile, self.state, self._device = tile, None, device
        self.method = None if method is None else self._checked(method)

    def _checked(self, method: Any) -> Any:
        """The method, if it can do what is asked for."""
        if self.backend not in getattr(method, "backends", BACKENDS):
            raise ValueError(f"method {method.name} runs on the jax backend only")
        if self.guides is not None and (own := getattr(method, "features", None)):
            raise ValueError(
                f"method {method.name} has its own features, {', '.join(own)}; guides are for "
                "other methods"
            )
        if self.tile is not None and not hasattr(method, "stages"):
            raise ValueError(f"method {method.name} does not work in tiles")
        return method

    def method_for(self, frame: Frame) -> Any:
        """The method that denoises a frame."""
        method = self.method
        if method is None:
            name = default_of(frame) if self.guides is None else DEFAULT
            method = self._checked(method_of(name, **self.options))
        if not hasattr(method, "block"):
            return method
        block = block_for(method.block, max(np.shape(frame.normal)[:2], default=1))
        return method if block == method.block else dataclasses.replace(method, block=block)

    def __call__(self, frame: Frame, out: np.ndarray | None = None) -> Any:
        """Denoise a frame by itself; its light is written to `out`, if given, and returned."""
        with _own_settings(self.backend):
            frame = _native(frame)
            return _given(self._alone(frame, out), frame, out)

    def _alone(self, frame: Frame, out: np.ndarray | None) -> Parts:
        method = self.method_for(frame)
        names, inputs = prepare(frame, self.guides, method)
        method = method.for_frame(inputs, names)
        if hasattr(method, "step"):
            return {"image": self._step(self.start(frame), frame)[1]}
        if self.tile is not None:
            from jflnr.large.source import rows_of

            found = [parts for _, parts in self.strips(rows_of(inputs), names, self.tile)]
            return {name: np.concatenate([parts[name] for parts in found]) for name in found[0]}
        if self.backend == "jax":
            return on_frame(method, inputs, names)
        from jflnr.opencl import twins

        images = method.images(inputs, names, filters=twins.filters_on(self.context))
        return twins.regress(method, images, self.context, out=out)

    def next(self, frame: Frame, out: np.ndarray | None = None) -> Any:
        """Denoise the next frame of a shot, with what those before it left (docs/temporal.md).

        frame: with `motion`. `state` is what is left to the next one; None begins another shot.
        """
        with _own_settings(self.backend):
            frame = _native(frame)
            state = self.start(frame) if self.state is None else self.state
            self.state, light = self._step(state, frame)
            return _given({"image": light}, frame, out)

    @functools.cached_property
    def context(self) -> Any:
        """The device of the opencl backend."""
        from jflnr.opencl.context import Context, default_context

        if isinstance(self._device, Context):
            return self._device
        return default_context() if self._device is None else Context(self._device)

    def strips(
        self, rows: Rows, names: tuple[str, ...], tile: int, folder: Path | None = None
    ) -> Iterator[tuple[int, Parts]]:
        """A frame that is read by rows in denoised strips, from top to bottom (docs/large.md).

        rows: `jflnr.large.source.rows_of` a frame, or of a file. names: of the guides. tile: as of
        `denoise`. folder: for temporary files; the system's own if None.
        Yields the first row of each strip, and by name `image`, `(h, W, C)`, and more.
        """
        from jflnr.large import tiled

        with _own_settings(self.backend):
            shapes = rows.shapes()
            method = self.method_for(shapes).for_frame(shapes, names)
        if self.backend == "jax":
            parts = tiled.strips(rows, method, names, tile, folder)
        else:
            from jflnr.opencl import twins

            whole = lambda images: twins.regress(method, images, self.context)
            parts = tiled.overlapping(rows, method, names, tile, whole)
        while True:
            with _own_settings(self.backend):  # which are the caller's own in between
                found = next(parts, None)
            if found is None:
                return
            yield found

    def start(self, frame: Frame) -> Any:
        """The state before the first frame of a shot, of which only the shapes count."""
        return self._over_time(frame)[0](frame)

    def _step(self, state: Any, frame: Frame) -> tuple[Any, Any]:
        return self._over_time(frame)[1](state, frame)

    def _over_time(self, frame: Frame) -> tuple[Callable[..., Any], Callable[..., Any]]:
        """`start` and `step`, the method's own if it has them."""
        method, partial = self.method_for(frame), functools.partial
        options = {"context": self.context} if self.backend == "opencl" else {}
        if not hasattr(method, "step"):
            home = importlib.import_module("jflnr.opencl.temporal" if options else "jflnr.temporal")
            options |= {"method": method, "guides": self.guides}
            return partial(home.start, **options), partial(home.step, **options)
        if not options:
            return method.start, method.step
        home = importlib.import_module(f"jflnr.opencl.{method.name}")
        return partial(home.start, **options), partial(home.step, method=method, **options)


def _given(parts: Parts, frame: Frame, out: np.ndarray | None) -> Array | tuple[Array, ...]:
    """What the caller gets, as arrays of the frame's kind."""
    arrays = [parts["image"], *(array for name, array in parts.items() if name != "image")]
    kind = np if isinstance(frame.indirect, np.ndarray) else jax.numpy
    arrays = [kind.asarray(array) for array in arrays]
    if out is not None:
        if arrays[0] is not out:
            np.copyto(out, arrays[0], casting="same_kind")
        arrays[0] = out
    return arrays[0] if len(arrays) == 1 else tuple(arrays)
