"""Experiments that vary one thing over the same frames, as one table: `TABLE`."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import jflnr
from experiments import data, noise, plots, resume
from experiments.methods import Method, backends, basic, family, ours, peers
from experiments.peers import nfor, tikhonov
from experiments.results import Parts, Row, pivoted
from experiments.settings import flr_settings, oidn_settings
from experiments.timing import times
from experiments.tune import quick_psnr
from jflnr import metrics
from jflnr.frame import Array, Frame
from jflnr.images.guides import shrink


@dataclass(frozen=True)
class Case:
    """One row of a table: what tells it from others, who denoises, and what it is given.

    timed: milliseconds are taken too, on the first frame at one sample per pixel.
    """

    labels: Mapping[str, Any]
    method: Method
    read: Callable[[Path], Frame] = data.read
    timed: bool = False


def everything(frame: Frame, light: np.ndarray) -> Row:
    """All metrics, and the radiance of the result relative to the input's."""
    albedo, noisy = np.asarray(frame.albedo, np.float64), np.asarray(frame.indirect)[..., :3]
    energy = np.sum(albedo * light) / np.sum(albedo * noisy)
    return metrics.measure(frame, light) | {"energy": float(energy)}


def only_psnr(frame: Frame, light: np.ndarray) -> Row:
    """PSNR alone, which is quick."""
    return {"psnr": quick_psnr(frame, light)}


@dataclass(frozen=True)
class Sweep:
    """An experiment. cases: those that are quick come first."""

    NAME: str
    QUESTION: str
    MINUTES: int
    cases: Callable[[], Iterable[Case]]
    splits: tuple[str, ...] = ("test",)
    one_view_each: bool = False
    measure: Callable[[Frame, np.ndarray], Row] = only_psnr
    charts: Callable[[Parts, Path], None] | None = None

    def run(self, quick: bool) -> Parts:
        """Means over the frames of every case, split by split, and PSNR frame by frame."""
        cases = [*self.cases()][: 3 if quick else None]
        paths = [data.SHIPPED] if quick else self.frames()

        def on_frame(path: str) -> list[Row]:
            return [{"frame": data.label(Path(path))} | self._one(case, path) for case in cases]

        name = f"{self.NAME}{'-quick' * quick}"
        found = resume.rows(name, [str(path) for path in paths], on_frame)
        timed = [case.method for case in cases if case.timed]
        clock = times(timed, data.read(paths[0]), quick) if timed else {}
        means = [row for split in self._splits(paths) for row in _means(cases, found, split, clock)]
        frames = [
            row | {"case": _name(case)}
            for rows in found
            for case, row in zip(cases, rows, strict=True)
        ]
        return {"means": means, "PSNR by frame, dB": pivoted(frames, "case", "frame", "psnr")}

    def frames(self) -> list[Path]:
        """What all cases are measured on."""
        of = data.one_view_each if self.one_view_each else data.frames
        return [path for split in self.splits for path in of(split)]

    def _one(self, case: Case, path: str) -> Row:
        frame = case.read(Path(path))
        return self.measure(frame, case.method(frame))

    def _splits(self, paths: list[Path]) -> list[str]:
        return list(dict.fromkeys(path.parent.name for path in paths))


def _name(case: Case) -> str:
    return ", ".join(map(str, case.labels.values()))


def _means(
    cases: list[Case], found: list[list[Row]], split: str, clock: Mapping[str, float]
) -> list[Row]:
    means = []
    for number, case in enumerate(cases):
        rows = [rows[number] for rows in found if rows[number]["frame"].startswith(f"{split}/")]
        keys = [key for key, value in rows[0].items() if isinstance(value, float)]
        mean = {key: float(np.mean([row[key] for row in rows])) for key in keys}
        clocked = {"ms": clock[case.method.name]} if case.timed else {}
        means.append({**case.labels, "split": split, **mean, **clocked})
    return means


def method(name: str, **options: Any) -> Method:
    """`jflnr.denoise` with options."""
    return Method(name, "jflnr", jflnr.denoise, options, options.get("backend", "jax") == "jax")


