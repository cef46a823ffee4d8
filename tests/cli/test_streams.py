"""What is around a command: terminals, closed streams, interruptions, other files."""

import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pytest

import jflnr
from jflnr import exr
from jflnr.cli import main
from jflnr.files import replacing
from jflnr.frame import composite

JFLNR = f"{sys.executable} -m jflnr"
INFO, DENOISE = "info frame.exr", "denoise frame.exr -o out.exr"


def shell(line: str, folder: Path, **environment: str) -> subprocess.CompletedProcess[bytes]:
    where = {"PYTHONPATH": str(Path(__file__).parents[2])}
    return subprocess.run(
        ["bash", "-c", line],
        cwd=folder,
        env=os.environ | where | environment,
        capture_output=True,
        timeout=300,
    )


@pytest.mark.parametrize("closed", ["1>&-", "2>&-", "1>&- 2>&-", "0<&- 1>&- 2>&-"])
def test_closed_streams(frame_file: Path, closed: str) -> None:
    done = shell(f"{JFLNR} {DENOISE} {closed}", frame_file.parent)
    assert done.returncode == 0
    assert "indirect.R" in exr.read_channels(frame_file.with_name("out.exr"))
    assert shell(f"{JFLNR} info gone.exr {closed}", frame_file.parent).returncode == 2


def test_a_full_terminal_is_one_sentence(frame_file: Path) -> None:
    done = shell(f"{JFLNR} {INFO} > /dev/full", frame_file.parent)
    assert done.returncode == 2
    assert done.stderr == b"jflnr: no space left on device\n"


@pytest.mark.parametrize("name", ["絵.exr".encode(), b"\xe9.exr"])
def test_names_that_the_terminal_has_no_letters_for(frame_file: Path, name: bytes) -> None:
    folder = frame_file.parent
    (folder / "in").mkdir()
    for path in (name, b"z.exr"):
        os.link(frame_file, os.fsencode(folder / "in") + b"/" + path)
    line = f"{JFLNR} denoise in -o out -v --png"
    done = shell(line, folder, PYTHONIOENCODING="cp1252", PYTHONUTF8="0")
    assert done.returncode == 0, done.stderr
    assert len(list((folder / "out").iterdir())) == 4


def test_what_scripts_for_open_image_denoise_give(tmp_path: Path, frame: jflnr.Frame) -> None:
    """Three PFM files are the picture that an EXR with these layers is, and any stream of it."""
    images = {"color": composite(frame, frame.indirect), "albedo": frame.albedo}
    channels = {}
    for name, image in (images | {"normal": frame.normal}).items():
        planes = np.moveaxis(np.asarray(image, np.float32), -1, 0)
        exr.write_channels(tmp_path / f"{name}.pfm", dict(zip("RGB", planes, strict=True)))
        channels |= {f"{name}.{c}": plane for c, plane in zip("RGB", planes, strict=True)}
    exr.write_channels(tmp_path / "all.exr", channels)
    trio = f"{JFLNR} denoise --hdr color.pfm --alb albedo.pfm --nrm normal.pfm"
    for line in (
        f"{trio} -o out.pfm",
        f"{trio} -o out.pfm",  # which is kept
        f"{trio} -o - > piped.pfm",
        f"{JFLNR} denoise all.exr -o out.exr",
        f"cat all.exr | {JFLNR} denoise - -o - > piped.exr",
    ):
        done = shell(line, tmp_path)
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "piped.pfm").read_bytes() == (tmp_path / "out.pfm").read_bytes()
    found = [exr.read_channels(tmp_path / f"{name}") for name in ("out.pfm", "piped.exr")]
    for name, pixels in exr.read_channels(tmp_path / "out.exr").items():
        for one in found:
            np.testing.assert_array_equal(one[name], pixels)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("--hdr a.pfm -o b.pfm", "--hdr, --alb and --nrm are given together"),
        ("--hdr a.pfm --alb a.pfm --nrm b.pfm -o b.pfm", "would replace an input"),
        ("- a.exr -o b", "- stands for one frame"),
        ("-o b", "IN is missing"),
        ("a.exr -o - --png", "writes one picture to standard output"),
    ],
)
def test_streams_and_pictures_that_do_not_go_together(
    line: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["denoise", *line.split()]) == 2
    assert message in capsys.readouterr().err


