"""The four steps of FLR on the shipped frame, as pictures: the figure of docs/method.md."""

from __future__ import annotations

from pathlib import Path

import jax.numpy as jnp
import numpy as np

import jflnr
from experiments import data, plots
from jflnr.images import guides
from jflnr.metrics import display, exposure
from jflnr.regression.apply import apply
from jflnr.regression.blur import blur
from jflnr.regression.flr import DEFAULT
from jflnr.regression.moments import centre, collect, index_xy
from jflnr.regression.solve import solve

BLOCK, SUPPORT = DEFAULT.block, 72


def arrays() -> dict[str, np.ndarray]:
    """The input and what each step gives, with the axes of `jflnr.flr`."""
    frame = jflnr.read_frame(data.SHIPPED)
    scene = guides.scene_of(frame)
    x = jnp.concatenate(guides.layers(frame, guides.choose(frame, None), scene), axis=-1)
    light = jnp.asarray(frame.indirect)
    weight = None if frame.mask is None else jnp.asarray(frame.mask)[..., 0]
    shift = centre(x, weight)
    moments = collect(light, x, shift, BLOCK, weight)
    blurred = blur(moments, DEFAULT.sigma / BLOCK, reach=-(-SUPPORT // BLOCK))
    model = solve(blurred, shift, DEFAULT, 3)
    output = apply(model, x, shift, BLOCK)
    steps = (light, x, moments, blurred, model, output)
    names = ("light", "guides", "moments", "blur", "solve", "apply")
    return {name: np.asarray(step) for name, step in zip(names, steps, strict=True)}


def draw(folder: Path) -> None:
    """steps.png: input, guides, and one picture per step."""
    found = arrays()
    first = index_xy(0, 0, found["guides"].shape[-1], 3)
    scale = exposure(found["apply"])
    slope = found["solve"][5].mean(axis=0)
    limit = float(np.quantile(np.abs(slope), 0.98))
    pictures = {
        "light: one sample per pixel": display(found["light"], scale),
        "guides: normal (depth, ao)": 0.5 + 0.5 * found["guides"][..., :3],
        "moments: 3 of 39 planes, the mean light": _mean_light(found["moments"], first, scale),
        "blur: the same under the window": _mean_light(found["blur"], first, scale),
        f"solve: slope on ao, -{limit:.2g} to {limit:.2g}": slope / limit,
        "apply: the models at every pixel": display(found["apply"], scale),
    }
    with plots.figure(folder / "steps.png", columns=3, rows=2, size=(3.3, 2.1)) as axes:
        for axis, (title, picture) in zip(axes, pictures.items(), strict=True):
            axis.imshow(np.clip(picture, -1, 1), cmap="RdBu_r", vmin=-1, vmax=1)
            axis.set_title(title, fontsize=9)
            axis.set_axis_off()


def _mean_light(moments: np.ndarray, first: int, scale: float) -> np.ndarray:
    """Mean of Y per block, displayed: its product with 1 over that of 1 with itself."""
    mean = moments[first : first + 3] / np.maximum(moments[0], 1e-12)
    return display(mean.transpose(1, 2, 0), scale)
