"""Every option of `jflnr denoise` on both back ends: frames by themselves, in pieces, over time.

They give the same files, or one sentence says what cannot be.
"""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from jflnr import exr
from jflnr.cli import main, parser
from jflnr.frame import Frame, write_frame
from jflnr.large import memory
from jflnr.opencl import NoDevice, all_devices
from jflnr.parameters import save_parameters
from jflnr.regression.flr import FLR

ROWS: dict[str, list[str]] = {
    "--spp": ["--spp", "1"],
    "--map": ["--map", "ao=emission.G"],
    "--method": ["--method", "flr"],
    "--explain": ["--method", "auto", "--explain"],
    "--worth": ["--method", "auto", "--worth", "0.3"],
    "--guides": ["--guides", "normal"],
    "--params": ["--params", "fitted.json"],
    "--sigma": ["--sigma", "3"],
    "--eps": ["--eps", "0.1"],
    "--eps-prime": ["--eps-prime", "0.1"],
    "--block": ["--block", "4"],
    "--error-map": ["--error-map", "--method", "flr-adaptive"],
    "--lobes": ["--lobes"],
    "--history": ["--history", "history.npz"],
    "--png": ["--png"],
    "--jpeg": ["--jpeg"],
    "--channels": ["--channels", "all"],
    "--reference": ["--reference"],
    "--fail-below": ["--fail-below", "-9"],
    "--overwrite": ["--overwrite"],
    "--json": ["--json"],
    "--log": ["--log", "log.txt"],
    "--profile": ["--profile"],
    "--memory": ["--memory", "9G"],
    "--quiet": ["--quiet"],
    "--verbose": ["--verbose"],
}
# What is the subject of every row, of tests/cli/test_streams.py, or of tests/large.
ELSEWHERE = {
    *("--help", "--output", "--backend", "--temporal"),
    *("--hdr", "--alb", "--nrm", "--cluster"),
}
HOW = ("alone", "pieces", "over time")
WHOLE = "needs the whole frame in memory"
ALONE = "is for frames by themselves, not shots"
KEPT = "--history keeps what the jax backend remembers"
KERNELS = "--profile times OpenCL kernels"
# Of (option, how, backend), None standing for any, the sentence that refuses.
REFUSED: dict[tuple[str, str | None, str | None], str] = {
    ("--lobes", "alone", None): "--lobes is for pictures of other programs",
    ("--profile", None, "jax"): KERNELS,
    ("--history", None, "opencl"): KEPT,
    ("--history", "pieces", "jax"): "a shot needs whole frames in memory",
    **{
        (f"--{option}", "over time", None): ALONE
        for option in ("error-map", "explain", "lobes", "profile")
    },
    **{
        (f"--{option}", "pieces", None): WHOLE
        for option in (
            "channels",
            "explain",
            "fail-below",
            "jpeg",
            "lobes",
            "png",
            "profile",
            "reference",
        )
    },
    ("--error-map", "pieces", "opencl"): WHOLE,
    ("--worth", "pieces", "opencl"): WHOLE,
}


def refusal(option: str, how: str, backend: str) -> str | None:
    found = [
        sentence
        for (a, b, c), sentence in REFUSED.items()
        if a == option and b in (how, None) and c in (backend, None)
    ]
    return found[0] if found else None


@pytest.fixture(scope="module")
def device() -> None:
    try:
        all_devices()
    except NoDevice as error:
        pytest.skip(str(error))


@pytest.fixture
def shot(tmp_path: Path, frame: Frame, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two frames, in a folder where the files of the options lie."""
    monkeypatch.chdir(tmp_path)
    save_parameters("fitted.json", FLR(6, 1e-3, 1e-3), block=4)
    Path("shot").mkdir()
    rng = np.random.default_rng(2)
    for i in range(2):
        light = frame.reference * rng.exponential(size=frame.indirect.shape).astype(np.float32)
        write_frame(f"shot/{i}.exr", dataclasses.replace(frame, indirect=light))
    return tmp_path


def outputs(folder: Path) -> dict[str, Any]:
    """By name, the channels of pictures; of other files that they are there."""
    return {
        path.name: exr.read_channels(path) if path.suffix == ".exr" else None
        for path in sorted(folder.iterdir())
    }


def check_same(ours: dict[str, Any], right: dict[str, Any], share: float) -> None:
    assert ours.keys() == right.keys()
    for name, channels in right.items():
        for channel, image in (channels or {}).items():
            most = share * np.abs(image).max()
            np.testing.assert_allclose(ours[name][channel], image, atol=most, rtol=0)


def test_the_table_has_every_option() -> None:
    (commands,) = (action for action in parser()._actions if isinstance(action.choices, dict))
    actions = commands.choices["denoise"]._actions
    options = {action.option_strings[-1] for action in actions if action.option_strings}
    assert options == ROWS.keys() | ELSEWHERE


@pytest.mark.usefixtures("device")
@pytest.mark.parametrize("option", ROWS)
def test_an_option_everywhere(
    option: str, shot: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    found = {}
    for how in HOW:
        if how == "pieces":
            monkeypatch.setattr(memory, "tile_for", lambda *_: 16)
            monkeypatch.setattr(memory, "holds", lambda *_: False)
        for backend in ("jax", "opencl"):
            out = shot / f"{how} {backend}"
            chosen = [*ROWS[option], *(["--temporal"] if how == "over time" else [])]
            code = main(["denoise", "shot", "-o", str(out), "--backend", backend, *chosen])
            said = capfd.readouterr().err
            assert "Traceback" not in said
            if (sentence := refusal(option, how, backend)) is None:
                assert code == 0, said
                found[how, backend] = outputs(out)
            else:
                assert code == 2 and sentence in said
                assert not out.exists() or not outputs(out)
        monkeypatch.undo()
        monkeypatch.chdir(shot)
        Path("history.npz").unlink(missing_ok=True)
    for (how, backend), given in found.items():
        if backend == "opencl" and (how, "jax") in found:
            check_same(given, found[how, "jax"], 2e-3)
        if how == "pieces" and ("alone", backend) in found:
            check_same(given, found["alone", backend], 1e-4)
