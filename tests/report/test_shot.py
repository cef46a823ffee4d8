"""A shot in the page: its frames at their rate, and the warped error of each."""

import dataclasses
import json
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from jflnr import exr
from jflnr.cli import main
from jflnr.frame import Frame, write_frame
from jflnr.metrics import display, exposure, reflected
from jflnr.report import shot as shots
from jflnr.report.shot import collect_shot, shot_data
from tests.layouts.blender_passes import passes
from tests.report.pages import check_axe, opened, press, settle
from tests.report.test_scenes import write_output

WIDE = {"width": 1280, "height": 800}
# Brightness of the denoised light in each frame; of the reference it does not change.
FLICKER = (0.5, 0.6, 0.5)
NAMES = ("f_2.exr", "f_9.exr", "f_10.exr")


@pytest.fixture
def folder(tmp_path: Path, frame: Frame) -> Path:
    """`shot` and `clean` of a camera that stands still, at 30 frames a second."""
    still = dataclasses.replace(frame, motion=np.zeros((*frame.normal.shape[:2], 2), np.float32))
    (tmp_path / "shot").mkdir()
    for name, share in zip(NAMES, FLICKER, strict=True):
        path = tmp_path / "shot" / name
        write_frame(path, still)
        exr.write_channels(path, exr.read_channels(path), others={"framesPerSecond": Fraction(30)})
        write_output(tmp_path / "clean" / name, share * np.asarray(still.reference))
    return tmp_path


@pytest.fixture
def command(folder: Path) -> Callable[..., int]:
    """Reports `shot` and `clean`, or other folders."""

    def run(*options: object, inputs: tuple[str, ...] = ("shot", "clean")) -> int:
        paths = [folder / name for name in inputs]
        line = ["report", *paths, "--temporal", "-o", folder / "shot.html", *options]
        return main([str(part) for part in line])

    return run


@pytest.fixture
def page(browser: Any, folder: Path, command: Callable[..., int]) -> Iterator[Any]:
    """The shot's page, for someone who wants less motion."""
    assert command() == 0
    url = (folder / "shot.html").as_uri()
    with opened(browser, url, viewport=WIDE, offline=True, reduced_motion="reduce") as page:
        page.wait_for_selector("#images li")
        settle(page)
        yield page


def luminances(frame: Frame) -> list[np.ndarray]:
    """Of the denoised frames as displayed, at the exposure of the references, `(H, W)`."""
    lights = [reflected(frame, share * np.asarray(frame.reference)) for share in FLICKER]
    scale = exposure(reflected(frame, frame.reference))
    return [display(light, scale) @ [0.2126, 0.7152, 0.0722] for light in lights]


def colour(page: Any) -> np.ndarray:
    """What the canvas shows a quarter of the way into the picture on the left."""
    script = """(() => { const canvas = document.getElementById("canvas");
      const [x, y] = [(10.5 - state.x) * state.zoom, (12.5 - state.y) * state.zoom];
      return [...canvas.getContext("2d").getImageData(x + canvas.clientWidth / 2,
        y + canvas.clientHeight / 2, 1, 1).data]; })()"""
    return np.array(page.evaluate(script)[:3], float)


def test_frames_are_those_of_the_metrics_with_their_warped_error(page: Any, frame: Frame) -> None:
    """Frames in natural order; where nothing moves, the error is the change of luminance."""
    shown, (scale, names) = (
        luminances(frame),
        page.evaluate("[state.scene.exposures.reflected, state.scene.images.map(i => i.name)]"),
    )
    assert names == ["noisy", "clean", "reference"]
    assert scale == pytest.approx(exposure(reflected(frame, frame.reference)), rel=1e-3)
    values = page.locator("#images .value")
    assert values.all_inner_texts() == ["warped error \u2013"] * 3
    for index in range(3):
        light = FLICKER[index] * reflected(frame, frame.reference)[12, 10]
        np.testing.assert_allclose(colour(page), 255 * display(light, scale), atol=1.5)
        assert page.inner_text("#place") == NAMES[index]
        assert page.inner_text("#frame-text") == f"{index + 1} of 3, 30 a second"
        if index:
            expected = np.abs(shown[index] - shown[index - 1])[np.asarray(frame.mask)[..., 0] > 0]
            found = float(values.nth(1).inner_text().removeprefix("warped error "))
            assert found == pytest.approx(expected.mean(), rel=1e-2)
            assert float(values.nth(2).inner_text().split()[-1]) < 1e-3
        press(page, ".")
    assert page.evaluate("state.frame") == 0  # counted round
    press(page, ",")
    assert page.evaluate("state.frame") == 2


