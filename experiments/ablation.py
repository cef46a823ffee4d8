"""What each part of adaptive FLR brings, and where that leaves it against OIDN."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jflnr
from experiments import data, plots, results
from jflnr.regression.adaptive import flr_adaptive
from jflnr.regression.adaptive_parameters import ADAPTIVE_DEFAULT, AdaptiveParameters
from jflnr.regression.level import brightness
from jflnr.regression.noisy_guides import smooth_guide
from jflnr.regression.parameters import DEFAULT
from jflnr.frame import Frame
from jflnr.guides import layers
from jflnr.metrics import measure

NAME = "ablation"
QUESTION = "What does each part of adaptive FLR bring, in quality, energy and time?"
MINUTES = 10

COUNTS = (1, 4, 16)
METRICS = ("psnr", "ssim", "flip")
# Settings that switch one part off.
WITHOUT: dict[str, dict[str, Any]] = {
    "without weights": {"exponent": 1e-6},
    "without edge-aware windows": {"guide_scale": 1e-6, "brightness_scale": 1e-6},
    "without the brightness edge": {"brightness_scale": 1e-6},
    "without the noise ridge": {"noise_ridge": 1e-9},
    "without slopes in position": {"position_ridge": 1e9},
    "without caution: finest width only": {"caution": 1e-9},
    "only the widest": {"caution": 1e9},
    "without giving back energy": {"slack": 10.0},
    "energy kept exactly": {"keep_energy": True},
    "without the floor": {"floor": 1e-9},
    "AO as it is": {"smooth": False},
}
# Plain FLR's best width at a sample count is looked for among these, in pixels.
SIGMAS = (5, 8, 12, 16, 24, 40)


def adaptive(
    frame: Frame,
    parameters: AdaptiveParameters,
    smooth: bool = True,
    keep_energy: bool = False,
) -> jax.Array:
    """Adaptive FLR of one frame with normal, depth and AO. Returns `(H, W, 3)`."""
    normal, depth, ao = layers(frame, ("normal", "depth", "ao"))
    ao = smooth_guide(ao, normal, depth) if smooth else ao
    weight = None if frame.mask is None else jnp.asarray(frame.mask)[..., 0] > 0
    target = jnp.asarray(frame.indirect)
    guides = (normal, depth, ao)
    return flr_adaptive(target, guides, parameters, weight=weight, keep_energy=keep_energy)


compiled = jax.jit(adaptive, static_argnames=("smooth", "keep_energy"))


def variant(options: dict[str, Any]) -> Callable[[Frame], np.ndarray]:
    """A denoiser with one part switched off."""
    switches = {name: options[name] for name in ("smooth", "keep_energy") if name in options}
    numbers = {name: value for name, value in options.items() if name not in switches}
    parameters = ADAPTIVE_DEFAULT.but(**numbers)

    def call(frame: Frame) -> np.ndarray:
        needed = {name: None for name in ("reference", "reference_a", "albedo", "direct")}
        slim = dataclasses.replace(frame, **needed, emission=None, position=None, motion=None)  # type: ignore[arg-type]
        return np.asarray(compiled(slim, parameters, **switches))

    return call


def methods() -> dict[str, Callable[[Frame], np.ndarray]]:
    """Name to denoiser: plain FLR, the variants, and OIDN high where it is installed."""
    found: dict[str, Callable[[Frame], np.ndarray]] = {
        "flr": lambda frame: np.asarray(jflnr.denoise(frame))
    }
    for sigma in SIGMAS:
        parameters = DEFAULT._replace(log_sigma=float(np.log(sigma)))
        found[f"flr, sigma {sigma}"] = lambda frame, p=parameters: np.asarray(  # type: ignore[misc]
            jflnr.denoise(frame, parameters=p)
        )
    found["all parts"] = variant({})
    try:
        from experiments.peers import oidn
    except ImportError:
        print("  pyoidn is not installed: OIDN is left out.")
    else:
        for modulated, clean in ((False, True), (False, False), (True, True), (True, False)):
            name = f"OIDN high, {'' if modulated else 'de'}modulated"
            name += f", {'clean' if clean else 'noisy'} auxiliaries"
            found[name] = lambda frame, m=modulated, c=clean: oidn.denoise(  # type: ignore[misc]
                frame, clean=c, modulated=m
            )
    return found | {name: variant(options) for name, options in WITHOUT.items()}


def run(quick: bool) -> dict[str, Any]:
    """Quality, energy and processor time of every method on val and test frames."""
    paths = data.frames("val", "test")[: 1 if quick else None]
    rows = []
    for name, call in methods().items():
        call(jflnr.read_frame(paths[0]))  # compiles
        for spp in (1,) if quick else COUNTS:
            found = [one(path, spp, call) for path in paths if has(path, spp)]
            if found:
                rows.append({"method": name, "spp": spp, "frames": found, **means(found)})
                figures = {k: round(v, 4) for k, v in means(found).items()}
                print(f"  {name}, {spp} spp: {figures}", flush=True)
    return {"rows": rows}


def has(path: Path, spp: int) -> bool:
    """Whether the frame was rendered with that many samples."""
    try:
        jflnr.read_frame(path, spp=spp)
    except ValueError:
        return False
    return True


def one(path: Path, spp: int, call: Callable[[Frame], np.ndarray]) -> dict[str, Any]:
    """Everything measured on one frame."""
    frame = jflnr.read_frame(path, spp=spp)
    start = time.process_time()
    image = call(frame)
    seconds = time.process_time() - start
    inside = np.asarray(frame.mask)[..., 0] > 0
    weights = np.asarray(brightness(3, jnp.float32))
    before, after = (np.sum((np.asarray(a) @ weights)[inside]) for a in (frame.indirect, image))
    measured = measure(frame, image)
    row = {"frame": data.label(path), "energy": float(after / before), "seconds": seconds}
    return row | {name: measured[name] for name in METRICS}


def means(found: list[dict[str, Any]]) -> dict[str, float]:
    """Means over all frames and over the test frames, and the range of the energy."""
    test = [row for row in found if row["frame"].startswith("test")]
    result: dict[str, float] = {}
    for split, rows in (("test", test), ("ten", found)):
        for name in (*METRICS, "seconds"):
            values = [row[name] for row in rows if row[name] is not None]
            result[f"{split}_{name}"] = float(np.mean(values)) if values else float("nan")
    energies = [row["energy"] for row in found]
    return result | {"energy_low": min(energies), "energy_high": max(energies)}


def draw(result: dict[str, Any], folder: Path) -> None:
    """One Markdown table."""
    columns = {"method": "method", "spp": "spp"}
    columns |= {f"test_{name}": f"{name.upper()}, test" for name in METRICS}
    columns |= {f"ten_{name}": f"{name.upper()}, all" for name in METRICS}
    columns |= {"energy_low": "least energy", "energy_high": "most", "ten_seconds": "processor s"}
    table = results.table(result["rows"], columns)
    plots.write_text(folder / f"{NAME}.md", f"{table}\n{against_best_width(result['rows'])}")


def against_best_width(rows: list[dict[str, Any]]) -> str:
    """A table: adaptive FLR against plain FLR with the best sigma for that sample count."""
    found = []
    for spp in sorted({row["spp"] for row in rows}):
        of = {row["method"]: row for row in rows if row["spp"] == spp}
        best = max((f"flr, sigma {sigma}" for sigma in SIGMAS), key=lambda m: of[m]["ten_psnr"])
        gains = {
            ours["frame"]: ours["psnr"] - theirs["psnr"]
            for ours, theirs in zip(of["all parts"]["frames"], of[best]["frames"], strict=True)
        }
        worst = min(gains, key=lambda frame: gains[frame])
        found.append(
            {"spp": spp, "best": best, "mean": float(np.mean(list(gains.values())))}
            | {"worst": gains[worst], "frame": worst}
        )
    columns = {"spp": "spp", "best": "plain FLR at its best", "mean": "dB gained, all"}
    return results.table(found, columns | {"worst": "on the worst frame", "frame": "which"})
