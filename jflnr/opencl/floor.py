"""Host side of kernels_cl/floor.cl; its twin in JAX is jflnr/regression/floor.py."""

from jflnr.opencl.grids import Grid, Run


def own_light(run: Run, merged: Grid, moments: Grid) -> Grid:
    """The light that each model gives at its block's mean guides: C planes.

    merged: models. moments: of the same blocks.
    """
    h, w, pitch = merged.sizes
    own = run.grid(run.channels, h, w)
    arguments = h, pitch, moments.planes, merged.planes, own.planes
    run.launch("own_light", "floor.cl", merged, arguments)
    return own
