"""What holds for every command: exit codes, one-sentence errors, and quick answers."""

import subprocess
import sys
from pathlib import Path

import pytest

from jflnr.cli import main

COMMANDS = ("denoise", "info", "metrics", "fit")


@pytest.mark.parametrize("argv", [["--help"], *([name, "--help"] for name in COMMANDS)])
def test_help(argv: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(argv)
    assert stop.value.code == 0
    assert "usage: jflnr" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        ([], "the following arguments are required: COMMAND"),
        (["paint"], "invalid choice: 'paint'"),
        (["denoise", "a.exr"], "the following arguments are required: -o/--output"),
        (["denoise", "a.exr", "-o", "b.exr", "--spp", "x"], "invalid int value: 'x'"),
        (["denoise", "a.exr", "-o", "b.exr", "--sig", "3"], "unrecognized arguments: --sig"),
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
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


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


def test_a_closed_pipe_is_no_error(frame_file: Path) -> None:
    code = f"{sys.executable} -m jflnr info {frame_file} | true; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", code], capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")
