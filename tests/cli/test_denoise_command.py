"""`jflnr denoise`: what it writes, keeps, reports and leaves behind.

Most tests put a stand-in for the denoiser, which takes seconds to compile.
"""

import dataclasses
import json
import os
import pty
import select
import shutil
import signal
import subprocess
import sys
import termios
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from jflnr import denoising, exr, metrics
from jflnr.cli import main
from jflnr.cli.jobs import plan
from jflnr.frame import Frame, composite, read_frame, read_header, write_frame
from jflnr.metrics import exposure
from jflnr.network.weights import FOLDER, shipped
from jflnr.opencl import ahead
from jflnr.parameters import save_parameters
from jflnr.regression.adaptive import AdaptiveFLR
from jflnr.regression.flr import FLR


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> list[dict]:
    """A denoiser that halves the light; the list receives what it was called with."""
    calls: list[dict] = []

    def denoise(self: denoising.Denoiser, frame: Frame) -> np.ndarray:
        settings = {"method": self.method_for(frame), "backend": self.backend}
        calls.append(settings | {"guides": self.guides})
        return 0.5 * np.asarray(frame.indirect)

    monkeypatch.setattr(denoising.Denoiser, "__call__", denoise)
    monkeypatch.setattr(ahead, "compile_ahead", lambda *_: None)
    return calls


@pytest.fixture
def folder(tmp_path: Path, frame_file: Path) -> Path:
    """Three frames: good, damaged, good."""
    path = tmp_path / "frames"
    path.mkdir()
    for name in ("a.exr", "b.exr", "c.exr"):
        shutil.copy(frame_file, path / name)
    (path / "b.exr").write_bytes(frame_file.read_bytes()[:2000])
    (path / "notes.txt").write_text("not a frame")
    return path


def run(*argv: object) -> int:
    return main(["denoise", *map(str, argv)])


def files(path: Path) -> list[str]:
    """Everything in the folder, hidden files included."""
    return sorted(p.name for p in path.iterdir())


@pytest.mark.usefixtures("stand_in")
def test_output_holds_light_picture_and_header(tmp_path: Path, frame_file: Path) -> None:
    assert run(frame_file, "-o", tmp_path / "new" / "out.exr", "--sigma", "12") == 0
    frame = read_frame(frame_file)
    channels = exr.read_channels(tmp_path / "new" / "out.exr")
    picture = composite(frame, 0.5 * frame.indirect)
    for i, c in enumerate("RGB"):
        np.testing.assert_array_equal(channels[f"indirect.{c}"], 0.5 * frame.indirect[..., i])
        np.testing.assert_array_equal(channels[c], picture[..., i])
    assert len(channels) == 6
    header = read_header(tmp_path / "new" / "out.exr")
    assert header["scene"] == "made up"
    assert header["denoiser"]["method"] == "flr"
    assert header["denoiser"]["sigma"] == pytest.approx(12)
    assert header["denoiser"]["guides"] == ["normal", "depth", "ao"]
    assert files(tmp_path / "new") == ["out.exr"]


@pytest.mark.usefixtures("stand_in")
def test_there_is_no_light_where_there_is_no_surface(tmp_path: Path, frame: Frame) -> None:
    mask = np.float32(np.arange(24) > 5)[:, None, None] * np.ones((24, 40, 1), np.float32)
    write_frame(tmp_path / "in.exr", dataclasses.replace(frame, mask=mask))
    assert run(tmp_path / "in.exr", "-o", tmp_path / "out.exr") == 0
    light = exr.read_channels(tmp_path / "out.exr")["indirect.G"]
    np.testing.assert_array_equal(light, 0.5 * frame.indirect[..., 1] * mask[..., 0])


@pytest.mark.usefixtures("stand_in")
def test_data_window_is_kept(tmp_path: Path, frame_file: Path) -> None:
    window = exr.Window(origin=(8, 2), display=(0, 0, 99, 49))
    exr.write_channels(frame_file, exr.read_channels(frame_file), window=window)
    assert run(frame_file, "-o", tmp_path / "out.exr") == 0
    assert exr.read_attributes(tmp_path / "out.exr").window == window


