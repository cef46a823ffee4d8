"""Fast Local Regression: moments, blur, solve, apply (section 3.2)."""

from __future__ import annotations

import jax

from jflnr import checks
from jflnr.flr.apply import apply
from jflnr.flr.arguments import check_regression
from jflnr.flr.blur import blur
from jflnr.flr.elimination import SOLVERS, Solver
from jflnr.flr.moments import Guides, centre, collect
from jflnr.flr.parameters import Parameters
from jflnr.flr.solve import solve


def flr(
    target: jax.Array,
    guides: Guides,
    parameters: Parameters,
    *,
    block: int = 8,
    support: int = 72,
    guides_map: Guides | None = None,
    weight: jax.Array | None = None,
    shift: jax.Array | None = None,
    solver: Solver = "cholesky",
) -> jax.Array:
    """Fit the guides to a noisy image by windowed least squares and evaluate the fit.

    Linear in `target`: images denoised together as more channels sum to the denoised sum, and
    share the factorisation. With no guides (Q = 0) this is a Gaussian blur.

    target: `(H, W, C)`, the noisy radiance Y. guides: `(H, W, Q)`, X without the constant,
    or several such arrays that make up the Q channels together.
    parameters: window and regularisation. block: side of the squares of pixels that share one
    model; 1 is the exact per-pixel model. support: how far the window reaches, in pixels of the
    output; at least three sigma. guides_map: `(f H, f W, Q)` with an integer f >= 1, the guides
    the model is evaluated on (X_map of section 3.3; with f > 1 the joint upsampling of section
    3.2.1, where up to f - 1 rows and columns may be missing); None evaluates on `guides`.
    weight: `(H, W)`, how much each pixel counts in the fit; 0 removes it, as does any value that
    is not finite. shift: `(Q,)`, from `centre` of the image that this one is a part of.
    Returns `(H, W, C)`, or `(f H, f W, C)`.

    Raises `ValueError` or `TypeError`, naming the argument, if shapes, types or options are wrong.
    """
    checks.choice("solver", solver, SOLVERS)
    factor = check_regression(target, guides, guides_map, weight, block, support)
    shift = centre(guides, weight) if shift is None else shift
    moments = collect(target, guides, shift, block, weight)
    step = block * factor
    moments = blur(moments, parameters.sigma / step, reach=-(-support // step))
    coefficients = solve(moments, shift, parameters, target.shape[-1], solver)
    return apply(coefficients, guides if guides_map is None else guides_map, shift, step)