def named(methods: Iterable[Method], **options: Any) -> list[Case]:
    """A case for each method."""
    return [Case({"method": m.name}, m, **options) for m in methods]


def _methods() -> list[Case]:
    without = method("flr, no ao", guides=("normal", "depth"))
    return named(basic()) + named([*ours(), without, *peers()], timed=True)


def _settings() -> list[Case]:
    general = [m for m in peers() if m.family != "OIDN"]
    return named([*ours(), *flr_settings(), *general, *oidn_settings()], timed=True)


def flr_of_sigma(sigma: float) -> Method:
    """FLR with another window."""
    return method(f"flr, sigma {sigma:g}", sigma=float(sigma))


# Independent streams of the files that together make so many samples per pixel.
STREAMS = {1: (1,), 4: (4,), 5: (1, 4), 16: (16,), 20: (4, 16)}
COUNTS = (1, 2, 4, 8, 16, 32, 64)
CORRECTED = ("flr-adaptive", "flnr-small", "flnr")
PEERS = ("guided filter, tuned", "SVGF, spatial, tuned", "BMFR, one frame, tuned", "OIDN, tuned")


def _spp() -> list[Case]:
    some = [m for m in [*basic()[:1], *peers()] if m.name in ("noisy", *PEERS)]
    some += [method(name, method=name) for name in jflnr.METHODS]
    some += [flr_of_sigma(sigma) for sigma in (6.0, 8.0, 11.0, 15.0)]
    cases = []
    for spp, streams in STREAMS.items():
        read = functools.partial(_of_streams, streams=streams)
        cases += [
            Case({"method": m.name, "spp": spp, "noise": "of the file"}, m, read) for m in some
        ]
        if len(streams) == 2:
            halves = Method("NFOR", "NFOR", nfor_of, {"streams": streams}, False)
            read = functools.partial(_halves, streams=streams)
            cases.append(Case({"method": "NFOR", "spp": spp, "noise": "of the file"}, halves, read))
    for spp in COUNTS:
        read = functools.partial(_rendered, spp=spp)
        cases += [
            Case({"method": m.name, "spp": spp, "noise": "rendered here"}, m, read) for m in some
        ]
    return cases


def _of_streams(path: Path, streams: tuple[int, ...]) -> Frame:
    return data.read(path, *streams)


def _halves(path: Path, streams: tuple[int, ...]) -> Frame:
    """The frame with both streams side by side as its light, `(H, W, 6)`."""
    lights = [np.asarray(data.read(path, spp).indirect) for spp in streams]
    return data.but(data.read(path), indirect=np.concatenate(lights, axis=-1))


def nfor_of(frame: Frame, *, streams: tuple[int, int]) -> Array:
    """NFOR of a frame as `_halves` reads it."""
    light = np.asarray(frame.indirect)
    halves = ((light[..., :3], streams[0]), (light[..., 3:], streams[1]))
    return nfor.denoise(frame, halves=halves, **nfor.PAPER)


def _network() -> list[Case]:
    some = [method(name, method=name, backend="opencl") for name in CORRECTED]
    some += [m for m in peers() if m.name == "OIDN, tuned"]
    return [
        Case({"method": m.name, "spp": spp}, m, functools.partial(_of_streams, streams=(spp,)))
        for spp in (1, 4, 16)
        for m in some
    ]


def _rendered(path: Path, spp: int) -> Frame:
    """Noise of our renderer, and no light on lamps: the files store some there, it none."""
    frame = data.read(path)
    frame = data.but(frame, indirect=noise.layers(path, (spp,))[f"indirect_{spp}"])
    dark = ~np.any(np.asarray(frame.emission) > 0, axis=-1, keepdims=True)
    lights = {name: getattr(frame, name) for name in ("indirect", "reference", "reference_a")}
    return data.but(frame, **{name: a * dark for name, a in lights.items() if a is not None})


def _block() -> list[Case]:
    sizes = (1, 8, 2, 4, 16, 32)
    cases = [
        Case({"way": "moments", "block": size}, method(f"block {size}", block=size), timed=True)
        for size in sizes
    ]
    # At 32 the smaller inputs no longer tell their factor: 360 / 32 is not whole.
    for way, smaller in (("mean", traced_at), ("nearest", every_nth)):
        for size in sizes[1:-1]:
            read = functools.partial(_smaller, smaller=smaller, factor=size)
            cases.append(Case({"way": way, "block": size}, method(way, block=size), read))
    return cases


