"""New pixels among known ones, against plain loops."""

import jax
import numpy as np
import pytest

from jflnr.temporal.newly_seen import AROUND, BRIGHTER, NEAR, bounded

HEIGHT, WIDTH = 12, 17
bounded_jit = jax.jit(bounded)


def by_loops(image, known, weight, depth):
    light, result = np.float64(image[..., 0]), np.float64(image)
    for y, x in np.argwhere(~known & (light > 0)):
        rows = slice(max(y - AROUND, 0), y + AROUND + 1)
        columns = slice(max(x - AROUND, 0), x + AROUND + 1)
        far = depth[rows, columns, 0]
        near = np.abs(far - depth[y, x, 0]) < NEAR * depth[y, x, 0]
        counts = np.where(near, weight[rows, columns], 0)
        if np.sum(counts * known[rows, columns]) > 0:
            mean = np.sum(counts * light[rows, columns]) / np.sum(counts)
            wanted = np.clip(light[y, x], mean / BRIGHTER, mean * BRIGHTER)
            result[y, x] *= wanted / light[y, x]
    return result


@pytest.fixture
def scene(rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Two surfaces, one behind the other, whose light varies by far more than the bound."""
    depth = np.where(np.arange(WIDTH) < 9, 4, 5)[None, :, None] + 0 * np.ones((HEIGHT, WIDTH, 1))
    return {
        "image": np.float32(rng.exponential(size=(HEIGHT, WIDTH, 1))),
        "known": rng.random((HEIGHT, WIDTH)) < 0.7,
        "weight": np.float32(rng.random((HEIGHT, WIDTH)) * (rng.random((HEIGHT, WIDTH)) < 0.8)),
        "depth": np.float32(depth + 0.03 * rng.random(depth.shape)),
    }


def test_it_is_what_loops_give(scene: dict[str, np.ndarray]) -> None:
    found, wanted = np.asarray(bounded_jit(**scene)), by_loops(**scene)
    np.testing.assert_allclose(found, wanted, rtol=1e-5)
    changed = (found != scene["image"])[..., 0]
    assert changed.any() and not changed[scene["known"]].any()


@pytest.mark.parametrize("known", [False, True])
def test_where_all_is_new_or_nothing_is_nothing_changes(
    scene: dict[str, np.ndarray], known: bool
) -> None:
    scene["known"] = np.full((HEIGHT, WIDTH), known)
    np.testing.assert_array_equal(bounded_jit(**scene), scene["image"])
