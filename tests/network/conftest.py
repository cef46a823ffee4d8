"""A small scene with the guides that the network reads, and weights that do something."""

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import jax
import numpy as np
import pytest

from jflnr import exr
from jflnr.frame import Frame, write_frame
from jflnr.network.examples import prepared
from jflnr.network.flnr import init

if TYPE_CHECKING:
    from jflnr.network.train import Settings

WIDTHS = (4, 4, 4)


class Scene(NamedTuple):
    target: np.ndarray
    guides: np.ndarray


def scene_of(height: int, width: int) -> Scene:
    """A wall and a floor under light that grows to one side, one noisy sample per pixel."""
    random = np.random.default_rng(5)
    y, x = np.mgrid[:height, :width].astype(np.float32)[..., None]
    wall = y < 0.6 * height
    normal = np.where(wall, [0, 0, 1.0], [0, 1.0, 0])
    depth = 1 + 0.01 * x + 0.2 * ~wall
    ao = np.clip(np.abs(y - 0.6 * height) / height + 0.3, 0, 1) + 0 * x
    mean = (0.3 + x / width) * ao * [1, 0.8, 0.6]
    target = mean * random.exponential(size=(height, width, 1))
    guides = np.concatenate([normal, depth, ao], axis=-1)
    return Scene(target.astype(np.float32), guides.astype(np.float32))


@pytest.fixture(scope="session")
def scene() -> Scene:
    return scene_of(37, 50)


@pytest.fixture(scope="session")
def params() -> dict[str, jax.Array]:
    """Random weights, also where training starts from zero."""
    start = init(jax.random.key(0), WIDTHS)
    keys = jax.random.split(jax.random.key(1), len(start))
    noise = (0.1 * jax.random.normal(k, start[n].shape) for k, n in zip(keys, start, strict=True))
    return {name: start[name] + more for name, more in zip(start, noise, strict=True)}


@pytest.fixture
def frames(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Two small frames as training reads them, with two noisy layers and a target."""
    monkeypatch.setattr("jflnr.network.examples.CROP", 32)
    made = scene_of(32, 48)
    noisy = np.random.default_rng(1).permutation(made.target)
    frame = Frame(
        indirect=made.target,
        albedo=np.full((32, 48, 3), 0.5, np.float32),
        normal=made.guides[..., :3],
        depth=made.guides[..., 3:4],
        ao=made.guides[..., 4:],
        reference=made.target.mean() + 0 * made.target,
    )
    paths = [tmp_path / f"scene{number}_100.exr" for number in (1, 2)]
    for number, path in enumerate(paths, 1):
        write_frame(path, frame)
        channels = exr.read_channels(path)
        more = {f"indirect_1_b.{c}": noisy[..., i] for i, c in enumerate("RGB")}
        more |= {f"target.{c}": channels[f"reference.{c}"] * number for c in "RGB"}
        exr.write_channels(path, channels | more)
    return paths


@pytest.fixture
def records(frames: list[Path], tmp_path: Path) -> list[np.ndarray]:
    return [prepared(path, tmp_path / "prepared") for path in frames]


@pytest.fixture
def settings() -> "Settings":
    from jflnr.network.train import Settings

    return Settings(widths=WIDTHS, batch=2, every=2)