def test_it_is_played_by_key_button_and_slider(page: Any) -> None:
    playing = lambda: page.evaluate("Boolean(state.playing)")
    assert not playing() and page.inner_text("#play") == "Play"
    press(page, " ")
    assert playing() and page.inner_text("#play") == "Pause"
    page.wait_for_function("state.frame === 2")
    page.wait_for_function("state.frame === 1")  # from the beginning again
    page.click("#play")
    settle(page)
    assert not playing()
    page.focus("#frame")
    page.evaluate("setFrame(0)")
    settle(page)
    press(page, "ArrowRight")
    assert page.evaluate("state.frame") == 1 and not playing()
    press(page, " ")
    page.focus("#play")
    press(page, " ")  # presses the button
    assert not playing()
    press(page, "e", "v", "t", "m", "l", "c", "r")
    assert page.locator("#tone").is_hidden() and page.locator("#map").is_hidden()


def test_it_plays_by_itself_on_a_phone(
    browser: Any, folder: Path, command: Callable[..., int]
) -> None:
    assert command() == 0
    size = {"width": 390, "height": 844}
    with opened(browser, (folder / "shot.html").as_uri(), viewport=size) as page:
        page.wait_for_function("state.frame === 2")
        assert page.evaluate("document.documentElement.scrollWidth") <= 390


def test_no_serious_finding_of_axe(page: Any) -> None:
    check_axe(page)
    press(page, " ")
    check_axe(page)


def test_wide_frames_are_made_smaller(
    folder: Path, monkeypatch: pytest.MonkeyPatch, browser: Any, command: Callable[..., int]
) -> None:
    monkeypatch.setattr(shots, "WIDEST", 13)
    assert command() == 0
    with opened(browser, (folder / "shot.html").as_uri()) as page:
        page.wait_for_selector("#images li")
        size = "[state.scene, state.left.frames[0]].map(s => [s.width, s.height])"
        assert page.evaluate(size) == [[10, 6], [10, 6]]


def test_pictures_of_other_programs_and_plain_ones(tmp_path: Path, frame: Frame) -> None:
    """They have no warped error where motion is not known, and 24 frames a second."""
    for name in ("a.exr", "b.exr"):
        write_output(tmp_path / "clean" / name, frame.albedo, layer="")
        write_output(tmp_path / "other" / name, frame.albedo, layer="")
        (tmp_path / "shot").mkdir(exist_ok=True)
        exr.write_channels(tmp_path / "shot" / name, passes(frame))
    for first in ("shot", "other"):
        paths = [tmp_path / f / name for f in ("clean", first) for name in ("a.exr", "b.exr")]
        data = shot_data(collect_shot(paths, 1))
        assert (data["rate"], data["frames"]) == (24, ["a.exr", "b.exr"])
        versions = {image["name"]: image["warped"] for image in data["images"]}
        assert versions.keys() == {"clean", "noisy" if first == "shot" else "other"}
        assert data["name"] == ("shot" if first == "shot" else "clean")


@pytest.mark.parametrize(
    ("case", "said"),
    [
        ("missing", "f_9.exr is missing"),
        ("two shots", "both hold frames"),
        ("too large", "larger than 0 MB"),
        ("reference", "--map reference="),
        ("sizes", "one size"),
        ("versions", "not those of the first frame"),
    ],
)
def test_what_makes_no_shot_is_said_in_one_sentence(
    case: str,
    said: str,
    folder: Path,
    frame: Frame,
    command: Callable[..., int],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    options, inputs = [], ("shot", "clean")
    if case == "missing":
        (folder / "clean" / NAMES[1]).unlink()
    elif case == "two shots":
        (folder / "shot").rename(folder / "one")
        (folder / "two").symlink_to(folder / "one")
        inputs = ("one", "two")
    elif case == "too large":
        monkeypatch.setattr(shots, "LIMIT", 5000)
    elif case == "reference":
        options = ["--reference", folder / "clean" / NAMES[0]]
    elif case == "sizes":
        write_output(folder / "clean" / NAMES[1], frame.indirect[1:])
    elif case == "versions":
        write_frame(folder / "shot" / NAMES[1], dataclasses.replace(frame, reference=None))
    assert command(*options, inputs=inputs) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1
    assert not (folder / "shot.html").exists()


@pytest.mark.parametrize("noisy", ["indirect_1", "beauty_1"])
def test_motion_comes_from_cameras(noisy: str, folder: Path, frame: Frame) -> None:
    """Also of whole pictures; here neither moves nor changes."""
    camera = {"camera_to_world": np.eye(4).tolist(), "fov_x_degrees": 60}
    paths = [folder / "shot" / name for name in NAMES]
    for path in paths:
        write_frame(path, dataclasses.replace(frame, motion=None), header=camera)
        channels = exr.read_channels(path)
        for name, old in (
            (noisy, "reference"),
            ("seen_albedo_1", "albedo"),
            ("normal_1", "normal"),
        ):
            copied = [n for n in channels if n.startswith(f"{old}.")]
            channels |= {n.replace(old, name): channels[n] for n in copied}
        exr.write_channels(path, channels, json.dumps(camera))
    first, *_ = shot_data(collect_shot(paths, 1))["images"]
    assert first["warped"][0] is None and first["warped"][1:] == pytest.approx((0, 0), abs=1e-3)
