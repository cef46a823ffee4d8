"""Files that the real Mitsuba 3 wrote, whole and split, and Mitsuba with jflnr in the loop."""

from __future__ import annotations

import runpy
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from jflnr import exr, layouts
from jflnr.frame import composite, read_frame

mi = pytest.importorskip("mitsuba", reason="these tests need Mitsuba 3: pip install mitsuba")

from experiments.rendering import backend  # noqa: E402

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    backend.start()

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "mitsuba_in_the_loop.py"
NAMES = "albedo:albedo,{}:sh_normal,{}:depth,pos:position,uv:uv,shape:shape_index"


def room(integrator: dict[str, Any], side: int = 32) -> Any:
    film = {"type": "hdrfilm", "width": side, "height": side, "rfilter": {"type": "box"}}
    scene = mi.cornell_box() | {"integrator": integrator}
    scene["sensor"] = scene["sensor"] | {"film": film | {"component_format": "float32"}}
    return mi.load_dict(scene)


def aov(normal: str, depth: str) -> dict[str, Any]:
    lamps = {"type": "path", "max_depth": 1}
    aovs = {"type": "aov", "aovs": NAMES.format(normal, depth)}
    return aovs | {"image": {"type": "path"}, "emission": lamps}


@pytest.fixture(scope="module", params=[("nn", "dd.y"), ("sh_normal", "depth")])
def written(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file as `mitsuba scene.xml` writes it, and beside it one file for each layer."""
    scene = room(aov(*request.param))
    mi.render(scene, spp=1)
    path = tmp_path_factory.mktemp("mitsuba") / "room.exr"
    bitmap = scene.sensors()[0].film().bitmap()
    bitmap.write(str(path))
    for name, part in bitmap.split():
        part.write(str(path.with_name("room_" + name.strip("<>") + ".exr")))
    return path


def picture(path: Path) -> np.ndarray:
    channels = exr.read_channels(path)
    return np.stack([channels[c] for c in "RGB"], -1).astype(np.float32)


def test_layers_are_found(written: Path) -> None:
    frame, channels = read_frame(written), exr.read_channels(written)
    assert layouts.load(written).layout.program == "Mitsuba"
    (distance,) = (pixels for name, pixels in channels.items() if name.endswith(".T"))
    np.testing.assert_array_equal(frame.depth[..., 0], distance)
    np.testing.assert_array_equal(frame.position[..., 2], channels["pos.Z"])
    lengths = np.linalg.norm(frame.normal, axis=-1)[frame.mask[..., 0] > 0]
    np.testing.assert_allclose(lengths, 1, atol=1e-5)


def test_the_composite_is_the_picture_if_nothing_is_denoised(written: Path) -> None:
    frame = read_frame(written)
    np.testing.assert_allclose(composite(frame, frame.indirect), picture(written), rtol=1e-5)


def test_light_is_divided_by_albedo_without_the_lamps(written: Path) -> None:
    frame, channels = read_frame(written), exr.read_channels(written)
    lamps = np.stack([channels[f"emission.{c}"] for c in "RGB"], -1)
    assert lamps.max() > 1
    bright = frame.albedo > 0.01
    expected = (picture(written) - lamps)[bright] / frame.albedo[bright]
    np.testing.assert_allclose(frame.indirect[bright], expected, rtol=1e-5, atol=1e-6)


def test_one_file_for_each_layer(written: Path) -> None:
    """Mitsuba's `Bitmap.split`, each part in a file of its own."""
    names = layouts.load(written).layout.channels
    chosen = {n: exr.layer_of(names[n][0]) for n in ("albedo", "normal", "depth", "emission")}
    mapped = {layer: f"room_{name}.exr" for layer, name in chosen.items()} | {"beauty": "R,G,B"}
    whole = read_frame(written)
    parts = read_frame(written.with_name("room_root.exr"), layers=mapped)
    for layer in ("indirect", "albedo", "normal", "depth", "emission"):
        expected = getattr(whole, layer)
        np.testing.assert_allclose(getattr(parts, layer), expected, rtol=1e-3, atol=1e-4)


def test_the_example_in_the_loop() -> None:
    """One sample per pixel, denoised, is much nearer to the converged picture than before."""
    example = runpy.run_path(str(EXAMPLE))
    scene = room(example["INTEGRATOR"], side=48)
    clean = np.array(example["render_clean"](scene))
    noisy, converged = (np.array(mi.render(scene, spp=n, seed=1))[..., :3] for n in (1, 256))
    assert clean.shape == (48, 48, 3)

    def error(image: np.ndarray) -> float:
        shown, wanted = (np.clip(x, 0, 1) ** (1 / 2.2) for x in (image, converged))
        return float(np.mean((shown - wanted) ** 2))

    assert error(clean) < 0.5 * error(noisy)
