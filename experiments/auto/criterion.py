"""Which criterion tells best, without a reference, how wrong a local model is?"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from scipy.ndimage import correlate1d

import jflnr
from experiments import data, resume
from experiments.auto import ceiling, criteria
from experiments.auto.ceiling import BLOCK, SIDES, rank
from experiments.data import has
from experiments.results import Parts, Row
from jflnr.images.inputs import plain_images
from jflnr.regression.blur import gaussian_taps
from jflnr.regression.level import brightness
from jflnr.regression.moments import centre, collect, index_xy

NAME = "auto-criterion"

NAMES = ("normal", "depth", "ao")
SIGMAS = (8, 16, 32)
# Regressors of the nested orders: constant, normal, depth, ambient occlusion.
ORDERS = (1, 4, 5, 6)
RIDGE = 1e-4
# Samples per pixel of the independent stream that half buffers are tested on.
SECOND = 4
PICK, RANK = "squared error of the pick, best fixed = 1", "rank correlation"
CRITERIA = ("GCV", "Mallows", "leave block out", "half buffers")


def run(quick: bool) -> Parts:
    """Rank correlation and regret of every criterion, frame by frame."""
    paths = data.frames("val", "test")[: 1 if quick else None]
    names = [str(path) for path in paths]
    tag = "-quick" * quick
    rows = resume.rows(f"{NAME}{tag}", names, lambda name: one(Path(name)))
    several = [] if quick else [str(path) for path in ceiling.with_draws()]
    ceilings = resume.rows(f"{NAME}-ceiling", several, lambda name: ceiling.one(Path(name)))
    tables = {PICK: [_pick(row) for row in rows], RANK: [_ranks(row) for row in rows]}
    found = tables | ({"ceiling": ceilings} if ceilings else {})
    return {
        name: [*table, {"frame": "mean of test"} | means(table)] for name, table in found.items()
    }


def _pick(row: Row) -> Row:
    picked = {name: row[name]["error"] for name in CRITERIA if name in row}
    return {"frame": row["frame"], "oracle": row["oracle"]} | picked


def _ranks(row: Row) -> Row:
    names = [name for name in (*CRITERIA, "ours") if name in row]
    return {"frame": row["frame"]} | {f"{n}, {s}": row[n][str(s)] for n in names for s in SIDES}


def one(path: Path) -> dict[str, Any]:
    """All criteria on one frame: their rank correlation with the true error, and their regret."""
    first, truth = sums_and_truth(path, 1)
    # Our frames have no second stream of 1 sample, so half buffers are shown at their best.
    second = sums_and_truth(path, SECOND)[0] if has(path, SECOND) else None
    used = first.xx[..., 0, 0] > 0.99
    told: dict[str, list[np.ndarray]] = {name: [] for name in CRITERIA}
    true = []
    for sigma in SIGMAS:
        for order in ORDERS:
            found = judge(first, second, sigma / BLOCK, order)
            for name, error in found.items():
                told[name].append(error)
            window = blurred(first, sigma / BLOCK).order(order)
            model = criteria.solve(window, RIDGE)
            true.append(criteria.mean_residual(truth.order(order), model))
    row: dict[str, Any] = {"frame": data.label(path)}
    errors = np.stack(true)[:, used]
    best = errors.mean(axis=1).min()
    row["oracle"] = float(errors.min(axis=0).mean() / best)
    for name, candidates in told.items():
        if not candidates:
            continue
        guess = np.stack(candidates)[:, used]
        picked = np.take_along_axis(errors, guess.argmin(axis=0)[None], axis=0)
        row[name] = {"error": float(picked.mean() / best)}
        pairs = list(zip(true, candidates, strict=True))
        row[name] |= {
            str(side): float(np.mean([rank(a, b, used, side) for a, b in pairs])) for side in SIDES
        }
    row["ours"] = expected_error(path)
    return row


def sums_and_truth(path: Path, spp: int) -> tuple[criteria.Sums, criteria.Sums]:
    """Sums over blocks of one noisy layer, and of the reference in its place."""
    frame = jflnr.read_frame(path, spp=spp)
    images = plain_images(frame, NAMES)
    shift = centre(images["guides"], images["weight"])
    found = []
    for light in (images["target"], frame.reference):
        planes = _collected(light, images["guides"], shift, images["weight"])
        found.append(_brightness_sums(np.asarray(planes, np.float64)))
    return found[0], found[1]


@jax.jit
def _collected(target: Any, guides: Any, shift: Any, weight: Any) -> jax.Array:
    return collect(target, guides, shift, BLOCK, weight, brightness(3, target.dtype))


def _brightness_sums(planes: np.ndarray) -> criteria.Sums:
    xx = index_xy(0, 0, 5, 3)
    cross = planes[xx:-1].reshape(6, 3, *planes.shape[1:])
    light = np.einsum("qchw,c->qhw", cross, np.asarray(brightness(3, jnp.dtype(np.float32))))
    return criteria.sums_of(np.concatenate([planes[:xx], light]), planes[-1], 5)


def judge(
    first: criteria.Sums, second: criteria.Sums | None, sigma: float, order: int
) -> dict[str, np.ndarray]:
    """What each criterion says of one candidate, `(h, w)`. sigma: in blocks."""
    window = blurred(first, sigma)
    weight = window.xx[..., 0, 0]
    # Pixels that would be as good without weights: (sum w)^2 / sum w^2.
    count = BLOCK**2 * weight**2 / np.maximum(squared(first, sigma), 1e-12)

    def of(order: int) -> tuple[np.ndarray, np.ndarray]:
        sums = window.order(order)
        model = criteria.solve(sums, RIDGE)
        return criteria.mean_residual(sums, model), criteria.freedom(sums, RIDGE)

    mean_square, freedom = of(order)
    noise = criteria.gcv(*of(ORDERS[-1]), count)
    own = first.order(order)
    at_centre = criteria.Sums(*(_centre_tap(sigma) * part for part in own))
    left_out = criteria.leave_out(window.order(order), at_centre, RIDGE)
    found = {
        "GCV": criteria.gcv(mean_square, freedom, count),
        "Mallows": criteria.mallows(mean_square, noise, freedom, count),
        "leave block out": smooth(left_out),
    }
    if second is not None:
        model = criteria.solve(window.order(order), RIDGE)
        found["half buffers"] = smooth(criteria.mean_residual(second.order(order), model))
    return found


def blurred(sums: criteria.Sums, sigma: float) -> criteria.Sums:
    """Sums under a Gaussian window of so many blocks."""
    return criteria.Sums(*(_blur(part, _taps(sigma)) for part in sums))


def squared(sums: criteria.Sums, sigma: float) -> np.ndarray:
    """Sum of the squared weights under the window."""
    return _blur(sums.xx[..., 0, 0], _taps(sigma) ** 2)


def smooth(error: np.ndarray) -> np.ndarray:
    """A block's own error is one draw; those around it tell of it too."""
    return _blur(error, _taps(2.0))


def _taps(sigma: float) -> np.ndarray:
    reach, dtype = int(np.ceil(3 * sigma)), jnp.dtype(np.float32)
    return np.asarray(gaussian_taps(jnp.asarray(sigma), reach, dtype), np.float64)


def _centre_tap(sigma: float) -> float:
    taps = _taps(sigma)
    return float(taps[taps.size // 2] ** 2)


def _blur(part: np.ndarray, taps: np.ndarray) -> np.ndarray:
    for axis in (0, 1):
        part = correlate1d(part, taps, axis=axis, mode="constant")
    return part


def expected_error(path: Path) -> dict[str, float]:
    """The same correlation for the error that the form of blocks of 8 tells of its own result."""
    true, told, used = ceiling.true_and_told(jflnr.read_frame(path))
    return {str(side): rank(true, told, used, side) for side in SIDES}


def means(table: list[dict[str, Any]]) -> dict[str, float]:
    """Means over the test frames, or over all if there are none."""
    test = [row for row in table if row["frame"].startswith("test")] or table
    keys = {key for row in test for key in row if key != "frame"}
    return {key: float(np.mean([row[key] for row in test if key in row])) for key in keys}
