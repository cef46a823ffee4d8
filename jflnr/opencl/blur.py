"""Host side of kernels_cl/blur.cl; its twin in JAX is jflnr/regression/blur.py."""

from typing import Any

import numpy as np

from jflnr.opencl.context import Context


def gaussian_taps(sigma: float, reach: int) -> np.ndarray:
    """Gaussian weights at -reach..reach with sum 1, `(2 reach + 1,)` float32."""
    offsets = np.arange(-reach, reach + 1)
    # The bound keeps a width of zero the identity instead of 0/0.
    taps = np.exp(-0.5 * (offsets / max(sigma, 1e-2)) ** 2)
    return (taps / taps.sum()).astype(np.float32)


def blur(context: Context, moments: Any, sigma: float, reach: int) -> Any:
    """`jflnr.regression.blur.blur` of `(K, h, pitch)`; the result's padding is not zero."""
    planes, h, pitch = moments.shape
    width = context.width()
    margin = -(-reach // width) * width
    taps = context.array(gaussian_taps(sigma, reach))
    columns, blurred = context.empty((planes, h, pitch + 2 * margin)), context.empty(moments.shape)
    sizes = (planes, h, pitch, margin, reach, taps)
    defines = {"WIDTH": width}
    wide = (pitch + 2 * margin) // width
    context.run("blur_columns", "blur.cl", defines, (wide, h, planes), (*sizes, moments, columns))
    context.run(
        "blur_rows", "blur.cl", defines, (pitch // width, h, planes), (*sizes, columns, blurred)
    )
    return blurred
