"""Host side of kernels_cl/solve.cl; its twin in JAX is jflnr/regression/solve.py."""

from typing import Any

from jflnr.opencl.context import Context
from jflnr.regression.flr import FLR
from jflnr.regression.solve import regularisation


def solve(
    context: Context, moments: Any, shift: Any, method: FLR, guides: int, channels: int
) -> Any:
    """`jflnr.regression.solve.solve` of `(K, h, pitch)`, to `(Q + 1, C, h, pitch)`.

    guides, channels: the numbers Q and C.
    """
    h, pitch = moments.shape[1:]
    width = context.width()
    model = context.empty((guides + 1, channels, h, pitch))
    eps, eps_prime = map(float, regularisation(method))
    defines = {"Q": guides, "C": channels, "WIDTH": width}
    arguments = h, pitch, eps, eps_prime, shift, moments, model
    context.run("solve", "solve.cl", defines, (pitch // width, h), arguments)
    return model
