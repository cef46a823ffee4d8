"""The built wheel, installed where nothing else is: it holds all it needs, and works."""

import shutil
import subprocess
import tomllib
import venv
import zipfile
from pathlib import Path

import numpy as np
import pytest

import jflnr
from jflnr import exr

REPOSITORY = Path(__file__).parents[1]


def run(*command: object, cwd: Path) -> str:
    arguments = [str(part) for part in command]
    done = subprocess.run(arguments, capture_output=True, text=True, cwd=cwd)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a new environment, and in it what `pip install jflnr-*.whl` brings."""
    folder = tmp_path_factory.mktemp("clean")
    venv.create(folder / "venv", with_pip=True)
    pip = folder / "venv" / "bin" / "python", "-m", "pip", "--quiet"
    run(*pip, "wheel", "--no-deps", "--wheel-dir", folder, REPOSITORY, cwd=folder)
    (wheel,) = folder.glob("jflnr-*.whl")
    run(*pip, "install", wheel, cwd=folder)
    return folder


def test_versions_agree() -> None:
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    citation = (REPOSITORY / "CITATION.cff").read_text()
    assert project["version"] == jflnr.__version__
    assert f"\nversion: {jflnr.__version__}\n" in citation


@pytest.mark.slow
def test_the_wheel_holds_all_that_is_not_python(clean: Path) -> None:
    """Every file of the package that git knows, and the kernels."""
    listed = run("git", "ls-files", "jflnr", "kernels_cl", cwd=REPOSITORY).split("\n")
    wanted = {name.replace("kernels_cl/", "jflnr/kernels_cl/", 1) for name in listed if name}
    (wheel,) = clean.glob("jflnr-*.whl")
    held = set(zipfile.ZipFile(wheel).namelist())
    assert {"jflnr/py.typed", "jflnr/data/room.exr", "jflnr/kernels_cl/solve.cl"} <= held
    assert wanted <= held


@pytest.mark.slow
def test_builds_are_reproducible(
    clean: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Wheel and sdist, of the same files at another place, with other times and permissions."""
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    python = clean / "venv" / "bin" / "python"
    run(python, "-m", "pip", "--quiet", "install", "hatchling", cwd=clean)
    listed = run("git", "ls-files", "-co", "--exclude-standard", cwd=REPOSITORY).split()
    for name in reversed(listed):
        (tmp_path / name).parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        copy = Path(shutil.copy(REPOSITORY / name, tmp_path / name))
        copy.chmod(copy.stat().st_mode & 0o700)
    built = []
    for place in (REPOSITORY, tmp_path):
        out = clean / f"of {place.name}"
        run(python, "-m", "hatchling", "build", "-d", out, cwd=place)
        built.append({path.name: path.read_bytes() for path in out.iterdir()})
    assert len(built[0]) == 2 and built[0] == built[1]


@pytest.mark.slow
def test_from_the_wheel_to_a_report(clean: Path) -> None:
    """Denoise the shipped frame and compare, with nothing of this repository at hand."""
    scripts = clean / "venv" / "bin"
    where = "import jflnr; print(jflnr.__file__)"
    package = Path(run(scripts / "python", "-c", where, cwd=clean).strip()).parent
    assert clean in package.parents
    room = package / "data" / "room.exr"
    run(scripts / "jflnr", "denoise", room, "-o", "out", "--png", "--reference", cwd=clean)
    run(scripts / "jflnr", "report", room, "out/room.exr", "-o", "report.html", cwd=clean)
    picture = np.stack([exr.read_channels(clean / "out" / "room.exr")[c] for c in "RGB"])
    assert np.isfinite(picture).all() and picture.std() > 0
    assert (clean / "report.html").stat().st_size > 100_000


@pytest.mark.slow
def test_type_hints_are_shipped(clean: Path) -> None:
    """A type checker sees the types of the installed package."""
    scripts = clean / "venv" / "bin"
    run(scripts / "python", "-m", "pip", "--quiet", "install", "mypy", cwd=clean)
    (clean / "use.py").write_text('import jflnr\nreveal_type(jflnr.read_frame("a.exr"))\n')
    assert '"jflnr.frame.Frame"' in run(scripts / "mypy", "use.py", cwd=clean)
