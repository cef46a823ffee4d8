"""`render statistics`: the procedural families beside the real rooms, in numbers and a chart."""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("agg")
import matplotlib.pyplot as plt
import numpy as np

from experiments.rendering.scenes.catalogue import FAMILIES
from experiments.rendering.source import shared_frames
from experiments.rendering.statistics import MEASURES, covered, measure_file

Found = dict[str, list[dict[str, float]]]


def run(arguments: argparse.Namespace) -> None:
    """Print the statistics of the frames in `--folder` and of `shared/data`; draw them."""
    ours = _measure(sorted((arguments.folder / "train").glob("*.exr")))
    ours = {f: ours[f] for f in FAMILIES if f in ours}
    real = _measure(sorted(shared_frames().glob("*/*.exr")))
    if not ours or not real:
        raise ValueError(
            f"nothing to compare: {arguments.folder} needs frames (`render data`), and the real "
            f"rooms' must lie in {shared_frames()} (or where JFLNR_DATA says)"
        )
    _print(ours | real)
    for key, title in MEASURES.items():
        share = covered(_values(ours, key), _values(real, key))
        print(f"{title}: {share:.0%} of the real frames lie within the range of ours")
    _draw(ours, real, arguments.output)
    print(f"wrote {arguments.output}")


def _measure(paths: list[Path]) -> Found:
    found: Found = {}
    for path in paths:
        scene, values = measure_file(path)
        family = scene.rpartition("-")[0]
        found.setdefault(family if family in FAMILIES else scene, []).extend(values)
    return found


def _values(found: Found, key: str) -> list[float]:
    return [values[key] for frames in found.values() for values in frames]


def _print(found: Found) -> None:
    print(f"{'scene':16}{'layers':>7}" + "".join(f"{key:>12}" for key in MEASURES))
    for name, layers in found.items():
        medians = [np.median([layer[key] for layer in layers]) for key in MEASURES]
        print(f"{name:16}{len(layers):7}" + "".join(f"{m:12.3g}" for m in medians))


def _draw(ours: Found, real: Found, path: Path) -> None:
    figure, axes = plt.subplots(1, 4, figsize=(13, 5.5), sharey=True, layout="constrained")
    names = [*real, *ours]
    for axis, (key, title) in zip(axes, MEASURES.items(), strict=True):
        for row, name in enumerate(names):
            frames = (real | ours)[name]
            colour = "tab:blue" if name in FAMILIES else "tab:orange"
            axis.plot(
                [f[key] for f in frames], [row] * len(frames), "o", color=colour, alpha=0.6, ms=4
            )
        low, high = min(_values(ours, key)), max(_values(ours, key))
        axis.axvspan(low, high, color="tab:blue", alpha=0.08)
        axis.set_title(title, fontsize=10)
        if key in ("variance", "kurtosis"):
            axis.set_xscale("log")
        axis.grid(alpha=0.2)
    axes[0].set_yticks(range(len(names)), names)
    figure.suptitle("1-spp frames: real rooms (orange), our families and their range (blue)")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=90)
    plt.close(figure)
