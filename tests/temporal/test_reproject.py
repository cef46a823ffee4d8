"""Where pixels come from, against a loop over pixels in numpy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jflnr.temporal import Surface, find_taps, gather
from jflnr.temporal.reproject import own_turn

HEIGHT, WIDTH = 12, 16


def plane(depth: np.ndarray) -> Surface:
    """What a camera without perspective sees of surfaces that face it; a pixel is 1/8 wide."""
    y, x = np.mgrid[: depth.shape[0], : depth.shape[1]].astype(np.float32) / 8
    normal = np.broadcast_to(np.float32([0, 0, -1]), (*depth.shape, 3))
    return Surface(normal, depth[..., None], np.stack([x, y, depth], axis=-1))


def constant(x: float, y: float) -> np.ndarray:
    return np.broadcast_to(np.float32([x, y]), (HEIGHT, WIDTH, 2))


def texture(channels: int = 3) -> np.ndarray:
    return np.random.default_rng(0).random((HEIGHT, WIDTH, channels), np.float32)


FLAT = plane(np.full((HEIGHT, WIDTH), 2, np.float32))
find_jit, gather_jit = jax.jit(find_taps), jax.jit(gather)


def by_hand(
    image: np.ndarray, motion: np.ndarray, here: Surface, before: Surface
) -> tuple[np.ndarray, np.ndarray]:
    """The result and whether the pixel was seen, pixel by pixel in float64."""
    result, seen = np.zeros(image.shape), np.zeros((HEIGHT, WIDTH, 1), bool)
    for y, x in np.ndindex(HEIGHT, WIDTH):
        u, v = np.float64([x, y]) + motion[y, x]
        total, weights = np.zeros(image.shape[-1]), 0.0
        for row, column in np.ndindex(HEIGHT, WIDTH):
            share = max(1 - abs(u - column), 0) * max(1 - abs(v - row), 0)
            offset = before.position[row, column] - here.position[y, x].astype(float)
            moved = np.abs(motion[y, x]).max() / WIDTH
            near = abs(here.normal[y, x] @ offset) <= (0.01 + moved) * here.depth[y, x, 0]
            if share and near and here.normal[y, x] @ before.normal[row, column] >= 0.8:
                total, weights = total + share * image[row, column], weights + share
        if weights:
            result[y, x], seen[y, x] = total / weights, True
    return result, seen


def test_as_by_hand() -> None:
    random = np.random.default_rng(1)
    depths = 2 + (random.random((2, HEIGHT, WIDTH)) < 0.3).astype(np.float32)
    here, before = map(plane, depths)
    turned = random.random((HEIGHT, WIDTH, 1)) < 0.2
    before = before._replace(normal=np.where(turned, np.float32([1, 0, 0]), before.normal))
    motion = random.normal(0, 3, (HEIGHT, WIDTH, 2)).astype(np.float32)
    taps = find_jit(motion, here, before)
    wanted, seen = by_hand(texture(), motion, here, before)
    assert 0.2 < seen.mean() < 0.9
    np.testing.assert_array_equal(taps.seen, seen)
    np.testing.assert_allclose(gather_jit(taps, texture()), wanted, atol=2e-5)


def test_a_turn_counts_where_the_surface_moved_by_itself() -> None:
    """By 0.3, of points that have moved by a half, three quarters and one pixel and more."""
    turned = FLAT._replace(normal=np.broadcast_to(np.float32([0, 0.3, -1]), FLAT.normal.shape))
    pixel = 2 / WIDTH
    for moved, share in ((0, 0), (0.45, 0), (0.75, 1.25 / 3), (1.1, 1), (9, 1)):
        gone = turned._replace(position=FLAT.position + np.float32([moved * pixel, 0, 0]))
        turn = own_turn(find_jit(constant(0, 0), gone, FLAT), gone, FLAT)
        np.testing.assert_allclose(turn, 0.09 * share, atol=1e-5)
    assert not own_turn(find_jit(constant(99, 0), gone, FLAT), gone, FLAT).any()
    flat, gone = (surface._replace(position=None) for surface in (FLAT, turned))
    turn = own_turn(find_jit(constant(0, 0), gone, flat), gone, flat)
    np.testing.assert_allclose(turn, 0.09, rtol=1e-5)


def test_whole_pixels_move_the_image_exactly() -> None:
    taps = find_jit(constant(-3, 2), FLAT, FLAT)
    moved = gather_jit(taps, texture())
    np.testing.assert_array_equal(moved[:-2, 3:], texture()[2:, :-3])
    assert not taps.seen[-2:].any() and not taps.seen[:, :3].any()
    np.testing.assert_array_equal(moved[-2:], 0)


def test_nothing_moves_nothing_changes() -> None:
    taps = find_jit(constant(0, 0), FLAT, FLAT)
    np.testing.assert_array_equal(gather_jit(taps, texture()), texture())
    assert taps.seen.all()


def test_what_was_hidden_is_disoccluded() -> None:
    near = np.full((HEIGHT, WIDTH), 2, np.float32)
    near[4:8, 4:8] = 1
    taps = find_jit(constant(0, 0), FLAT, plane(near))
    np.testing.assert_array_equal(taps.seen[..., 0], near == 2)


@pytest.mark.parametrize(("length", "seen"), [(1, True), (1.5, True), (1e20, False)])
def test_what_is_no_normal_is_another_surface(length: float, seen: bool) -> None:
    before = FLAT._replace(normal=np.float32(length) * np.asarray(FLAT.normal))
    np.testing.assert_array_equal(find_jit(constant(0, 0), FLAT, before).seen, seen)


def test_edges_keep_to_their_side() -> None:
    """Half a pixel beside an edge, the tap across it is left out and the others make up for it."""
    depth = np.full((HEIGHT, WIDTH), 2, np.float32)
    depth[:, 8:] = 6
    image = depth[..., None] * 10
    moved = gather_jit(find_jit(constant(0.25, 0.25), plane(depth), plane(depth)), image)
    np.testing.assert_allclose(moved, image, rtol=1e-6)


def test_a_floor_seen_at_a_flat_angle_is_one_surface() -> None:
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32)
    position = np.stack([x, np.zeros_like(x), 5 * y], axis=-1)
    normal = np.broadcast_to(np.float32([0, 1, 0]), position.shape)
    floor = Surface(normal, 1 + 5 * y[..., None], position)
    taps = find_jit(constant(0, 0.5), floor, floor)
    assert taps.seen.all()
    assert np.count_nonzero(taps.weight[3]) == 2 * WIDTH


@pytest.mark.parametrize("scale", [1e-4, 1e4])
def test_the_unit_of_length_does_not_matter(scale: float) -> None:
    depth = 2 + (texture(1)[..., 0] > 0.5).astype(np.float32)
    motion = constant(0.3, -0.6)
    scaled = plane(depth)
    scaled = scaled._replace(depth=scaled.depth * scale, position=scaled.position * scale)
    taps, wanted = find_jit(motion, scaled, scaled), find_jit(motion, plane(depth), plane(depth))
    np.testing.assert_array_equal(taps.weight, wanted.weight)


def test_without_positions_depths_are_compared() -> None:
    depth = np.full((HEIGHT, WIDTH), 2, np.float32)
    depth[4:8, 4:8] = 1
    here, before = FLAT._replace(position=None), plane(depth)._replace(position=None)
    taps = find_jit(constant(0, 0), here, before)
    np.testing.assert_array_equal(taps.seen[..., 0], depth == 2)


def test_unknown_and_absurd_motion_is_disoccluded() -> None:
    motion = constant(0, 0).copy()
    motion[0], motion[1], motion[2] = np.nan, 1e30, -np.inf
    taps = find_jit(motion, FLAT, FLAT)
    assert not taps.seen[:3].any() and taps.seen[3:].all()
    assert np.isfinite(taps.weight).all()


def test_adjoint() -> None:
    """gather is linear in the image: y . (A x) = (A^T y) . x."""
    motion = np.random.default_rng(2).normal(0, 2, (HEIGHT, WIDTH, 2)).astype(np.float32)
    taps = find_jit(motion, FLAT, FLAT)
    x, y = texture(), texture()[::-1].copy()
    image, transposed = jax.vjp(lambda image: gather(taps, image), x)
    np.testing.assert_allclose(
        jnp.vdot(y, image), jnp.vdot(transposed(jnp.asarray(y))[0], x), rtol=1e-5
    )
