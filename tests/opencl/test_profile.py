"""What is reported about devices and times."""

import importlib.util
import json
import sys
from pathlib import Path

import numpy as np
import pytest

import jflnr
from jflnr.cli import main
from jflnr.images.guides import DEFAULT, layers
from jflnr.images.noisy_guides import smooth_guide
from jflnr.opencl import Context, kept
from jflnr.opencl.adaptive import flr_adaptive
from jflnr.opencl.flr import flr
from jflnr.opencl.profile import profile
from jflnr.regression.adaptive import AdaptiveFLR
from tests.opencl import tolerances
from tests.opencl.conftest import PARAMETERS, error, scene


def test_every_kernel_has_a_row(context: Context) -> None:
    target, guides = scene(61, 203, 5, 3)
    rows = {
        row.kernel: row
        for row in profile(
            context, lambda: flr(target, guides, PARAMETERS, context=context), repeats=2
        )
    }
    kernels = ["centre_rows", "centre", "moments", "blur_columns", "blur_rows", "solve", "apply"]
    assert list(rows) == [*kernels, "all kernels", "copy"]
    assert all(row.ms >= 0 and row.bytes > 0 for row in rows.values())
    assert rows["copy"].share == 1
    # Every byte of the frame is counted once: target and guides in, moments out, and the shift.
    h, pitch = 8, -(-26 // context.width()) * context.width()
    moments = 39 * h * pitch * 4
    assert rows["moments"].bytes == target.nbytes + guides.nbytes + moments + 5 * 4


def test_doctor(context: Context, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor"]) == 0
    text = capsys.readouterr().out
    assert context.device.name.strip() in text and str(kept.folder()) in text
    assert main(["doctor", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert [row["one frame by"] for row in facts["frame"]] == ["jax", "opencl"]
    kept_bytes = {row["folder"]: row["bytes"] for row in facts["caches"]}[str(kept.folder())]
    assert kept_bytes == sum(path.stat().st_size for path in kept.folder().iterdir())


def test_doctor_says_what_is_missing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "pyopencl", None)
    monkeypatch.setattr(importlib.util, "find_spec", lambda module: None)
    assert main(["doctor"]) == 0
    text = capsys.readouterr().out
    for package in ("jflnr[opencl]", "jflnr[large]", "jflnr[cluster]", "flip-evaluator"):
        assert f"pip install '{package}'" in text


def test_denoise_backend(
    context: Context, frame: jflnr.Frame, frame_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["denoise", str(frame_file), "-o", str(frame_file.with_name("out.exr"))]
    assert main([*command, "--profile"]) == 0
    assert "blur_columns" in capsys.readouterr().out
    assert main([*command, "--backend", "jax", "--profile", "--overwrite"]) == 2
    assert "--backend opencl" in capsys.readouterr().err
    by_jax, by_opencl = (
        np.asarray(jflnr.denoise(frame, backend=name)) for name in ("jax", "opencl")
    )
    assert error(by_opencl, by_jax) < tolerances.WHOLE


def test_denoise_adaptive_backend(context: Context, frame: jflnr.Frame) -> None:
    """What `denoise` hands to the kernels: smooth occlusion, the mask, and the option."""
    normal, depth, ao = layers(frame, DEFAULT)
    smooth = np.asarray(smooth_guide(ao, frame.normal, frame.depth))
    weight = None if frame.mask is None else np.asarray(frame.mask)[..., 0] > 0
    for keep_energy in (False, True):
        right = flr_adaptive(
            frame.indirect,
            (normal, depth, smooth),
            AdaptiveFLR(),
            weight=weight,
            keep_energy=keep_energy,
            context=context,
        )
        found = jflnr.denoise(frame, "flr-adaptive", backend="opencl", keep_energy=keep_energy)
        assert error(np.asarray(found), right) < tolerances.ADAPTIVE
