"""The page in a browser: what is on the canvas must be what was measured."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from jflnr.frame import composite
from jflnr.metrics import exposure
from jflnr.report.scenes import Scene
from tests.report.pages import check_axe, opened, press, settle

WIDE = {"width": 1280, "height": 800}


@pytest.fixture
def page(browser: Any, report: Path) -> Iterator[Any]:
    """The page, opened from a file without a network."""
    with opened(browser, report.as_uri(), viewport=WIDE, offline=True) as page:
        page.wait_for_selector("#images li")
        settle(page)
        yield page


def shown(page: Any, x: int, y: int) -> np.ndarray:
    """The colour on the canvas in the middle of pixel (x, y) of the image."""
    script = """([x, y]) => {
      const canvas = document.getElementById("canvas"), { zoom } = state;
      const at = (v, middle, size) => Math.floor((v + 0.5 - middle) * zoom + size / 2);
      return [...canvas.getContext("2d").getImageData(at(x, state.x, canvas.clientWidth),
        at(y, state.y, canvas.clientHeight), 1, 1).data].slice(0, 3);
    }"""
    return np.array(page.evaluate(script, [x, y]), float)


def displayed(scene: Scene, name: str, stops: float = 0) -> np.ndarray:
    """What a screen must show, 0..255, by the rule of the metrics."""
    scale = exposure(scene.radiance(scene.images["reference"])) * 2**stops
    light = np.nan_to_num(scene.radiance(scene.images[name]), posinf=1e9)
    return 255 * np.clip(light * scale, 0, 1) ** (1 / 2.2)


def test_pixels_are_those_of_the_metrics(page: Any, scene: Scene) -> None:
    """Left of the line one image, right the other; exposure in stops; NaN black, infinity white."""
    half, reference = displayed(scene, "half"), displayed(scene, "reference")
    for x, y in ((3, 4), (16, 20)):
        np.testing.assert_allclose(shown(page, x, y), half[y, x], atol=1)
    for x, y in ((23, 4), (36, 20)):
        np.testing.assert_allclose(shown(page, x, y), reference[y, x], atol=1)
    press(page, "E", "E", "E", "e")
    np.testing.assert_allclose(shown(page, 3, 4), displayed(scene, "half", 1)[4, 3], atol=1)
    press(page, "r", "3")
    np.testing.assert_allclose(shown(page, 7, 5)[1:], (0, 255))


def test_whole_picture_is_the_composite(page: Any, scene: Scene) -> None:
    """albedo * (direct + indirect) + emission."""
    frame, half = scene.frame, scene.images["half"]
    assert frame is not None and frame.direct is not None
    reflected = scene.radiance(scene.images["reference"] + frame.direct)
    wanted = [composite(frame, scene.images["reference"]), composite(frame, half)]
    press(page, "v", "4", "Shift+Digit2")
    for picture, (x, y) in zip(wanted, ((3, 4), (36, 20)), strict=True):
        shade = 255 * np.clip(np.asarray(picture) * exposure(reflected), 0, 1) ** (1 / 2.2)
        np.testing.assert_allclose(shown(page, x, y), shade[y, x], atol=1)


def test_slider_and_keys_choose_what_is_shown(page: Any, scene: Scene) -> None:
    noisy, half = displayed(scene, "noisy"), displayed(scene, "half")
    press(page, "1", "Shift+Digit2")
    np.testing.assert_allclose(shown(page, 10, 12), noisy[12, 10], atol=1)
    np.testing.assert_allclose(shown(page, 30, 12), half[12, 30], atol=1)
    box = page.locator("#divider").bounding_box()
    stage = page.locator("#stage").bounding_box()
    page.mouse.move(box["x"] + 16, box["y"] + 50)
    page.mouse.down()
    page.mouse.move(stage["x"] + 0.9 * stage["width"], box["y"] + 60, steps=3)
    page.mouse.up()
    settle(page)
    np.testing.assert_allclose(shown(page, 30, 12), noisy[12, 30], atol=1)
    assert page.get_attribute("#divider", "aria-valuenow") == "90"
    press(page, "x")
    np.testing.assert_allclose(shown(page, 30, 12), half[12, 30], atol=1)
    press(page, "ArrowRight", "ArrowRight", "l", "l")  # half -> nearly -> reference; one image
    assert page.input_value("#layout") == "single"
    np.testing.assert_allclose(shown(page, 30, 12), displayed(scene, "reference")[12, 30], atol=1)


def test_zoom_keeps_the_pixel_under_the_pointer(page: Any, scene: Scene) -> None:
    box = page.locator("#canvas").bounding_box()
    page.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + 0.6 * box["height"])
    settle(page)
    before = page.inner_text("#place")
    page.mouse.wheel(0, -300)
    page.wait_for_function(f"state.zoom > 1.5 * {min(box['width'] / 40, box['height'] / 24)}")
    settle(page)
    assert page.inner_text("#place") == before
    x, y = map(int, before.removeprefix("pixel ").split(", "))
    np.testing.assert_allclose(shown(page, x, y), displayed(scene, "half")[y, x], atol=1)
    value = page.locator("#images .value").nth(1).inner_text().split()
    light = scene.radiance(scene.images["half"])[y, x]
    np.testing.assert_allclose(np.float64(value[:3]), light, rtol=1e-3)
    press(page, "f")
    assert page.evaluate("state.x") == 20


def test_all_panes_show_the_same_place(page: Any) -> None:
    page.select_option("#layout", "grid")
    settle(page)
    script = "panes().map(p => toImage(p.x + 0.25 * p.width, p.y + 0.5 * p.height))"
    for _ in range(2):
        places = np.array(page.evaluate(script))
        assert len(places) == 4 and np.ptp(places, axis=0).max() < 1e-6
        page.evaluate("zoomAt(30, 40, 3)")
        settle(page)


def test_maps_average_to_the_metrics(page: Any, scene: Scene) -> None:
    """The error map is the one whose mean the table gives, and has a colour bar."""
    expected = scene.measure("half")
    mean = page.evaluate(
        "(() => { const e = errorOf(state.scene, state.scene.images[1]);"
        "return e.reduce((a, b) => a + b) / e.length; })()"
    )
    assert mean == pytest.approx(expected["rmse"], rel=2e-3)
    assert page.locator("#bar").is_hidden()
    press(page, "m")
    assert page.locator("#bar").is_visible()
    darkest, brightest = page.evaluate("[magma(0), magma(1)]")
    assert sum(darkest) < 10 and sum(brightest) > 600
    if expected["flip"] is not None:
        mean = page.evaluate(
            "state.scene.images[1].maps.flip.reduce((a, b) => a + b) / 40 / 24 / 255"
        )
        assert mean == pytest.approx(expected["flip"], abs=2e-3)


def test_tables_sort(page: Any) -> None:
    table = page.locator("#tables table")
    first = lambda: table.locator("tbody tr td:first-child").all_inner_texts()
    table.locator("th button", has_text="PSNR").click()
    assert first() == ["good", "fast", "poor"]
    table.locator("th button", has_text="PSNR").click()
    assert first() == ["poor", "fast", "good"]
    table.locator("th button", has_text="FLIP").click()
    assert first() == ["fast", "good", "poor"]  # what has no number comes last
    page.locator("#metrics tbody button", has_text="nearly").click()
    settle(page)
    assert page.evaluate("state.left.name") == "nearly"


def test_chart_names_the_front(page: Any) -> None:
    points = "Chart.getChart('chart-canvas').data.datasets.at(-1).data.map(p => p.name)"
    assert page.evaluate(points) == ["fast", "good"]


def test_scenes_crops_and_help(page: Any) -> None:
    assert page.title() == "A <b>title</b> & more"
    rows = page.locator(".crop")
    before = rows.count()
    press(page, "c")
    assert rows.count() == before + 1
    rows.last.locator(".remove").click()
    assert rows.count() == before
    press(page, "ArrowDown")
    page.wait_for_function("state.scene.name === 'plain'")
    settle(page)
    assert page.evaluate("[state.left.name, state.scene.width]") == ["half", 20]
    press(page, "?")
    assert page.locator("#help").is_visible()
    assert "swap left and right" in page.inner_text("#help")


def test_two_fingers_zoom_on_a_phone(browser: Any, report: Path) -> None:
    context = browser.new_context(viewport={"width": 390, "height": 844}, has_touch=True)
    page = context.new_page()
    page.goto(report.as_uri())
    page.wait_for_selector("#images li")
    settle(page)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    before = page.evaluate("state.zoom")
    box = page.locator("#canvas").bounding_box()
    x, y = box["x"] + box["width"] / 4, box["y"] + box["height"] / 2
    touch = context.new_cdp_session(page)
    for kind, apart in (("touchStart", 20), ("touchMove", 40), ("touchMove", 60), ("touchEnd", 0)):
        points = [{"x": x - apart, "y": y, "id": 0}, {"x": x + apart, "y": y, "id": 1}]
        touch.send(
            "Input.dispatchTouchEvent",
            {"type": kind, "touchPoints": [] if kind == "touchEnd" else points},
        )
    settle(page)
    assert page.evaluate("state.zoom") == pytest.approx(3 * before, rel=0.05)
    context.close()


def test_no_serious_finding_of_axe(page: Any) -> None:
    for prepare in ("", "m", "?"):
        press(page, *filter(None, [prepare]))
        check_axe(page)