def test_standard_input_is_called_that(frame_file: Path) -> None:
    """Also where it never ends; and other files are seen from the current folder."""
    folder = frame_file.parent
    for line, end, words in (
        ("yes |", "", b"is not an EXR file"),
        ("", "0<&-", b"is empty (0 bytes)"),
        ("head -c 2000 frame.exr |", "", b"is truncated or damaged"),
        ("cat frame.exr |", "--map albedo=frame.exr:nothing", b"there is no nothing for albedo"),
    ):
        done = shell(f"ulimit -v 8000000; {line} {JFLNR} denoise - -o out.exr {end}", folder)
        assert done.returncode == 2 and words in done.stderr
        assert done.stderr.startswith(b"jflnr: standard input") and done.stderr.count(b"\n") == 1
    line = f"cat frame.exr | {JFLNR} denoise - -o out.exr --json --map albedo=frame.exr:albedo"
    done = shell(line, folder)
    assert done.returncode == 0 and json.loads(done.stdout)[0]["input"] == "standard input"
    assert {path.name for path in folder.iterdir()} == {"frame.exr", "out.exr"}


def test_a_damaged_file_in_pieces_is_one_sentence(frame_file: Path) -> None:
    """Also what a library says at the end of a process."""
    pytest.importorskip("OpenImageIO")
    content = frame_file.read_bytes()
    at = content.index(exr.DATA_WINDOW) + len(exr.DATA_WINDOW) + 8
    size = np.array([29_999, 29_999], "<i4").tobytes()
    frame_file.write_bytes(content[:at] + size + content[at + 8 :])
    done = shell(f"{JFLNR} {DENOISE} --memory 2G", frame_file.parent)
    assert done.returncode == 2
    assert done.stderr.count(b"\n") == 1 and b"frame.exr" in done.stderr


def test_a_log_that_cannot_be_written_is_named(
    frame_file: Path, capsys: pytest.CaptureFixture
) -> None:
    out = frame_file.with_name("out.exr")
    assert main(["denoise", str(frame_file), "-o", str(out), "--log", "/dev/full"]) == 2
    assert capsys.readouterr().err == (
        "jflnr: /dev/full cannot be written: No space left on device\n"
    )


def test_what_becomes_of_a_picture_on_standard_output(frame_file: Path) -> None:
    """It is there, or it is said why not; what else is said goes to the other stream."""
    line = f"{JFLNR} denoise frame.exr -o -"
    for end, code, words in (
        ("--reference > out.exr", 0, b"PSNR"),
        ("-q > out.exr", 0, b""),
        (">&-", 2, b"jflnr: -o - writes to standard output, which is closed\n"),
        ("-q > /dev/full", 2, b"jflnr: standard output cannot be written: No space left on device"),
    ):
        done = shell(f"{line} {end}", frame_file.parent)
        assert done.returncode == code and words in done.stderr and not done.stdout
        assert done.stderr.count(b"\n") == 1 or code == 0
        if code == 0:
            assert "indirect.R" in exr.read_channels(frame_file.with_name("out.exr"))


@pytest.mark.parametrize("read", [False, True])
def test_a_log_may_be_a_pipe_that_somebody_reads(frame_file: Path, read: bool) -> None:
    os.mkfifo(frame_file.with_name("pipe"))
    reader = "cat pipe > log & " if read else ""
    done = shell(
        f"{reader}{JFLNR} {DENOISE} --log pipe; code=$?; wait; exit $code", frame_file.parent
    )
    assert done.returncode == (0 if read else 2)
    if read:
        assert b"out.exr" in frame_file.with_name("log").read_bytes()
    else:
        assert done.stderr == b"jflnr: pipe cannot be written: nobody reads this pipe\n"


