"""Host side of kernels_cl/solve.cl; its twin in JAX is jflnr/regression/solve.py."""

from typing import Any

from jflnr.opencl.context import Context
from jflnr.regression.flr import FLR
from jflnr.regression.solve import regularisation


def solve(
    context: Context, moments: Any, shift: Any, method: FLR, guides: int, channels: int
) -> Any:
    """Coefficients of the local affine models, one per block (Appendix, Eq. 12-23).

    moments: `(K, h, pitch)`, blurred. shift: `(max(Q, 1),)`. guides, channels: the numbers Q, C.
    Returns `(Q + 1, C, h, pitch)`: the value of Y at X = shift, then the slope of each guide.
    """
    h, pitch = moments.shape[1:]
    width = context.width()
    model = context.empty((guides + 1, channels, h, pitch))
    eps, eps_prime = map(float, regularisation(method))
    context.run(
        "solve",
        "solve.cl",
        {"Q": guides, "C": channels, "WIDTH": width},
        (pitch // width, h),
        (h, pitch, eps, eps_prime, shift, moments, model),
    )
    return model
