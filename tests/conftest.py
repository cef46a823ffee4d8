"""What tests share: where the real frames are, and a small made-up one."""

import gc
import os
from collections.abc import Iterator
from pathlib import Path

import jax
import numpy as np
import pytest

from jflnr.__main__ import quickly
from jflnr.frame import Frame, write_frame
from jflnr.methods import BACKENDS


def pytest_configure(config: pytest.Config) -> None:
    # jaxopt says on import that it is no longer developed; we pin its last release knowingly.
    config.addinivalue_line("filterwarnings", "ignore:JAXopt is no longer:DeprecationWarning")
    # Tests wait for the compiler, not for what it makes; so do the processes that they start.
    quick = f"--xla_backend_optimization_level=0 {quickly()}"
    os.environ["XLA_FLAGS"] = f"{os.environ.get('XLA_FLAGS', '')} {quick}"
    # Many tests need the same programs, and those of FLNR take a minute to compile: workers and
    # later runs take them from a folder. Processes that tests start find it in their environment.
    kept = Path(__file__).parents[1] / "cache" / "programs"
    os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(kept / "jax"))
    os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.2")
    os.environ.setdefault("POCL_CACHE_DIR", str(kept / "pocl"))
    Path(os.environ["POCL_CACHE_DIR"]).mkdir(parents=True, exist_ok=True)
    jax.config.update("jax_compilation_cache_dir", os.environ["JAX_COMPILATION_CACHE_DIR"])
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.2)
    # Of each program that is kept XLA says at length which features the machine has.
    os.environ["TF_CPP_MIN_LOG_LEVEL"] = "3"


@pytest.fixture(autouse=True, scope="module")
def few_programs() -> Iterator[None]:
    """Forget compiled programs when there are many.

    Each takes some mappings of memory, of which Linux lets a process have 65 530; the compiler
    crashes without a word when it gets no more.
    """
    yield
    mappings = Path("/proc/self/maps")
    if mappings.exists() and mappings.read_bytes().count(b"\n") > 20_000:
        jax.clear_caches()
        gc.collect()


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of real frames; the test is skipped where it is absent."""
    beside = Path(__file__).parents[2] / "shared" / "data"
    folder = Path(os.environ.get("JFLNR_DATA", beside))
    if not folder.is_dir():
        pytest.skip(f"the real frames are not here: {folder} (set JFLNR_DATA)")
    return folder


@pytest.fixture
def frame() -> Frame:
    """A frame of 40 x 24 with every layer, whose light is smooth and whose noise is strong."""
    rng = np.random.default_rng(0)
    y, x = np.mgrid[:24, :40].astype(np.float32)[..., None] / 40

    def image(*layers: np.ndarray) -> np.ndarray:
        return np.concatenate(np.broadcast_arrays(*layers), axis=-1).astype(np.float16, copy=False)

    light = image(1 + x, 1 + y, 1.5 - x * y)
    half = light * rng.gamma(100, 1 / 100, light.shape)
    layers = {
        "indirect": light * rng.exponential(size=light.shape),
        "albedo": image(0.2 + 0.5 * x, 0.5 + 0 * x, 0.3 + 0.4 * y),
        "normal": image(0 * x, 0 * x, 1 + 0 * x),
        "depth": 2 + x,
        "position": image(x, y, 2 + x),
        "ao": 0.5 + 0.5 * x,
        "mask": 1 + 0 * x,
        "emission": image(0 * x, 0.1 + 0 * x, 0 * x),
        "direct": image(x, y, x * y),
        "reference": light,
        "reference_a": half,
        "motion": image(0 * x, 0 * x - 1),
    }
    # Through half precision, as a file stores them, so that what is read is what was written.
    return Frame(
        **{
            name: layer.astype(np.float32 if name == "depth" else np.float16).astype(np.float32)
            for name, layer in layers.items()
        }
    )


@pytest.fixture(params=BACKENDS)
def backend(request: pytest.FixtureRequest) -> str:
    """Each of them that is installed."""
    if request.param == "opencl":
        pytest.importorskip("pyopencl")
    return request.param


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(1)


@pytest.fixture
def frame_file(tmp_path: Path, frame: Frame) -> Path:
    """The same frame as a file."""
    path = tmp_path / "frame.exr"
    write_frame(path, frame, header={"scene": "made up", "view": 0})
    return path
