"""The composed regression against plain least squares, and what must hold of it on any image."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jflnr.regression.flr import FLR
from jflnr.regression.flr import flr as uncompiled
from tests.oracle import flr_numpy

flr = jax.jit(uncompiled, static_argnames=("block", "support", "solver"))

PARAMETERS = FLR(sigma=6.0, eps=1e-3, eps_prime=1e-4)
EXACT = FLR(sigma=6.0, eps=1e-12, eps_prime=1e-12)


def image(rng, height, width, channels):
    """Smooth structure plus noise, in the range of normals and radiance."""
    y, x = np.mgrid[:height, :width] / 10
    waves = [np.sin((k + 1) * y * 0.7) * np.cos(x * (k + 2) * 0.4) for k in range(channels)]
    smooth = np.stack(waves, -1) if channels else np.zeros((height, width, 0))
    return smooth + 0.2 * rng.standard_normal((height, width, channels))


CASES = {
    "plain": (40, 48, 3, 3, 8),
    "five guides": (33, 29, 5, 3, 8),
    "per pixel": (12, 14, 2, 1, 1),
    "small blocks": (19, 21, 3, 2, 2),
    "large blocks": (37, 50, 2, 3, 16),
    "no guides": (30, 25, 0, 3, 4),
    "smaller than a block": (3, 5, 2, 1, 8),
    "one pixel": (1, 1, 1, 1, 8),
    "one row": (1, 31, 1, 2, 4),
    "one column": (31, 1, 1, 2, 4),
    "odd block": (20, 22, 2, 1, 3),
}


@pytest.mark.parametrize(
    ("case", "solver"),
    [*((case, "cholesky") for case in CASES), ("plain", "block-inverse")],
)
def test_equals_plain_least_squares_in_float64(rng, case, solver):
    height, width, q, c, block = CASES[case]
    x, y = image(rng, height, width, q), image(rng, height, width, c)
    with jax.enable_x64(True):
        ours = flr(
            jnp.asarray(y), jnp.asarray(x), PARAMETERS, block=block, support=60, solver=solver
        )
        assert ours.dtype == jnp.float64
    truth = flr_numpy.flr(y, x, 6.0, 1e-3, 1e-4, block)
    np.testing.assert_allclose(ours, truth, atol=1e-9)


def test_float32_is_close_to_float64(rng):
    x, y = image(rng, 60, 70, 5), image(rng, 60, 70, 3)
    ours = flr(jnp.float32(y), jnp.float32(x), PARAMETERS)
    truth = flr_numpy.flr(y, x, 6.0, 1e-3, 1e-4)
    # Rounding of the moments, grown by the correlation's condition, far below the noise.
    np.testing.assert_allclose(ours, truth, atol=2e-4)


def test_guides_far_from_zero_keep_their_digits(rng):
    offset = np.array([1e4, -3e3])
    x, y = np.float32(image(rng, 40, 40, 2) + offset), image(rng, 40, 40, 1)
    tiny = FLR(sigma=6.0, eps=1e-12, eps_prime=1e-4)
    ours = flr(jnp.float32(y), jnp.asarray(x), tiny)
    np.testing.assert_allclose(ours, flr_numpy.flr(y, x, 6.0, 1e-12, 1e-4), atol=2e-4)


def test_weights_and_masks_match_the_oracle(rng):
    x, y = image(rng, 30, 34, 3), image(rng, 30, 34, 3)
    weight = rng.random((30, 34)) * (rng.random((30, 34)) > 0.5)
    with jax.enable_x64(True):
        for w in (weight, weight > 0):
            ours = flr(
                jnp.asarray(y), jnp.asarray(x), PARAMETERS, weight=jnp.asarray(w), support=60
            )
            truth = flr_numpy.flr(y, x, 6.0, 1e-3, 1e-4, weight=w)
            np.testing.assert_allclose(ours, truth, atol=1e-9)


def test_what_is_not_finite_is_as_good_as_masked(rng):
    x, y = np.float32(image(rng, 30, 34, 3)), np.float32(image(rng, 30, 34, 3))
    bad = rng.random((30, 34)) < 0.1
    spoiled = y.copy()
    spoiled[bad] = rng.choice([np.nan, np.inf, -np.inf], size=(bad.sum(), 3))
    ours = flr(jnp.asarray(spoiled), jnp.asarray(x), PARAMETERS)
    masked = flr(jnp.asarray(y), jnp.asarray(x), PARAMETERS, weight=jnp.asarray(~bad))
    assert np.isfinite(ours).all()
    # Up to rounding: the mask also says where the shift is taken.
    np.testing.assert_allclose(ours, masked, atol=1e-5)
    x[3, 4, 1] = np.nan
    assert np.isfinite(flr(jnp.asarray(y), jnp.asarray(x), PARAMETERS)).all()


def test_a_frame_without_usable_pixels_is_black(rng):
    x = jnp.float32(image(rng, 20, 20, 2))
    out = flr(jnp.full((20, 20, 3), jnp.nan), x, PARAMETERS)
    np.testing.assert_array_equal(out, 0)


def test_affine_radiance_is_reproduced_as_eps_vanishes(rng):
    x = image(rng, 40, 50, 3)
    y = x @ rng.standard_normal((3, 2)) + [0.3, 2.0]
    with jax.enable_x64(True):
        out = flr(jnp.asarray(y), jnp.asarray(x), EXACT)
    np.testing.assert_allclose(out, y, atol=1e-6)


@pytest.mark.parametrize("size", [(40, 48), (37, 43), (5, 90)])
def test_a_constant_stays_constant_to_the_edge(rng, size):
    x = jnp.float32(image(rng, *size, 4))
    out = flr(jnp.full((*size, 3), 2.5), x, PARAMETERS)
    np.testing.assert_allclose(out, 2.5, rtol=1e-5)


def test_linear_in_the_target_so_light_groups_add_up(rng):
    x = jnp.float32(image(rng, 40, 50, 5))
    groups = jnp.float32(image(rng, 40, 50, 9))
    together = flr(groups, x, PARAMETERS)
    separate = [flr(groups[..., i : i + 3], x, PARAMETERS) for i in (0, 3, 6)]
    np.testing.assert_allclose(together, jnp.concatenate(separate, -1), atol=1e-5)
    total = flr(groups[..., :3] + groups[..., 3:6] + groups[..., 6:], x, PARAMETERS)
    np.testing.assert_allclose(sum(separate), total, atol=2e-5)


@pytest.mark.parametrize(
    "turn", [lambda a: a[::-1], lambda a: a[:, ::-1], lambda a: jnp.swapaxes(a, 0, 1)]
)
def test_turning_the_image_turns_the_result(rng, turn):
    x, y = jnp.float32(image(rng, 48, 64, 3)), jnp.float32(image(rng, 48, 64, 3))
    ours = flr(turn(y), turn(x), PARAMETERS)
    np.testing.assert_allclose(ours, turn(flr(y, x, PARAMETERS)), atol=1e-5)


def test_layers_apart_are_the_same_as_together(rng):
    x, y = jnp.float32(image(rng, 30, 40, 5)), jnp.float32(image(rng, 30, 40, 3))
    apart = (x[..., :3], x[..., 3:4], x[..., 4:])
    np.testing.assert_array_equal(flr(y, apart, PARAMETERS), flr(y, x, PARAMETERS))


def test_jit_and_vmap_change_nothing(rng):
    x, y = jnp.float32(image(rng, 20, 30, 3)), jnp.float32(image(rng, 20, 30, 3))
    plain = uncompiled(y, x, PARAMETERS)
    np.testing.assert_allclose(flr(y, x, PARAMETERS), plain, atol=1e-5)
    pair = jax.jit(jax.vmap(uncompiled, in_axes=(0, 0, None)))(
        jnp.stack([y, 2 * y]), jnp.stack([x, -x]), PARAMETERS
    )
    np.testing.assert_allclose(pair[0], plain, atol=1e-5)
    np.testing.assert_allclose(pair[1], flr(2 * y, -x, PARAMETERS), atol=1e-5)


def test_other_values_do_not_recompile(rng):
    compiled = jax.jit(lambda *arguments: uncompiled(*arguments))
    for sigma in (4.0, 9.0):
        x, y = jnp.float32(image(rng, 16, 24, 2)), jnp.float32(image(rng, 16, 24, 3))
        compiled(y, x, FLR(sigma, 1e-3, 1e-4))
    assert compiled._cache_size() == 1


def test_the_map_guides_are_what_the_model_is_evaluated_on(rng):
    x, y = image(rng, 24, 32, 2), image(rng, 24, 32, 3)
    mapped = image(rng, 24, 32, 2)
    with jax.enable_x64(True):
        ours = flr(
            jnp.asarray(y),
            jnp.asarray(x),
            PARAMETERS,
            guides_map=jnp.asarray(mapped),
            support=60,
        )
    truth = flr_numpy.flr(y, x, 6.0, 1e-3, 1e-4, guides_map=mapped)
    np.testing.assert_allclose(ours, truth, atol=1e-9)


@pytest.mark.parametrize(("factor", "size"), [(2, (48, 64)), (4, (46, 61))])
def test_upsampling_with_finer_guides(rng, factor, size):
    """Sigma is in pixels of the output, so the coarse window is narrower by the factor."""
    fine = image(rng, *size, 2)
    coarse = image(rng, *(-(-s // factor) for s in size), 2)
    y = image(rng, *coarse.shape[:2], 3)
    with jax.enable_x64(True):
        ours = flr(
            jnp.asarray(y),
            jnp.asarray(coarse),
            PARAMETERS,
            block=2,
            guides_map=jnp.asarray(fine),
            support=60,
        )
    truth = flr_numpy.flr(y, coarse, 6.0 / factor, 1e-3, 1e-4, 2, guides_map=fine)
    assert ours.shape == (*size, 3)
    np.testing.assert_allclose(ours, truth, atol=1e-9)


@pytest.mark.parametrize("dtype", [jnp.bfloat16, jnp.float16])
def test_half_guides_are_summed_in_float32(rng, dtype):
    x, y = jnp.asarray(image(rng, 40, 40, 3), dtype), jnp.float32(image(rng, 40, 40, 3))
    out = flr(y, x, PARAMETERS)
    assert out.dtype == jnp.float32
    np.testing.assert_allclose(out, flr(y, x.astype(jnp.float32), PARAMETERS), atol=1e-5)


X, Y = np.zeros((8, 9, 2), np.float32), np.zeros((8, 9, 3), np.float32)


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"target": Y[..., 0]}, ValueError, "target"),
        ({"target": Y[..., :0]}, ValueError, "target"),
        ({"target": Y[:0], "guides": X[:0]}, ValueError, "target"),
        ({"guides": X[:4]}, ValueError, "guides"),
        ({"guides": X.astype(int)}, TypeError, "guides"),
        ({"weight": np.ones((4, 9))}, ValueError, "weight"),
        ({"block": 0}, ValueError, "block"),
        ({"block": 2.5}, TypeError, "block"),
        ({"support": -1}, ValueError, "support"),
        ({"guides_map": np.zeros((12, 13, 2), np.float32)}, ValueError, "guides_map"),
        ({"guides_map": np.zeros((8, 9, 3), np.float32)}, ValueError, "guides_map"),
        ({"solver": "magic"}, ValueError, "solver"),
    ],
)
def test_wrong_arguments_are_named(change, error, words):
    arguments = {"target": Y, "guides": X, "parameters": PARAMETERS} | change
    with pytest.raises(error, match=words):
        uncompiled(**arguments)