# Not UTF-8, what a terminal obeys, what HTML and JSON quote, what a line ends with.
NAMES = [b"caf\xe9", b"red\x1b[31m", b"\"'<b>&amp;", b"a\nb", b"two  spaces"]


@pytest.mark.parametrize("name", [*map(os.fsdecode, NAMES)], ids=ascii)
def test_any_name_of_a_file(frame_file: Path, name: str, capsys: pytest.CaptureFixture) -> None:
    folder = frame_file.with_name(name)
    folder.mkdir()
    frame, damaged = folder / f"{name}.exr", folder / f"other {name}.exr"
    os.link(frame_file, frame)
    damaged.write_bytes(b"v/1\x01 no more")
    clean, page = frame_file.with_name(f"{name}.exr"), frame_file.with_name(f"{name}.html")
    denoise = ["denoise", str(frame), "--backend", "opencl", "-o", str(clean)]

    def said(*words: object) -> str:
        assert main([str(word) for word in words]) == 0
        output = capsys.readouterr()
        assert output.out and not output.err
        return output.out

    assert json.loads(said(*denoise, "--json"))[0]["output"] == str(clean)
    assert json.loads(said("info", frame, "--json"))["file"] == str(frame)
    said(*denoise, "--overwrite", "--map", f"albedo={name}.exr:albedo")
    lines = [said(*denoise), said("info", frame), said("metrics", clean, frame)]
    lines.append(said("report", frame, clean, "-o", page))
    assert all(line.isprintable() for text in lines for line in text.split("\n"))
    assert b"<b>" not in page.read_bytes()

    for words in (
        ("info", damaged),
        ("metrics", damaged),
        ("report", frame, damaged, "-o", folder / "page"),
        ("fit", damaged, "-o", folder / "fitted"),
        ("train", "--data", damaged, "-o", folder / "weights"),
        ("denoise", damaged, "-o", folder / "out"),
        ("denoise", frame, "-o", folder / "out", "--params", damaged),
        ("denoise", frame, "-o", folder / "out", "--temporal", "--history", damaged),
    ):
        assert main([str(word) for word in words]) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1 and error[:-1].isprintable()
        # Once, and so that the name can be told from others.
        assert error.count(ascii(f"other {name}")[1:-1].replace("\\'", "'")) == 1


def test_the_longest_names_can_be_written(tmp_path: Path, frame_file: Path) -> None:
    name = "ü" * 125 + ".exr"
    for start in (name, "n" * 251 + ".exr", "a", ".exr"):
        with replacing(tmp_path / start) as beside:
            beside.write_bytes(b"x")
        assert (tmp_path / start).read_bytes() == b"x"


def test_a_pipe_or_a_device_is_not_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for name in ("pipe", "."):
        with pytest.raises(OSError, match="it is a folder, a pipe or a device"):
            replacing(tmp_path / name).__enter__()
    assert (tmp_path / "pipe").is_fifo()


def test_a_full_disk_names_the_file(tmp_path: Path) -> None:
    with (
        pytest.raises(OSError, match=r"out\.npz cannot be written: No space left on device"),
        replacing(tmp_path / "out.npz") as beside,
    ):
        beside.unlink()
        beside.symlink_to("/dev/full")
        beside.write_bytes(b"x")
    with pytest.raises(OSError, match=r"^[^ ]*/gone/out\.npz cannot be written: No such"):
        replacing(tmp_path / "gone" / "out.npz").__enter__()


def refuse(number: int) -> NoReturn:
    raise OSError(number, os.strerror(number))


