"""One level of adaptive FLR: host side of kernels_cl/features.cl, window.cl and level.cl.

Its twin in JAX is jflnr/regression/level.py.
"""

from typing import NamedTuple

from jflnr.opencl.grids import Grid, Run
from jflnr.regression.moments import plane_count
from jflnr.regression.solve import ROUNDING_OF_STRIPS as ROUNDING


class Level(NamedTuple):
    """One level and its fit.

    moments: K planes, weighted, and one of noise. features: the scaled mean guides of each block
    and, where there is a coarser level, a measure of the brightness found there, and that
    brightness itself. models: see kernels_cl/models.h. defines: those of kernels_cl/window.h.
    """

    moments: Grid
    features: Grid
    models: Grid
    defines: dict[str, int]


def fit_level(
    run: Run, moments: Grid, side: int, found: Grid | None = None, *, slopes: bool = True
) -> Level:
    """Fit the models of one level.

    moments: K planes, and one of noise if they are weighted. side: of a block in pixels. found:
    models that the coarser levels found. slopes: whether the position in the window is two more
    guides.
    """
    features = _features(run, moments, found)
    # That brightness is not compared inside a window.
    compared = run.guides + (found is not None)
    window = {"FEATURES": compared, "FEATURE_PLANES": features.number}
    noise = moments.number - plane_count(run.guides, run.channels)
    options = {**window, "POSITIONS": int(slopes), "NOISE": noise}
    rows = _window_rows(run, moments, features, options)
    return Level(moments, features, _fit(run, rows, side, features, options), window)


def _features(run: Run, moments: Grid, found: Grid | None) -> Grid:
    h, w, pitch = moments.sizes
    count = run.guides if found is None else run.guides + 2
    features = run.grid(max(count, 1), h, w)
    coarse, models = ((0, 0, 0), None) if found is None else (found.sizes, found.planes)
    arguments = (
        h, pitch, *coarse, run.numbers.guide_scale, run.numbers.brightness_scale, run.mean,
        moments.planes, models, features.planes,
    )  # fmt: skip
    defines = {"REFINES": int(found is not None), "COUNT": moments.number}
    run.launch("features", "features.cl", moments, arguments, **defines)
    return features


def _window_rows(run: Run, moments: Grid, features: Grid, options: dict[str, int]) -> Grid:
    """The window along rows: the planes of kernels_cl/rows.h."""
    h, w, pitch = moments.sizes
    count = moments.number + options["POSITIONS"] * (run.guides + run.channels + 2)
    rows = run.grid(count, h, w)
    arguments = (h, pitch, run.numbers.sigma, features.planes, moments.planes, rows.planes)
    run.launch("window_rows", "window.cl", moments, arguments, **options)
    return rows


def _fit(run: Run, rows: Grid, side: int, features: Grid, options: dict[str, int]) -> Grid:
    """The window along columns, and least squares."""
    h, w, pitch = rows.sizes
    models = new_models(run, h, w)
    numbers = run.numbers
    arguments = (
        h, pitch, side, numbers.sigma, numbers.eps, numbers.eps_prime, numbers.noise_ridge,
        numbers.position_ridge, run.mean, run.shift, features.planes, rows.planes, models.planes,
    )  # fmt: skip
    options = {**options, "ROUNDING": ROUNDING, "DOWN": int(run.context.on_cpu)}
    run.launch("fit", "level.cl", rows, arguments, **options)
    return models


def new_models(run: Run, h: int, w: int) -> Grid:
    """Room for the planes of kernels_cl/models.h."""
    return run.grid((run.guides + 1) * (run.channels + 1) + 1, h, w)
