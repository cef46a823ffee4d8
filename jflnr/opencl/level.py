"""One level of adaptive FLR: host side of kernels_cl/level.cl.

Its twin in JAX is jflnr/regression/level.py.
"""

from typing import Any, NamedTuple

from jflnr.opencl.grids import Grid, Run
from jflnr.opencl.resampling import halve_planes
from jflnr.regression.moments import plane_count
from jflnr.regression.solve import ROUNDING_OF_STRIPS as ROUNDING


class Level(NamedTuple):
    """One level and its fit.

    moments: K planes, weighted, and one of noise. features: the scaled mean guides of each block
    and, where there is a coarser level, a measure of the brightness found there, and that
    brightness itself. models: see kernels_cl/models.h. refines: 1 if there is a coarser level.
    tiles: where there is more than room for the models, from `merge.payoff`; everywhere if None.
    """

    moments: Grid
    features: Grid
    models: Grid
    refines: int
    tiles: Any | None = None


class Step(NamedTuple):
    """One level finer than what was known before; see `jflnr.regression.multiscale.Step`.

    fine, coarse: this level and the coarser one, each on its own grid. share: one plane on the
    coarser grid.
    """

    fine: Level
    coarse: Level
    share: Grid


def fit_level(
    run: Run,
    moments: Grid,
    side: int,
    found: Grid | None = None,
    *,
    slopes: bool = True,
    tiles: Any | None = None,
) -> Level:
    """Fit the models of one level.

    moments: K planes, and one of noise if they are weighted. side: of a block in pixels. found:
    models that the coarser levels found. slopes: whether the position in the window is two more
    guides. tiles: as of `Level`.
    """
    (h, w, pitch), numbers, refines = moments.sizes, run.numbers, int(found is not None)
    down, positions = run.context.on_cpu, int(slopes)
    noise = moments.number - plane_count(run.guides, run.channels)
    defines = {"NOISE": noise, "POSITIONS": positions, "ROUNDING": ROUNDING, "DOWN": int(down)}

    def launch(name: str, *arguments: Any, down: bool = False) -> None:
        run.launch(name, "level.cl", moments, (h, pitch, refines, *arguments), down, **defines)

    features = run.grid(max(run.guides + 2 * refines, 1), h, w)
    coarse, models = ((0, 0, 0), None) if found is None else (found.sizes, found.planes)
    launch(
        "features", *coarse, numbers.guide_scale, numbers.brightness_scale, tiles,
        run.mean, moments.planes, models, features.planes,
    )  # fmt: skip
    rows = run.grid(moments.number + positions * (run.guides + run.channels + 2), h, w)
    launch("window_rows", numbers.sigma, tiles, features.planes, moments.planes, rows.planes)
    fitted = new_models(run, h, w)
    launch(
        "fit", side, numbers.sigma, numbers.eps, numbers.eps_prime, numbers.noise_ridge,
        numbers.position_ridge, tiles, run.mean, run.shift, features.planes, rows.planes,
        fitted.planes, down=down,
    )  # fmt: skip
    return Level(moments, features, fitted, refines, tiles)


def new_models(run: Run, h: int, w: int) -> Grid:
    """Room for the planes of kernels_cl/models.h."""
    return run.grid((run.guides + 1) * (run.channels + 1) + 1, h, w)


def fit_pilot(run: Run, moments: Any, w: int, block: int) -> Grid:
    """Models of the brightness on blocks of 4 `block`, from the moments of pass 1.

    moments: `(K, h, pitch)`, of one channel, with w columns.
    """
    run = run._replace(channels=1)
    return fit_level(run, halve_planes(run, moments, w), 4 * block).models
