"""The C example of docs/opencl_engine.md, compiled and run against PoCL, is FLR as in JAX."""

import os
import shutil
import subprocess
from pathlib import Path

import jax
import numpy as np
import pytest

import jflnr
from docs.launches import launches, parameters, tables
from jflnr.images.inputs import prepare
from jflnr.methods import method_of
from jflnr.opencl import NoDevice

ROOT = Path(__file__).parents[2]
METHODS = pytest.mark.parametrize("method", ["flr", "flr-adaptive"])


@pytest.fixture(scope="module")
def host(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """The command that runs the compiled example."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("there is no C compiler")
    libraries = Path(pytest.importorskip("pyopencl").__file__).parent / ".libs"
    loader = next(libraries.glob("libOpenCL*"), None)
    if loader is None or not (libraries / "pocl.icd").exists():
        pytest.skip(f"no OpenCL loader and PoCL of their wheels in {libraries}")
    program = tmp_path_factory.mktemp("host") / "host"
    flags = ["-std=c11", "-Wall", "-Wextra", "-Werror", f"-Wl,-rpath,{libraries}"]
    source = str(ROOT / "docs" / "examples" / "host.c")
    if subprocess.run([compiler, "-E", source], capture_output=True, check=False).returncode:
        pytest.skip("the OpenCL headers are not installed (Debian: opencl-c-headers)")
    command = [compiler, *flags, source, str(loader), "-lm", "-o", str(program)]
    subprocess.run(command, check=True)
    found = [f"OCL_ICD_VENDORS={libraries}{os.sep}", f"LD_LIBRARY_PATH={libraries}"]
    # As our own host does: one kernel for all sizes.
    found.append("POCL_WORK_GROUP_SPECIALIZATION=0")
    return ["env", *found, str(program), str(ROOT / "kernels_cl")]


@METHODS
@pytest.mark.parametrize(("height", "width"), [(70, 101), (8, 8), (1, 3)])
def test_c_host_computes_what_jax_does(
    host: list[str], tmp_path: Path, method: str, height: int, width: int
) -> None:
    """Odd sizes, several work-items per row; float32 on both sides, so 1e-5 of the largest."""
    rng = np.random.default_rng(0)
    y, x = np.mgrid[:height, :width][..., None] / 40
    guides = np.concatenate([np.sin(x), np.cos(y), x * y, x + 2, np.sin(3 * x + y)], axis=-1)
    light = (1 + guides[..., :3] ** 2) * rng.exponential(size=(height, width, 3))
    light, guides = light.astype(np.float32), guides.astype(np.float32)
    found = denoised(host, tmp_path, method, light, guides)
    regress = {"flr": jflnr.flr, "flr-adaptive": jflnr.flr_adaptive}[method]
    expected = np.asarray(jax.jit(regress)(light, guides))
    assert np.abs(found - expected).max() < 1e-5 * np.abs(expected).max()


@METHODS
@pytest.mark.parametrize("backend", jflnr.BACKENDS)
def test_c_host_computes_what_denoise_does(
    host: list[str], tmp_path: Path, frame: jflnr.Frame, backend: str, method: str
) -> None:
    default = method_of(method)
    names, inputs = prepare(frame, None, default)
    guides = np.concatenate(default.images(inputs, names)["guides"], axis=-1).astype(np.float32)
    light = np.asarray(frame.indirect, np.float32)
    found = denoised(host, tmp_path, method, light, guides)
    expected = np.asarray(jflnr.denoise(frame, method, backend=backend))
    assert np.abs(found - expected).max() < 1e-5 * np.abs(expected).max()


def denoised(
    host: list[str], folder: Path, method: str, light: np.ndarray, guides: np.ndarray
) -> np.ndarray:
    for name, image in (("light", light), ("guides", guides)):
        image.tofile(folder / f"{name}.raw")
    files = [str(folder / f"{name}.raw") for name in ("light", "guides", "denoised")]
    height, width = light.shape[:2]
    subprocess.run([*host, method, str(width), str(height), *files], check=True)
    return np.fromfile(files[2], np.float32).reshape(light.shape)


@METHODS
def test_the_page_has_what_is_launched(method: str) -> None:
    try:
        printed = tables(launches(method, 640, 360))
    except NoDevice as error:
        pytest.skip(str(error))
    assert printed in (ROOT / "docs" / "opencl_engine.md").read_text()


def test_every_parameter_has_a_name_and_an_argument() -> None:
    """Also those that macros stand for, one in another."""
    try:
        found = launches("flnr-small", 32, 32) + launches("flr", 32, 32, over_time=True)
    except NoDevice as error:
        pytest.skip(str(error))
    for launch in found:
        assert len(parameters(launch)) >= len(launch.arguments), launch.kernel
    (said,) = [launch for launch in found if launch.file == "network/features.cl"]
    assert dict(zip(parameters(said), said.arguments, strict=True))["error"].shape == (32, 32, 1)


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        ([], 2, "use: host KERNELS_CL flr|flr-adaptive WIDTH HEIGHT"),
        (["bmfr", "8", "8", "short", "short", "out"], 2, "use: host"),
        (["flr", "0", "8", "short", "short", "out"], 2, "WIDTH must be a whole number from 1 to"),
        (["flr", "8", "8x", "short", "short", "out"], 2, "HEIGHT must be a whole number from 1 to"),
        (["flr", "8", "8", "short", "short", "out"], 1, "short does not hold 192 floats"),
        (["flr", "1", "1", "long", "long", "out"], 1, "long does not hold 3 floats"),
        (["flr", "1", "1", "missing", "long", "out"], 1, "missing does not hold 3 floats"),
    ],
)
def test_c_host_says_what_is_wrong(
    host: list[str], tmp_path: Path, arguments: list[str], code: int, said: str
) -> None:
    (tmp_path / "short").write_bytes(b"1234")
    (tmp_path / "long").write_bytes(bytes(4 * 192))
    done = subprocess.run(
        [*host, *arguments], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == code and done.stderr.startswith(said)
    assert done.stderr.count("\n") == 1 and not (tmp_path / "out").exists()
