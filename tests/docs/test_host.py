"""The C example of docs/opencl_engine.md, compiled and run against PoCL, is FLR as in JAX."""

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import jflnr
from docs.launches import launches, parameters, tables
from jflnr.images.inputs import prepare
from jflnr.opencl import NoDevice
from jflnr.regression.flr import DEFAULT, flr

ROOT = Path(__file__).parents[2]


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
    return ["env", *found, str(program), str(ROOT / "kernels_cl")]


def test_c_host_computes_what_jax_does(host: list[str], tmp_path: Path) -> None:
    """Odd sizes, several work-items per row; float32 on both sides, so 1e-5 of the largest."""
    rng, height, width = np.random.default_rng(0), 70, 101
    y, x = np.mgrid[:height, :width][..., None] / 40
    guides = np.concatenate([np.sin(x), np.cos(y), x * y, x + 2, np.sin(3 * x + y)], axis=-1)
    light = (1 + guides[..., :3] ** 2) * rng.exponential(size=(height, width, 3))
    light, guides = light.astype(np.float32), guides.astype(np.float32)
    found = denoised(host, tmp_path, light, guides)
    expected = np.asarray(flr(light, guides, DEFAULT))
    assert np.abs(found - expected).max() < 1e-5 * np.abs(expected).max()


@pytest.mark.parametrize("backend", jflnr.BACKENDS)
def test_c_host_computes_what_denoise_does(
    host: list[str], tmp_path: Path, frame: jflnr.Frame, backend: str
) -> None:
    names, inputs = prepare(frame, None, DEFAULT)
    guides = np.concatenate(DEFAULT.images(inputs, names)["guides"], axis=-1).astype(np.float32)
    found = denoised(host, tmp_path, np.asarray(frame.indirect, np.float32), guides)
    expected = np.asarray(jflnr.denoise(frame, "flr", backend=backend))
    assert np.abs(found - expected).max() < 1e-5 * np.abs(expected).max()


def denoised(host: list[str], folder: Path, light: np.ndarray, guides: np.ndarray) -> np.ndarray:
    for name, image in (("light", light), ("guides", guides)):
        image.tofile(folder / f"{name}.raw")
    files = [str(folder / f"{name}.raw") for name in ("light", "guides", "denoised")]
    height, width = light.shape[:2]
    subprocess.run([*host, str(width), str(height), *files], check=True)
    return np.fromfile(files[2], np.float32).reshape(light.shape)


@pytest.mark.parametrize("method", ["flr", "flr-adaptive"])
def test_the_page_has_what_is_launched(method: str) -> None:
    try:
        printed = tables(launches(method, 640, 360))
    except NoDevice as error:
        pytest.skip(str(error))
    assert printed in (ROOT / "docs" / "opencl_engine.md").read_text()


def test_every_parameter_has_a_name_and_an_argument() -> None:
    """Also those that macros stand for, one in another."""
    try:
        found = launches("flnr-small", 32, 32)
    except NoDevice as error:
        pytest.skip(str(error))
    for launch in found:
        assert len(parameters(launch)) >= len(launch.arguments), launch.kernel
    (said,) = [launch for launch in found if launch.file == "network/features.cl"]
    assert dict(zip(parameters(said), said.arguments, strict=True))["error"].shape == (32, 32, 1)


def test_c_host_says_what_is_wrong(host: list[str], tmp_path: Path) -> None:
    done = subprocess.run([*host], capture_output=True, text=True, check=False)
    assert done.returncode == 2 and done.stderr.startswith("use: host KERNELS_CL")
    short = tmp_path / "short.raw"
    short.write_bytes(b"1234")
    done = subprocess.run(
        [*host, "8", "8", str(short), str(short), "out.raw"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1 and "does not hold 192 floats" in done.stderr
