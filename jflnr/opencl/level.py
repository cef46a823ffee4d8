"""Host side of kernels_cl/features.cl, window.cl and level.cl; its twin in JAX is jflnr/flr/level.py."""

from __future__ import annotations

from typing import Any, NamedTuple

from jflnr.flr.moments import plane_count
from jflnr.opencl.grids import Grid, Run, pitch_of


class Models(NamedTuple):
    """Models of one grid.

    coefficients: `(Q + 1, C, h, pitch)`. light: `(Q + 1, h, pitch)`, the same for the brightness;
    in a fit one more plane, the variance of what they predict. w: number of blocks across.
    """

    coefficients: Any
    light: Any
    w: int

    @property
    def sizes(self) -> tuple[int, int, int]:
        """As the kernels take them: h, w, pitch."""
        h, pitch = self.light.shape[1:]
        return h, self.w, pitch


class Fit(NamedTuple):
    """The models of one level, and the features of the window that they were fitted under.

    features: `(F, h, stride)`: the scaled mean guides of each block and, on all but the coarsest
    grid, a measure of the brightness that the coarser grids found, and that brightness itself.
    similar: how many of them must be alike in a window.
    """

    models: Models
    features: Any
    similar: int


def fit_level(run: Run, grid: Grid, found: Models | None = None, positions: bool = True) -> Fit:
    """Fit the models of one level.

    found: what the coarser grids found, None on the coarsest. positions: whether the models may
    have a slope across the window.
    """
    noise = grid.moments.shape[0] - plane_count(run.guides, run.channels)
    features = window_features(run, grid, found)
    similar = run.guides + (found is not None)
    options = {"FEATURES": similar, "NOISE": noise, "POSITIONS": int(positions)}
    rows = _window_rows(run, grid, features, options)
    return Fit(_fit(run, grid, features, rows, options), features, similar)


def window_features(run: Run, grid: Grid, found: Models | None) -> Any:
    """What must be alike inside one window, `(F, h, stride)`; see `Fit`."""
    count = run.guides if found is None else run.guides + 2
    h, stride = grid.moments.shape[1:]
    features = run.context.empty((max(count, 1), h, stride))
    scales = run.numbers.guide_scale, run.numbers.brightness_scale
    coarse = (0, 0, 0, None) if found is None else (*found.sizes, found.light)
    arguments = (
        h, grid.w, pitch_of(grid.w), *coarse[:3], *scales, run.mean, grid.moments, coarse[3], features
    )  # fmt: skip
    run.launch("features", "features.cl", (stride, h), arguments, REFINES=int(found is not None))
    return features


def _window_rows(run: Run, grid: Grid, features: Any, options: dict[str, int]) -> Any:
    """The window along rows, in the layout of kernels_cl/rows.h."""
    pitch = pitch_of(grid.w)
    count = grid.moments.shape[0] + options["POSITIONS"] * (run.guides + run.channels + 2)
    rows = run.context.empty((grid.h, pitch, count))
    arguments = (grid.h, pitch, run.numbers.sigma, features, grid.moments, rows)
    run.launch("window_rows", "window.cl", (pitch, grid.h), arguments, **options)
    return rows


def _fit(run: Run, grid: Grid, features: Any, rows: Any, options: dict[str, int]) -> Models:
    """The window along columns, and least squares."""
    h, pitch, numbers = grid.h, pitch_of(grid.w), run.numbers
    coefficients = run.context.empty((run.guides + 1, run.channels, h, pitch))
    light = run.context.empty((run.guides + 2, h, pitch))
    arguments = (
        h, pitch, grid.block, numbers.sigma, numbers.eps, numbers.eps_prime, numbers.noise_ridge,
        numbers.position_ridge, run.mean, run.shift, features, rows, coefficients, light,
    )  # fmt: skip
    run.launch("fit", "level.cl", (pitch, h), arguments, **options)
    return Models(coefficients, light, grid.w)
