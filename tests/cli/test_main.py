"""What holds for every command: exit codes, one-sentence errors, and quick answers."""

import json
import os
import pty
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from jflnr.cli import COMMANDS, main, parser


@pytest.mark.parametrize("argv", [["--help"], *([name, "--help"] for name in COMMANDS)])
def test_help_shows_examples(argv: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    """Every example is a command line that the parser takes."""
    with pytest.raises(SystemExit) as stop:
        main(argv)
    text = capsys.readouterr().out
    assert stop.value.code == 0 and "usage: jflnr" in text
    examples = re.findall(r"^ +jflnr (.+?)(?:  +.*)?$", text, re.MULTILINE)
    assert examples
    for example in examples:
        parser().parse_args(shlex.split(example.partition(">")[0]))


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        ([], "the following arguments are required: COMMAND"),
        (["paint"], "invalid choice: 'paint'"),
        (["denoise", "a.exr"], "the following arguments are required: -o/--output"),
        (["denoise", "a.exr", "-o", "b.exr", "--spp", "x"], "invalid int value: 'x'"),
        (["denoise", "a.exr", "-o", "b.exr", "--sig", "3"], "unrecognized arguments: --sig"),
        (["denoise", "a.exr", "-o", "b.exr", "--method", "magic"], "invalid choice: 'magic'"),
        (["denoise", "a.exr", "-o", "b.exr", "--backend", "abacus"], "invalid choice: 'abacus'"),
        (["info"], "the following arguments are required: FILE"),
    ],
)
def test_wrong_command_line(
    argv: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stop:
        main(argv)
    assert stop.value.code == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1


def python(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=300)


def test_module_runs_and_reports_in_one_line(tmp_path: Path) -> None:
    done = python("-m", "jflnr", "info", str(tmp_path / "gone.exr"))
    assert done.returncode == 2
    assert done.stderr == f"jflnr: {tmp_path}/gone.exr: there is no such file\n"
    assert done.stdout == ""


def test_help_and_info_do_not_import_jax(frame_file: Path) -> None:
    """JAX takes a second to import, which these answers should not wait for."""
    for argv in (["--help"], ["info", str(frame_file)]):
        code = f"import sys; sys.argv[1:] = {argv!r}\nimport jflnr.cli\ntry: jflnr.cli.main()\n"
        done = python("-c", code + "finally: print('jax' in sys.modules)")
        assert done.stdout.splitlines()[-1] == "False", done


@pytest.mark.parametrize("method", ["flr", "flr-adaptive"])
def test_where_there_is_a_device_no_jax_is_needed(
    method: str, frame_file: Path, tmp_path: Path
) -> None:
    """It takes half of a second to import; neither are metrics that nobody asked for."""
    pytest.importorskip("pyopencl")
    heavy = "[n for n in ('jax', 'scipy.stats', 'skimage') if n in sys.modules]"
    code = f"import sys; from jflnr.cli import main; main(); print({heavy})"
    argv = ["denoise", str(frame_file), "--method", method]
    done = python("-c", code, *argv, "-o", str(tmp_path / "out.exr"))
    assert done.stdout.splitlines()[-1] == "[]", done


def test_a_run_keeps_its_programs_for_the_next(frame_file: Path, tmp_path: Path) -> None:
    """And waits for no metrics that nobody asked for."""
    code = (
        "import sys; from jflnr.__main__ import main; main(); print('scipy.stats' in sys.modules)"
    )
    own = {name: value for name, value in os.environ.items() if not name.startswith("JAX_")}
    command = [sys.executable, "-c", code, "denoise", str(frame_file), "--overwrite", "-o"]
    command[4:4] = ["--backend", "jax", "--quiet"]
    kept = list[set[Path]]()
    for _ in range(2):
        done = subprocess.run(
            [*command, str(tmp_path / "out.exr")],
            env=own
            | {"XDG_CACHE_HOME": str(tmp_path), "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0"},
            capture_output=True,
            text=True,
            timeout=120,
        )
        assert done.stdout.splitlines()[-1] == "False" and done.stderr == "", done
        kept.append(set((tmp_path / "jflnr" / "jax").glob("*-cache")))
    assert kept[0] and kept[1] == kept[0]


def test_compiling_is_told_once(backend: str, frame_file: Path, tmp_path: Path) -> None:
    """On stderr, unless --quiet is given, and how long it took the last time."""
    arguments = ["denoise", frame_file, "-o", tmp_path / "out.exr", "--overwrite", "--json"]

    def said(folder: str, silence: float, *options: str) -> str:
        (tmp_path / folder).mkdir(exist_ok=True)
        kept = os.environ | {"XDG_CACHE_HOME": str(tmp_path / "home")}
        for name in ("POCL_CACHE_DIR", "JAX_COMPILATION_CACHE_DIR"):
            kept[name] = str(tmp_path / folder)
        program = "from jflnr import __main__ as m; from jflnr.cli import compiling; "
        program += f"compiling.SILENCE = {silence}; m.main()"
        done = subprocess.run(
            [sys.executable, "-c", program, *arguments, "--backend", backend, *options],
            env=kept,
            capture_output=True,
            text=True,
            timeout=600,
        )
        assert done.returncode == 0 and (options or json.loads(done.stdout))
        return done.stderr

    told = "jflnr: compiling flr for this machine, once"
    assert said("kept", 0.2) == f"{told} ...\n"
    assert said("kept", 1) == ""
    assert re.fullmatch(rf"{told} \(\d+ s the last time\) \.\.\.\n", said("other", 0.2))
    assert said("more", 0.2, "--quiet") == ""


def test_a_closed_pipe_is_no_error(frame_file: Path) -> None:
    code = f"{sys.executable} -m jflnr info {frame_file} | true; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", code], capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["den"], {"denoise"}),
        (["denoise", "--ov"], {"--overwrite"}),
        (["denoise", "--method", "flr-"], {"flr-adaptive"}),
        (["info", "fra"], {"frame.exr"}),
    ],
)
def test_bash_completes(
    frame_file: Path, capsys: pytest.CaptureFixture[str], words: list[str], expected: set[str]
) -> None:
    assert main(["completion", "bash"]) == 0
    line = shlex.join(["jflnr", *words])
    ask = f"COMP_WORDS=({line}); COMP_CWORD={len(words)}; _shtab_jflnr; echo ${{COMPREPLY[@]}}"
    command = ["bash", "-c", f"{capsys.readouterr().out}\n{ask}"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=frame_file.parent)
    assert set(done.stdout.split()) == expected, done.stderr


@pytest.mark.parametrize("shell", ["zsh", "tcsh"])
def test_other_shells_have_a_script(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert "denoise" in script and "overwrite" in script


def on_a_terminal(*arguments: str, **environment: str) -> bytes:
    """What a command shows when its errors go to a terminal."""
    terminal, inside = pty.openpty()
    command = [sys.executable, "-m", "jflnr", *arguments]
    plain = {n: v for n, v in os.environ.items() if n not in ("NO_COLOR", "TERM")}
    subprocess.run(command, stderr=inside, env=plain | {"TERM": "xterm"} | environment)
    os.close(inside)
    shown = os.read(terminal, 1 << 16)
    os.close(terminal)
    return shown


def test_colours_on_a_terminal_only(tmp_path: Path) -> None:
    gone = str(tmp_path / "gone.exr")
    assert on_a_terminal("info", gone).startswith(b"\033[31mjflnr:\033[0m ")
    for environment in ({"NO_COLOR": "1"}, {"TERM": "dumb"}):
        assert on_a_terminal("info", gone, **environment).startswith(b"jflnr: ")