def test_options_reach_the_denoiser(tmp_path: Path, frame_file: Path, stand_in: list[dict]) -> None:
    """Options go over the file given by --params, that over the defaults."""
    params = tmp_path / "p.json"
    fitted = {"format": "jflnr-parameters", "version": 1, "sigma": 5, "eps": 1e-2}
    params.write_text(json.dumps(fitted | {"eps_prime": 1e-3, "block": 4, "guides": ["depth"]}))
    out = ("-o", tmp_path / "out.exr", "--overwrite")
    assert run(frame_file, *out, "--backend", "jax") == 0
    assert run(frame_file, *out, "--params", params) == 0
    assert run(frame_file, *out, "--params", params, "--eps", "0.5", "--guides", "normal,ao") == 0
    assert run(frame_file, *out, "--block", "2", "--guides", "") == 0
    default, from_file, mixed, bare = stand_in[::2]  # once to compile, once to take the time
    assert default == {"method": FLR(), "backend": "jax", "guides": None}
    assert from_file["method"] == FLR(5, 1e-2, 1e-3, block=4)
    assert from_file["guides"] == ["depth"]
    assert mixed["method"] == FLR(5, 0.5, 1e-3, block=4)
    assert mixed["guides"] == ("normal", "ao")
    assert (bare["method"], bare["guides"]) == (FLR(block=2), ())


def test_weights_of_ones_own_reach_the_denoiser(
    tmp_path: Path, frame_file: Path, stand_in: list[dict]
) -> None:
    weights = FOLDER / "flnr.npz"
    assert run(frame_file, "-o", tmp_path / "o.exr", "--method", "flnr", "--params", weights) == 0
    assert stand_in[0]["method"].params.keys() == shipped("flnr").keys()


@pytest.mark.usefixtures("stand_in")
def test_only_the_picture(tmp_path: Path, frame_file: Path) -> None:
    assert run(frame_file, "-o", tmp_path / "out.exr", "--channels", "picture") == 0
    assert set(exr.read_channels(tmp_path / "out.exr")) == set("RGB")