def read_only(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As for others than root: no file can be made in `out`, nor anything replaced there."""
    opened = os.open
    makes = os.O_CREAT | getattr(os, "O_TMPFILE", 0)
    monkeypatch.setattr(
        os,
        "open",
        lambda path, flags, *others, **named: (
            refuse(errno.EROFS)
            if flags & makes and folder in Path(os.fsdecode(path)).parents
            else opened(path, flags, *others, **named)
        ),
    )


def vanished(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = tempfile.mkstemp

    def gone(**named: Any) -> Any:
        shutil.rmtree(folder)
        return made(**named)

    monkeypatch.setattr(tempfile, "mkstemp", gone)


def full(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = tempfile.mkstemp

    def small(**named: Any) -> Any:
        handle, name = made(**named)
        if folder.samefile(named["dir"]):
            os.remove(name)
            os.symlink("/dev/full", name)
        return handle, name

    monkeypatch.setattr(tempfile, "mkstemp", small)


def fixed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is there may not be replaced."""
    put = os.replace
    monkeypatch.setattr(
        os,
        "replace",
        lambda path, target: (
            refuse(errno.EPERM) if folder.samefile(target.parent) else put(path, target)
        ),
    )


def below_a_file(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder.rmdir()
    folder.write_bytes(b"")


@pytest.mark.parametrize("fault", [read_only, vanished, full, fixed, below_a_file])
@pytest.mark.parametrize(
    "line",
    [
        "denoise frame.exr --backend opencl -o out/named.exr",
        "denoise frame.exr --temporal --method flr -o clean/ --history out/named.npz",
        "report frame.exr -o out/named.html",
        "fit frame.exr --steps 1 -o out/named.json",
        "train --data frame.exr -o out/named.npz",
    ],
)
def test_what_cannot_be_written(
    frame_file: Path,
    line: str,
    fault: Callable[[Path, pytest.MonkeyPatch], None],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
) -> None:
    if line.startswith("train"):
        trained(monkeypatch)
    monkeypatch.chdir(frame_file.parent)
    out = frame_file.with_name("out")
    out.mkdir()
    with monkeypatch.context() as patch:
        fault(out, patch)
        assert main(line.split()) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and f"out/{line.rpartition('/')[2]} cannot be written" in said
    left = {path for path in frame_file.parent.rglob("*") if path.is_file()}
    assert left <= {frame_file, out, frame_file.parent / "clean" / "frame.exr"}


def trained(monkeypatch: pytest.MonkeyPatch) -> None:
    """Training without its hour."""
    import jax

    from jflnr.network import examples, flnr, train

    params = flnr.init(jax.random.key(0), train.WIDTHS["flnr"])
    progress = train.Progress(1, 1.0, 1.0, {})
    result = train.Result(params, progress, [progress], False)
    monkeypatch.setattr(examples, "prepared", lambda *_: None)
    monkeypatch.setattr(train, "train", lambda *_, **__: result)


@pytest.mark.parametrize("name", ["pipe", "loop", "/dev/zero"])
@pytest.mark.parametrize(
    "line",
    [
        "info {}",
        "denoise {} -o o.exr",
        "denoise frame.exr -o o.exr --params {}",
        "denoise frame.exr -o o.exr --method flnr --params {}",
    ],
)
def test_what_is_no_file(
    frame_file: Path,
    line: str,
    name: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
) -> None:
    os.mkfifo(frame_file.with_name("pipe"))
    frame_file.with_name("loop").symlink_to("loop")
    monkeypatch.chdir(frame_file.parent)
    assert main(line.format(name).split()) == 2
    assert name in (said := capsys.readouterr().err) and said.count("\n") == 1


# Where Python sees no signal, or whoever is called swallows it: as a compiler does.
STUCK = """
import time, jflnr.__main__, jflnr.cli
from jflnr.files import replacing
def stuck():
    with replacing("out.exr"):
        print("ready", flush=True)
        while True:
            try:
                time.sleep(60)
            except KeyboardInterrupt:
                pass
jflnr.cli.main = stuck
raise SystemExit(jflnr.__main__.main())
"""
COLLECTING = STUCK.replace(
    "def stuck():",
    """class Collected:
    def __del__(self):
        print("ready", flush=True)
        time.sleep(60)
def stuck():
    with replacing("out.exr"):
        Collected()
        time.sleep(60)
def never():""",
)
IMPORTING = "print('ready', flush=True)\nimport time\ntime.sleep(60)"


@pytest.mark.parametrize("kind", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("where", ["stuck", "collecting", "importing"])
def test_an_interruption_ends_it(tmp_path: Path, where: str, kind: int) -> None:
    (tmp_path / "modules" / "numpy").mkdir(parents=True)
    (tmp_path / "folder").mkdir()
    path = [str(Path(__file__).parents[2])]
    command = [sys.executable, "-c", COLLECTING if where == "collecting" else STUCK]
    if where == "importing":
        (tmp_path / "modules" / "numpy" / "__init__.py").write_text(IMPORTING)
        path.insert(0, str(tmp_path / "modules"))
        command = [sys.executable, "-m", "jflnr", "info", "x.exr"]
    process = subprocess.Popen(
        command,
        cwd=tmp_path / "folder",
        env=os.environ | {"PYTHONPATH": os.pathsep.join(path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == b"ready\n"
    process.send_signal(kind)
    _, said = process.communicate(timeout=30)
    assert process.returncode == 130
    assert said == b"jflnr: interrupted; no partial file is left\n"
    assert not list((tmp_path / "folder").iterdir())


def test_it_ends_also_where_nobody_hears_it(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", STUCK],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert process.stdout is not None and process.stderr is not None
    assert process.stdout.readline() == b"ready\n"
    process.stderr.close()
    process.terminate()
    assert process.wait(timeout=30) == 130
    assert not list(tmp_path.iterdir())
    process.stdout.close()


@pytest.mark.parametrize(
    "line",
    [
        "report a.exr -o a.exr --overwrite",
        "report a.exr -o link.exr --overwrite",
        "report a.exr -o b.exr --reference b.exr --overwrite",
        "fit a.exr -o a.exr --overwrite",
        "train --data a.exr -o a.exr --overwrite",
        "train --data b.exr --val a.exr -o a.exr --overwrite",
        "train --data a.exr -o a.exr --overwrite",
        "denoise a.exr -o out --temporal --history a.exr",
        "denoise a.exr -o out --temporal --history out/a.exr",
        "denoise a.exr -o p.exr --params p.exr --overwrite",
        "denoise a.exr -o b.exr --map albedo=b.exr:albedo --overwrite",
        "denoise a.exr -o out --map albedo={stem}.exr:albedo --log a.exr",
        "denoise a.exr -o out --map albedo=b.exr --log b.exr",
        "denoise a.exr -o out --history w.npz --log w.npz",
        "report a.exr -o b.exr --map reference=b.exr --overwrite",
    ],
)
def test_no_output_replaces_an_input(
    tmp_path: Path,
    frame_file: Path,
    line: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
) -> None:
    frame = frame_file.read_bytes()
    names = ("a.exr", "b.exr", "w.npz", "p.exr")
    for name in names:
        (tmp_path / name).write_bytes(frame)
    (tmp_path / "link.exr").hardlink_to(tmp_path / "a.exr")
    monkeypatch.chdir(tmp_path)
    assert main(line.split()) == 2
    assert "would replace an input" in capsys.readouterr().err
    assert all((tmp_path / name).read_bytes() == frame for name in names)


def test_pictures_of_other_pixels_are_not_compared(
    tmp_path: Path, frame_file: Path, capsys: pytest.CaptureFixture
) -> None:
    channels = exr.read_channels(frame_file)
    picture = {c: channels[f"reference.{c}"] for c in "RGB"}
    for name, shift in (("a", 0), ("b", 500)):
        exr.write_channels(tmp_path / f"{name}.exr", picture, window=exr.Window((shift, 0)))
    a, b, out = (str(tmp_path / name) for name in ("a.exr", "b.exr", "out"))
    for argv in (
        ["metrics", a, b],
        ["metrics", b, str(frame_file)],
        ["report", a, b, "-o", out],
        ["report", a, "--reference", b, "-o", out],
        ["denoise", str(frame_file), "-o", f"{out}.exr", "--map=albedo=b.exr"],
    ):
        assert main(argv) == 2
        assert "do not cover the same pixels" in capsys.readouterr().err
    assert main(["metrics", a, a]) == 0
