"""Fast Local Regression: moments, blur, solve, apply (section 3.2)."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from typing import Any, ClassVar

from jflnr.frame import Frame
from jflnr.images.inputs import factor_of, plain_images
from jflnr.lazy import jax, jnp, pytree
from jflnr.regression.apply import apply, guides_to_map
from jflnr.regression.arguments import block_for, check_options, check_regression
from jflnr.regression.blur import blur
from jflnr.regression.elimination import Solver
from jflnr.regression.moments import Guides, centre, channels_of, collect
from jflnr.regression.solve import solve
from jflnr.stages import Known, Parts, Stage, regress

# Pixels that the reach of the window is a multiple of, so that few programs are compiled.
STEP = 24


@pytree
@dataclass(frozen=True)
class FLR:
    """The method of section 3.2. The numbers were fitted on training frames at 1 spp
    (`jflnr fit`, docs/method.md).

    sigma: standard deviation of the Gaussian window, pixels of the output. eps, eps_prime:
    multiplicative and additive regularisation (Appendix, Eq. 18 and 22). block: side of the squares
    of pixels that share one model; 1 is the exact per-pixel model. support: how far the window
    reaches, pixels of the output; three standard deviations if None. solver: of the equations.
    factor: how many times larger the guides are than the light, from the frame.

    Raises `ValueError` for a number that is not positive.
    """

    name: ClassVar[str] = "flr"
    images: ClassVar[Any] = staticmethod(plain_images)
    margin: ClassVar[int] = 0

    sigma: jax.Array | float = 15.0
    eps: jax.Array | float = 1.3e-5
    eps_prime: jax.Array | float = 6.5e-3
    block: int = field(default=8, metadata={"static": True})
    support: int | None = field(default=None, metadata={"static": True})
    solver: Solver = field(default="cholesky", metadata={"static": True})
    factor: int = field(default=1, metadata={"static": True})

    def __post_init__(self) -> None:
        check_options(self)

    @property
    def side(self) -> int:
        """Pixels on a side of the blocks, in the output."""
        return self.block * self.factor

    def for_frame(self, frame: Frame, names: tuple[str, ...]) -> FLR:
        """With the block in pixels of the light, and the support for a frame of this size."""
        factor = factor_of(frame)
        block = max(self.block // factor, 1)
        return dataclasses.replace(self, block=block).at(factor, max(frame.normal.shape[:2]))

    def at(self, factor: int, longest: int) -> FLR:
        """For a frame whose longer side has so many pixels: a block no larger, and the support.

        That of a width that is traced is not known yet.
        """
        whole, support = STEP * -(-longest // STEP), self.support
        if support is None and _known(self.sigma):
            support = support_of(self.sigma, longest)
        support = None if support is None else min(support, whole)
        block = block_for(self.block, -(-longest // factor))
        return dataclasses.replace(self, block=block, support=support, factor=factor)

    def known(self, images: Parts) -> Known:
        """What guides are measured from."""
        return {"shift": centre(images["guides"], images["weight"])}

    def stages(self) -> tuple[Stage, ...]:
        side = self.side
        # Where the width is traced, nobody cuts the frame.
        known = self.support or (support_of(self.sigma) if _known(self.sigma) else 0)
        reach = -(-known // side) * side
        return (
            Stage(collect_moments, (("moments", side),), pixels=True),
            Stage(fit_models, (("models", side),), ("moments",), reach=reach),
            Stage(evaluate, (("image", 0),), ("models",), pixels=True, reach=side),
        )


def collect_moments(method: FLR, parts: Parts, known: Known) -> Parts:
    """Kernel 1."""
    light = parts["target"], parts["guides"], known["shift"]
    return {"moments": collect(*light, method.block, parts["weight"])}


def fit_models(method: FLR, parts: Parts, known: Known) -> Parts:
    """Kernels 2 and 3."""
    shift, moments = known["shift"], parts["moments"]
    support = method.support or support_of(method.sigma, method.side * max(moments.shape[1:]))
    blurred = blur(moments, method.sigma / method.side, -(-support // method.side))
    channels = channels_of(moments, shift.size)
    return {"models": solve(blurred, shift, method, channels, method.solver)}


def evaluate(method: FLR, parts: Parts, known: Known) -> Parts:
    """Kernel 4."""
    image = apply(parts["models"], guides_to_map(parts), known["shift"], method.side)
    return {"image": image}


DEFAULT = FLR()


def flr(
    target: jax.Array,
    guides: Guides,
    method: FLR = DEFAULT,
    *,
    guides_map: Guides | None = None,
    weight: jax.Array | None = None,
    **options: Any,
) -> jax.Array:
    """Fit the guides to a noisy image by windowed least squares and evaluate the fit.

    Linear in `target`: images denoised together as more channels sum to the denoised sum, and
    share the factorisation. With no guides (Q = 0) this is a Gaussian blur.

    target: `(H, W, C)`, the noisy radiance Y. guides: `(H, W, Q)`, X without the constant,
    or several such arrays that make up the Q channels together.
    method: numbers and options; options: fields of it to replace. guides_map: `(f H, f W, Q)` with
    an integer f >= 1, the guides the model is evaluated on (X_map of section 3.3; with f > 1 the
    joint upsampling of section 3.2.1, where up to f - 1 rows and columns may be missing); None
    evaluates on `guides`.
    weight: `(H, W)`, how much each pixel counts in the fit; 0 removes it, as does any value that
    is not finite.
    Returns `(H, W, C)`, or `(f H, f W, C)`.

    Raises `ValueError` or `TypeError`, naming the argument, if shapes, types or options are wrong.
    """
    method = dataclasses.replace(method, **options)
    factor = check_regression(target, guides, guides_map, weight)
    size = (jax.tree.leaves(guides_map) or [target])[0].shape[:2]
    images = {"target": target, "guides": guides, "guides_map": guides_map, "weight": weight}
    return regress(method.at(factor, max(size)), images)["image"]


def support_of(sigma: jax.Array | float, longest: float = math.inf) -> Any:
    """Three standard deviations, in steps of `STEP`, no farther than a frame's longer side.

    An integer, or traced as sigma is.
    """
    if _known(sigma):
        return STEP * max(math.ceil(min(3 * float(sigma), longest) / STEP), 1)
    return STEP * jnp.maximum(jnp.ceil(jnp.minimum(3 * sigma, longest) / STEP), 1)


def _known(sigma: jax.Array | float) -> bool:
    """Whether it is one number, neither traced nor another one for every frame."""
    return isinstance(sigma, int | float) or not (
        isinstance(sigma, jax.core.Tracer) or jnp.ndim(sigma)
    )