def _smaller(path: Path, smaller: Callable[[Frame, int], Frame], factor: int) -> Frame:
    return smaller(data.read(path), factor)


def traced_at(frame: Frame, factor: int) -> Frame:
    """The frame with its noisy light at 1/factor of the resolution.

    A pixel is the mean of the samples over its area: factor^2 times as many for each.
    """
    if factor == 1:
        return frame
    return data.but(frame, indirect=np.asarray(shrink(frame.indirect, factor, frame.mask)))


def every_nth(frame: Frame, factor: int) -> Frame:
    """The frame with the light of every `factor`-th pixel."""
    return data.but(frame, indirect=np.asarray(frame.indirect)[::factor, ::factor])


def _upsample() -> list[Case]:
    cases, names = [], ("flr", "flr-adaptive", "auto")
    for name, rays, factor in itertools.product(names, (1, 4, 16), (1, 2, 4)):
        labels = {"method": name, "rays": rays, "factor": factor}
        stored = functools.partial(traced_at, factor=factor)
        options = {"method": name, "backend": "opencl"}
        timed = Method(f"{name} 1/{factor}", "jflnr", jflnr.denoise, options, False, stored)
        cases.append(Case(labels, timed, functools.partial(_of_streams, streams=(rays,)), True))
    return cases


# In the order in which each raises the PSNR over val most.
GUIDES = ("normal", "position", "depth", "albedo", "ao")
LEFT_OUT = ("normal", "depth", "ao")


def _guides() -> list[Case]:
    sets = [GUIDES[: n + 1] for n in range(len(GUIDES))]
    sets += [(name,) for name in GUIDES[1:]] + [("normal", name) for name in GUIDES[2:]]
    cases = [
        Case({"method": "flr", "guides": "+".join(names)}, method("+".join(names), guides=names))
        for names in sets
    ]
    for name in ("flr", "flr-adaptive", "flnr"):
        for missing in LEFT_OUT:
            labels = {"method": name, "guides": f"all but {missing}"}
            read = functools.partial(_without, name=missing)
            cases.append(Case(labels, method(name, method=name), read))
    return cases


def _without(path: Path, name: str) -> Frame:
    """The frame with one guide the same everywhere: FLNR always takes all three."""
    frame = data.read(path)
    layer = np.asarray(getattr(frame, name))
    same = np.broadcast_to(np.mean(layer, axis=(0, 1), dtype=layer.dtype), layer.shape)
    return data.but(frame, **{name: np.ascontiguousarray(same)})


def _lightgroups() -> list[Case]:
    return [
        Case(
            {"backend": backend, "groups": count},
            Method(
                f"{backend} {count}",
                "jflnr",
                summed,
                {"backend": backend},
                False,
                functools.partial(grouped, count=count),
            ),
            timed=True,
        )
        for backend in backends()
        for count in (1, 2, 3, 4, 5, 6, 8)
    ]


def grouped(frame: Frame, count: int) -> Frame:
    """The light split at random, pixel by pixel, into `count` groups that sum to it."""
    light = np.asarray(frame.indirect)
    shares = np.random.default_rng(0).dirichlet(np.ones(count), light.shape[:2])
    parts = light[:, :, None, :] * shares[..., None].astype(np.float32)
    return data.but(frame, indirect=parts.reshape(*light.shape[:2], 3 * count))


def summed(frame: Frame, *, backend: str) -> np.ndarray:
    """The sum of the denoised groups."""
    found = np.asarray(jflnr.denoise(frame, backend=backend))
    return found.reshape(*found.shape[:2], -1, 3).sum(axis=2)


