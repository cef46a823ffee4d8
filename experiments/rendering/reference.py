"""The converged layer: accumulated in float64, resumable, with a measure of its own noise.

Four replicates are summed, each a scrambled (0,2)-sequence of its own. The first two make
`reference_a`. The spread of the four gives the standard error, which randomised sequences allow
and which a variance over their (dependent) samples would overstate. Before the first sample, a
pilot teaches a guide (`guide.py`) and decides whether multiple importance sampling pays here.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from experiments.rendering.guide import Guide
from experiments.rendering.sampling import stream_seed
from experiments.rendering.tracer import Tracer

if TYPE_CHECKING:
    from experiments.rendering.frame import Settings

REPLICATES = 4
SAVE_EVERY = 60.0  # seconds
FEW = 256  # samples a pixel
STOP_LEARNING = 2048  # samples a pixel


@dataclass(frozen=True)
class Goal:
    """When a reference is good enough: at this median relative standard error, or at a bound.

    `seconds` are of one processor: 2400 are 20 minutes of two cores.
    """

    error: float = 0.03
    least_spp: int = 256
    most_spp: int = 1 << 17
    seconds: float = 2400.0


def clock() -> float:
    """Processor seconds, which do not pass while other programs run; on a GPU real ones."""
    return time.monotonic() if str(mi.variant()).startswith("cuda") else time.process_time()


@dataclass
class Accumulator:
    """`sums` is `(4, H, W, 3)` float64, of `spp / 4` samples each; `mask` is `(H, W)` bool."""

    tracer: Tracer
    settings: Settings
    seed: int
    mask: NDArray[np.bool_]
    state: Path | None
    sums: NDArray[np.float64]
    spp: int = 0
    seconds: float = 0.0
    guide: Guide | None = None
    mis: bool = True

    @classmethod
    def of(
        cls,
        tracer: Tracer,
        settings: Settings,
        seed: int,
        mask: NDArray[np.bool_],
        state: Path | None = None,
    ) -> Accumulator:
        """A new one, or the one saved in `state` where that fits."""
        sums = np.zeros((REPLICATES, tracer.height, tracer.width, 3))
        made = cls(tracer, settings, seed, mask, state, sums)
        if state is not None and state.exists():
            saved = np.load(state)
            if str(saved["key"]) == made._key() and saved["sums"].shape == sums.shape:
                made.sums, made.spp = saved["sums"], int(saved["spp"])
                made.seconds = float(saved["seconds"])
        return made

    def _key(self) -> str:
        """What must agree for a saved state to be continued."""
        s = self.settings
        position = float(np.float64(self.tracer.guides["position"]).sum())
        return f"{self.seed}/{s.bounces}/{s.mis}/{position!r}"

    def run(self, goal: Goal, report: Callable[[float, str], None] | None = None) -> None:
        """Sample until the goal is met; saves its state on the way, and when it is interrupted."""
        saved = time.monotonic()
        if not self.enough(goal):
            self.prepare(few=goal.most_spp < FEW)
        try:
            while not self.enough(goal):
                self._step(goal)
                if report:
                    report(self.share(goal), f"{self.spp} spp, error {self.relative_error():.3f}")
                if time.monotonic() - saved > SAVE_EVERY:
                    self.save()
                    saved = time.monotonic()
        except KeyboardInterrupt:
            self.save()
            raise

    def prepare(self, few: bool = False) -> None:
        """Teach the guide, then keep or drop multiple importance sampling, whichever is better.

        For a few samples only, a trial would cost more than it saves: it pays under a sky.
        """
        self.guide, self.mis = self.tracer.guide(), self.settings.mis
        if self.guide is None:  # scalar variant: a pilot would cost more than it saves
            return
        for i, spp in enumerate((16,) if few else (16, 32)):
            seed = stream_seed(self.seed, "pilot", i)
            self._indirect(spp, seed, 0)
            self.guide.learn()
        if few:
            self.mis = self.mis and self.tracer.lights.environment
        elif self.settings.mis:
            self.mis = self._cost(True) < self._cost(False)

    def _cost(self, mis: bool) -> float:
        """Variance x seconds of a few samples, relative to the mean."""
        self.mis = mis
        self._indirect(1, 0, 0)  # compiles
        start = time.process_time()
        a, b = (self._indirect(8, stream_seed(self.seed, "cost", i), 0) for i in range(2))
        seconds = time.process_time() - start
        spread = np.abs(a - b).mean(-1)[self.mask] / np.maximum((a + b).mean(-1)[self.mask], 1e-9)
        return float(np.median(spread) ** 2 * seconds) if self.mask.any() else 0.0

    def _indirect(self, spp: int, seed: int, first: int) -> NDArray[np.float64]:
        """Guided samples, of which the guide takes note: that costs nothing measurable."""
        bounces = self.settings.bounces
        return self.tracer.indirect(
            spp, seed, first, bounces, self.mis, self.guide, bool(self.guide)
        )

    def enough(self, goal: Goal) -> bool:
        """Whether the error is small, or a bound on samples or time is reached."""
        if self.spp < goal.least_spp:
            return False
        bound = self.spp >= goal.most_spp or self.seconds >= goal.seconds
        return bound or self.relative_error() <= goal.error

    def share(self, goal: Goal) -> float:
        """About how much of the work is done: the error falls as one over the root of samples."""
        if self.spp < goal.least_spp:
            return self.spp / goal.least_spp * 0.5
        by_error = (goal.error / max(self.relative_error(), 1e-9)) ** 2
        return min(1.0, max(by_error, self.seconds / goal.seconds, self.spp / goal.most_spp))

    def _step(self, goal: Goal) -> None:
        """A quarter more samples (at least 16, at most 256) to each replicate, to the bound."""
        each = self.spp // REPLICATES
        left = -(-(goal.most_spp - self.spp) // REPLICATES)
        more = min(int(np.clip(each // 4, 16, 256)) // 16 * 16, max(left, 1))
        start = clock()
        seeds = (stream_seed(self.seed, i) for i in range(REPLICATES))
        self.sums += np.stack([self._indirect(more, seed, each) for seed in seeds])
        self.spp += REPLICATES * more
        if self.guide and self.spp <= STOP_LEARNING:
            self.guide.learn()
        self.seconds += clock() - start

    def mean(self) -> NDArray[np.float64]:
        """The reference `(H, W, 3)`."""
        return self.mask[..., None] * self.sums.sum(0) / self.spp

    def first_half(self) -> NDArray[np.float64]:
        """The mean of the first two replicates `(H, W, 3)`."""
        half = REPLICATES // 2
        return self.mask[..., None] * self.sums[:half].sum(0) / (self.spp / 2)

    def variance(self) -> NDArray[np.float64]:
        """Variance of the mean's luminance `(H, W)`: three degrees of freedom a pixel."""
        means = self.sums.mean(-1) / (self.spp / REPLICATES)
        return means.var(0, ddof=1) / REPLICATES

    def relative_error(self) -> float:
        """Median over the mask of standard error over mean, variances pooled over 3 x 3 pixels."""
        if not self.mask.any():
            return 0.0
        mean = self.mean().mean(-1)
        weight = uniform_filter(self.mask.astype(float), 3, mode="constant")
        pooled = uniform_filter(self.mask * self.variance(), 3, mode="constant")
        with np.errstate(invalid="ignore", divide="ignore"):
            relative = np.sqrt(pooled / weight)[self.mask] / mean[self.mask]
        return float(np.median(np.where(mean[self.mask] > 0, relative, 1.0)))

    def samples_per_second(self) -> float:
        """Indirect samples of all pixels a processor second."""
        pixels = self.tracer.width * self.tracer.height
        return self.spp * pixels / max(self.seconds, 1e-9)

    def save(self) -> None:
        """Write the state, atomically, where there is a file for it."""
        if self.state is None:
            return
        self.state.parent.mkdir(parents=True, exist_ok=True)
        beside = self.state.with_suffix(".tmp.npz")
        content: dict[str, Any] = {"sums": self.sums, "spp": self.spp, "seconds": self.seconds}
        np.savez(beside, key=self._key(), **content)
        os.replace(beside, self.state)