@pytest.mark.usefixtures("stand_in")
def test_quiet_prints_errors_only(
    tmp_path: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(folder, "-o", tmp_path / "out", "--quiet") == 3
    streams = capsys.readouterr()
    assert streams.out == ""
    assert streams.err.count("\n") == 1 and "b.exr is truncated" in streams.err


@pytest.mark.usefixtures("stand_in")
def test_verbose_says_how_the_file_was_read(
    tmp_path: Path, frame_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = (frame_file, "-o", tmp_path / "out.exr", "--verbose", "--backend", "jax")
    assert run(*command) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1:] == ["  layout: jflnr", "  backend: jax", "  guides: normal, depth, ao"]


@pytest.mark.usefixtures("stand_in")
def test_preview_shows_the_picture(tmp_path: Path, frame_file: Path) -> None:
    assert run(frame_file, "-o", tmp_path / "out.exr", "--png") == 0
    frame = read_frame(frame_file)
    light = 0.5 * frame.indirect
    scale = exposure(composite(dataclasses.replace(frame, emission=None), light))
    expected = 255 * np.clip(composite(frame, light) * scale, 0, 1) ** (1 / 2.2)
    shown = np.asarray(Image.open(tmp_path / "out.png"))
    assert shown.shape == (24, 40, 3)
    assert np.abs(shown - expected).max() <= 0.51


@pytest.mark.usefixtures("stand_in")
def test_a_preview_in_jpeg_is_as_bright(tmp_path: Path, frame_file: Path) -> None:
    assert run(frame_file, "-o", tmp_path / "out.exr", "--png", "--jpeg") == 0
    png, jpeg = (
        np.float32(Image.open(tmp_path / f"out{s}").convert("L")) for s in (".png", ".jpg")
    )
    assert jpeg.shape == (24, 40) and np.abs(jpeg - png).mean() < 3


@pytest.mark.usefixtures("stand_in")
def test_reference_prints_metrics_before_and_after(
    tmp_path: Path, frame_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(frame_file, "-o", tmp_path / "out.exr", "--reference", "--json") == 0
    (record,) = json.loads(capsys.readouterr().out)
    frame = read_frame(frame_file)
    assert record["metrics"] == {
        "noisy": metrics.measure(frame, frame.indirect),
        "denoised": metrics.measure(frame, 0.5 * frame.indirect),
    }
    assert run(frame_file, "-o", tmp_path / "out.exr", "--reference", "--overwrite") == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[1:]] == ["PSNR", "noisy", "denoised"]


@pytest.mark.usefixtures("stand_in")
def test_reference_is_asked_for_before_work(
    tmp_path: Path, frame: Frame, capsys: pytest.CaptureFixture[str]
) -> None:
    write_frame(tmp_path / "a.exr", dataclasses.replace(frame, reference=None))
    assert run(tmp_path / "a.exr", "-o", tmp_path / "out.exr", "--reference") == 2
    assert "--reference needs a layer reference" in capsys.readouterr().err
    assert files(tmp_path) == ["a.exr"]


def test_outputs_are_kept_unless_overwritten(
    tmp_path: Path, frame_file: Path, stand_in: list[dict], capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out.exr"
    out.write_bytes(b"precious")
    assert run(frame_file, "-o", out) == 0
    assert f"{out} kept as it is; --overwrite replaces it" in capsys.readouterr().out
    assert run(frame_file, "-o", out, "--json") == 0
    (record,) = json.loads(capsys.readouterr().out)
    assert (record["status"], record["kept"]) == ("kept", [str(out)])
    assert out.read_bytes() == b"precious" and not stand_in
    assert run(frame_file, "-o", out, "--overwrite") == 0
    assert "indirect.R" in exr.read_channels(out)


def test_an_existing_preview_is_kept_too(
    tmp_path: Path, frame_file: Path, stand_in: list[dict]
) -> None:
    (tmp_path / "out.png").write_bytes(b"precious")
    assert run(frame_file, "-o", tmp_path / "out.exr", "--png") == 0
    assert (tmp_path / "out.png").read_bytes() == b"precious"
    assert "indirect.R" in exr.read_channels(tmp_path / "out.exr")


@pytest.mark.usefixtures("stand_in")
def test_a_frame_is_done_when_all_that_was_asked_for_is_there(
    tmp_path: Path, frame_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The EXR comes first; what a run could not write, the next one does."""

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    out = tmp_path / "out.exr"
    with monkeypatch.context() as patch:
        patch.setattr(exr, "write_channels", full)
        assert run(frame_file, "-o", out, "--png") == 2
        assert files(tmp_path) == [frame_file.name]
    with monkeypatch.context() as patch:
        patch.setattr("PIL.Image.Image.save", full)
        assert run(frame_file, "-o", out, "--png") == 2
        assert files(tmp_path) == [frame_file.name, "out.exr"]
    written = out.read_bytes()
    assert run(frame_file, "-o", out, "--png") == 0
    assert out.with_suffix(".png").stat().st_size and out.read_bytes() == written


@pytest.mark.usefixtures("stand_in")
def test_one_failing_frame_does_not_stop_the_others(
    tmp_path: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(folder, "-o", tmp_path / "out") == 3
    streams = capsys.readouterr()
    assert files(tmp_path / "out") == ["a.exr", "c.exr"]
    assert (
        streams.err == f"jflnr: {folder}/b.exr is truncated or damaged: its pixels cannot be read\n"
    )
    assert [line.split(" -> ")[0] for line in streams.out.splitlines()] == [
        f"{folder}/a.exr",
        f"{folder}/c.exr",
    ]


@pytest.mark.usefixtures("stand_in")
def test_json_holds_every_frame(
    tmp_path: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(folder, "-o", tmp_path / "out", "--json") == 3
    records = json.loads(capsys.readouterr().out)
    assert [record["status"] for record in records] == ["written", "failed", "written"]
    assert "truncated" in records[1]["error"]
    assert records[0]["seconds"] > 0


def test_compiling_is_told_apart_once_per_size(
    tmp_path: Path, folder: Path, stand_in: list[dict], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(folder / "a.exr", folder / "c.exr", "-o", tmp_path / "out", "--json") == 0
    first, second = json.loads(capsys.readouterr().out)
    assert first["compile_seconds"] > 0 and second["compile_seconds"] == 0
    assert len(stand_in) == 3


@pytest.mark.usefixtures("stand_in")
def test_pixels_that_are_not_finite_are_reported(
    tmp_path: Path, frame: Frame, capsys: pytest.CaptureFixture[str]
) -> None:
    indirect = frame.indirect.copy()
    indirect[:2, :3] = np.nan
    write_frame(tmp_path / "a.exr", dataclasses.replace(frame, indirect=indirect))
    assert run(tmp_path / "a.exr", "-o", tmp_path / "out.exr") == 0
    assert "warning" in (error := capsys.readouterr().err) and "6 of indirect" in error


@pytest.mark.usefixtures("stand_in")
def test_frames_of_too_little_psnr_fail(
    tmp_path: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Against the reference of each, which is here that of another file."""
    (folder / "b.exr").unlink()
    frame = read_frame(folder / "a.exr")
    exact = dataclasses.replace(frame, reference=0.5 * frame.indirect)
    write_frame(tmp_path / "c_reference.exr", exact)
    write_frame(tmp_path / "a_reference.exr", frame)
    reference = "reference=../{stem}_reference.exr:reference"
    command = folder, "-o", tmp_path / "out", "--map", reference, "--fail-below", 60
    assert run(*command, "--json", "--log", tmp_path / "log.txt") == 3
    poor, good = json.loads(capsys.readouterr().out)
    assert "its PSNR of" in poor["error"]
    assert good["metrics"]["denoised"]["psnr"] is None  # infinite
    assert files(tmp_path / "out") == ["c.exr"]
    assert run(*command, "--log", tmp_path / "log.txt") == 3
    log = (tmp_path / "log.txt").read_text()
    lines = [line for line in log.splitlines() if line.startswith("20")]
    assert all(datetime.fromisoformat(line[:19]) for line in lines)
    assert ["its PSNR of" in line for line in lines] == [True, False, True, False]
    assert " -> " in lines[1] and "c.exr kept as it is" in lines[3]
    assert run(folder / "a.exr", *command[1:], "--quiet") == 2


@pytest.mark.usefixtures("stand_in")
def test_a_bound_of_no_decibels_is_one(
    tmp_path: Path, frame: Frame, capsys: pytest.CaptureFixture[str]
) -> None:
    poor = dataclasses.replace(frame, reference=1e4 * frame.indirect)
    write_frame(tmp_path / "a.exr", poor)
    exact = dataclasses.replace(frame, reference=frame.indirect)
    write_frame(tmp_path / "b.exr", exact)
    command = tmp_path / "a.exr", tmp_path / "b.exr", "-o", tmp_path / "out", "--fail-below"
    assert run(*command, 0, "--json") in (0, 3)
    assert all("metrics" in r for r in json.loads(capsys.readouterr().out) if "error" not in r)
    for value in ("nan", "inf"):
        with pytest.raises(SystemExit) as left:
            run(*command, value)
        assert left.value.code == 2


@pytest.mark.usefixtures("stand_in")
def test_what_many_frames_have_is_said_once(
    tmp_path: Path, frame: Frame, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "in").mkdir()
    for i in range(1, 4):
        indirect = frame.indirect.copy()
        indirect[0, :i] = np.nan
        write_frame(tmp_path / "in" / f"{i}.exr", dataclasses.replace(frame, indirect=indirect))
    assert run(tmp_path / "in", "-o", tmp_path / "out") == 0
    first, others = capsys.readouterr().err.splitlines()
    assert "1.exr: pixels that are NaN" in first and "warning: 2 more: pixels that" in others


ERRORS = [
    (("gone.exr", "-o", "out.exr"), "there is no such file"),
    (("frames", "-o", "out.exr"), "OUT must be a folder when there are several frames"),
    (("empty", "-o", "out"), "there is no EXR file in this folder"),
    (("frame.exr", "-o", "out.png"), "OUT must end with .exr or .pfm or be a folder"),
    (("frame.exr", "-o", "frame.exr"), "would replace an input"),
    (("frame.exr", "frames/a.exr", "frames/../frames/a.exr", "-o", "o"), "would both be written"),
    (("frame.exr", "-o", "notes.txt/out.exr"), "notes.txt/out.exr cannot be written"),
    (("frame.exr", "-o", "out.exr", "--spp", "4"), "there is indirect light for spp 1"),
    (("frame.exr", "-o", "out.exr", "--spp", "0"), "spp must be at least 1"),
    (("frame.exr", "-o", "out.exr", "--sigma", "-1"), "sigma"),
    (("frame.exr", "-o", "out.exr", "--eps", "nan"), "eps"),
    (("frame.exr", "-o", "out.exr", "--guides", "colour"), "'colour'"),
    (("frame.exr", "-o", "out.exr", "--block", "0"), "block must be at least 1"),
    (("frame.exr", "-o", "out.exr", "--params", "gone.json"), "there is no such file"),
    (("frame.exr", "-o", "out.exr", "--params", "notes.txt"), "notes.txt"),
    (("frame.exr", "-o", "out.exr", "--params", "odd.json"), "must be a list of names"),
]


@pytest.mark.parametrize(("argv", "message"), ERRORS)
def test_errors_are_one_sentence_and_leave_nothing(
    argv: tuple[str, ...],
    message: str,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(folder.parent)
    Path("empty").mkdir()
    Path("notes.txt").write_text("plain words")
    odd = {"format": "jflnr-parameters", "version": 1, "sigma": 5, "eps": 1, "eps_prime": 1}
    Path("odd.json").write_text(json.dumps(odd | {"guides": "depth"}))
    before = files(folder.parent)
    assert run(*argv) == 2
    streams = capsys.readouterr()
    assert message in streams.err and streams.err.count("\n") == 1, streams.err
    assert streams.out == ""
    assert files(folder.parent) == before


def test_plan_names_outputs(folder: Path) -> None:
    assert [job.target for job in plan([folder], Path("out"))] == [
        Path("out") / name for name in ("a.exr", "b.exr", "c.exr")
    ]
    assert plan([folder / "a.exr"], Path("x.exr"))[0].target == Path("x.exr")
    assert plan([folder / "a.exr"], Path("results.v2"))[0].target == Path("results.v2/a.exr")


def test_interrupt_between_write_and_rename_leaves_nothing(
    tmp_path: Path, frame_file: Path, stand_in: list[dict], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", interrupted)
    assert run(frame_file, "-o", tmp_path / "out.exr", "--png") == 130
    assert files(tmp_path) == ["frame.exr"]


LOOP = """
import sys, time, numpy as np
from jflnr import denoising
def slow(denoiser, frame):
    time.sleep(0.05)
    return np.asarray(frame.indirect)
denoising.Denoiser.__call__ = slow
from jflnr.cli import main
sys.exit(main(sys.argv[1:]))
"""


@pytest.fixture
def many(tmp_path: Path, frame_file: Path) -> list[str]:
    """A command that denoises many frames, slowly."""
    folder = tmp_path / "many"
    folder.mkdir()
    for i in range(200):
        os.link(frame_file, folder / f"{i:03}.exr")
    return [sys.executable, "-c", LOOP, "denoise", str(folder), "-o", str(tmp_path / "out")]


def test_control_c_leaves_whole_files_only(tmp_path: Path, many: list[str]) -> None:
    with subprocess.Popen(many, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=60)
    assert process.returncode == 130
    assert error.decode() == "jflnr: interrupted; no partial file is left\n"
    written = files(tmp_path / "out")
    assert 0 < len(written) < 200
    for name in written:
        assert len(exr.read_channels(tmp_path / "out" / name)) == 6


def test_progress_bar_on_a_terminal_only(tmp_path: Path, many: list[str]) -> None:
    for i in range(5, 200):
        (tmp_path / "many" / f"{i:03}.exr").unlink()
    terminal, inside = pty.openpty()
    termios.tcsetwinsize(inside, (24, 80))
    with subprocess.Popen(many, stdout=subprocess.PIPE, stderr=inside) as process:
        lines, _ = process.communicate(timeout=60)
    shown = os.read(terminal, 1 << 16) if select.select([terminal], [], [], 0)[0] else b""
    os.close(inside)
    os.close(terminal)
    assert process.returncode == 0
    assert b"frame" in shown and b"5" in shown
    assert lines.decode().count(" -> ") == 5 and b"\r" not in lines
    done = subprocess.run([*many, "--overwrite"], capture_output=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, b"")


def test_the_real_thing(tmp_path: Path, frame: Frame, frame_file: Path) -> None:
    """Without the stand-in, on few guides so that it compiles soon."""
    assert run(frame_file, "-o", tmp_path / "out.exr", "--guides", "depth", "--reference") == 0
    channels = exr.read_channels(tmp_path / "out.exr")
    light = np.stack([channels[f"indirect.{c}"] for c in "RGB"], axis=-1)
    before, after = (metrics.measure(frame, image) for image in (frame.indirect, light))
    assert after["psnr"] > before["psnr"] + 10


def test_error_map(
    tmp_path: Path,
    frame_file: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """It is told of what the other options say, not of the defaults."""
    params, told = tmp_path / "p.json", np.full((24, 40, 1), 0.25, np.float32)
    save_parameters(params, AdaptiveFLR(sigma=1.5))
    given: list[AdaptiveFLR] = []

    def denoise(self: denoising.Denoiser, frame: Frame) -> tuple:
        given.append(self.method)
        return frame.indirect, told

    monkeypatch.setattr(denoising.Denoiser, "__call__", denoise)
    out, options = tmp_path / "out.exr", ("--error-map", "--params", params, "--block", "4")
    assert run(frame_file, "-o", out, "--method", "flr-adaptive", *options) == 0
    assert np.all(exr.read_channels(out)["error.Y"] == 0.25)
    assert set(given) == {AdaptiveFLR(sigma=1.5, block=4, with_error=True)}
    assert run(frame_file, "-o", tmp_path / "other.exr", "--error-map") == 2
    assert "flr-adaptive" in capsys.readouterr().err