# Settings that switch one part of adaptive FLR off.
WITHOUT: dict[str, dict[str, Any]] = {
    "all parts": {},
    "without weights": {"exponent": 1e-6},
    "without edge-aware windows": {"guide_scale": 1e-6, "brightness_scale": 1e-6},
    "without the brightness edge": {"brightness_scale": 1e-6},
    "without the noise ridge": {"noise_ridge": 1e-9},
    "without slopes in position": {"position_ridge": 1e9},
    "without caution: finest width only": {"caution": 1e-9},
    "only the widest": {"caution": 1e9},
    "without giving back energy": {"slack": 10.0},
    "without the floor": {"floor": 1e-9},
}


def _ablation() -> list[Case]:
    methods = [method(name, method="flr-adaptive", **numbers) for name, numbers in WITHOUT.items()]
    exact = method("energy kept exactly", method="flr-adaptive", keep_energy=True)
    methods += [exact, method("flr"), *map(flr_of_sigma, (5, 8, 12, 16, 24, 40)), *oidn_settings()]
    cases = []
    for spp in (1, 4, 16):
        read = functools.partial(_of_streams, streams=(spp,))
        cases += [Case({"method": m.name, "spp": spp}, m, read, spp == 1) for m in methods]
    return cases


def _regularisation() -> list[Case]:
    values = [10.0**p for p in range(-8, 1)]
    cases = []
    for eps in values:
        for prime in values:
            labels = {"form": "normalised", "eps": eps, "eps_prime": prime}
            cases.append(Case(labels, method("flr", eps=eps, eps_prime=prime)))
        plain = Method("Tikhonov", "Tikhonov", tikhonov.denoise, {"eps": eps})
        cases.append(Case({"form": "Tikhonov", "eps": eps, "eps_prime": 0.0}, plain))
    return cases


def _scatter(parts: Parts, folder: Path) -> None:
    rows = [row for row in parts["means"] if "ms" in row]
    rows = [row | {"family": family(row["method"])} for row in rows]
    plots.scatter(folder / "settings.png", rows)


# Of the table, not in the chart: far below it, or on top of another line.
HIDDEN = ("noisy", "bmfr", "flnr-small")


def _by_spp(parts: Parts, folder: Path) -> None:
    of_file = [row for row in parts["means"] if row.get("noise") != "rendered here"]
    rows = [row for row in of_file if row["method"] not in HIDDEN]
    plots.lines(folder / "spp.png", rows, x="spp", y=("psnr", "flip"), by="method")


def _by_block(parts: Parts, folder: Path) -> None:
    plots.lines(folder / "block.png", parts["means"], x="block", y=("psnr", "ms"), by="way")


_SWEEPS = (
    Sweep(
        "methods",
        "How does every method do at one sample per pixel, in all metrics and in time?",
        5,
        _methods,
        measure=everything,
    ),
    Sweep(
        "settings",
        "Which method and setting is the most accurate in a given time?",
        4,
        _settings,
        charts=_scatter,
    ),
    Sweep(
        "spp",
        "How does each method gain from more samples per pixel?",
        18,
        _spp,
        one_view_each=True,
        measure=everything,
        charts=_by_spp,
    ),
    Sweep(
        "network",
        "What does the network bring over adaptive FLR, at 1, 4 and 16 samples per pixel?",
        3,
        _network,
        measure=everything,
    ),
    Sweep(
        "block",
        "Is there 'no discernible loss' at blocks of 8 x 8, and may the inputs shrink instead?",
        2,
        _block,
        charts=_by_block,
    ),
    Sweep(
        "upsample",
        "For the same rays, is light traced at 1/2 or 1/4 resolution as good?",
        1,
        _upsample,
    ),
    Sweep("guides", "Which guides matter for FLR and FLNR?", 3, _guides, ("val", "test")),
    Sweep(
        "lightgroups",
        "What do further light groups cost, and do they still sum to the whole?",
        1,
        _lightgroups,
    ),
    Sweep(
        "ablation",
        "What does each part of adaptive FLR bring, in quality, energy and time?",
        10,
        _ablation,
        ("val", "test"),
        measure=everything,
    ),
    Sweep(
        "regularisation",
        "How does accuracy depend on eps and eps', and is Tikhonov as good?",
        2,
        _regularisation,
        ("val",),
    ),
)
TABLE = {sweep.NAME: sweep for sweep in _SWEEPS}
