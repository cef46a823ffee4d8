"""`jflnr view` in a browser and at its door: what it shows, follows, refuses and leaves behind."""

import http.client
import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import jflnr
from jflnr.cli import main
from jflnr.methods import method_of
from tests.report.pages import check_axe, opened

READY = "#versions tbody tr:nth-child({})"


class Viewed:
    """A running `jflnr view` of a folder."""

    def __init__(self, folder: Path) -> None:
        command = [sys.executable, "-m", "jflnr", "view", str(folder)]
        programs = {"JAX_COMPILATION_CACHE_DIR": str(folder.parent / "programs")}
        self.process = subprocess.Popen(
            command,
            env=os.environ | programs,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert self.process.stdout is not None
        self.url = self.process.stdout.readline().partition(" ")[0]
        self.host = self.url.removeprefix("http://").rstrip("/")

    def get(self, path: str, method: str = "GET", **headers: str) -> tuple[int, Any]:
        connection = http.client.HTTPConnection(self.host, timeout=120)
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        connection.request(method, path, headers=named)
        answer = connection.getresponse()
        return answer.status, answer.read().decode()

    def end(self) -> tuple[int, str]:
        self.process.send_signal(signal.SIGINT)
        _, said = self.process.communicate(timeout=30)
        return self.process.returncode, said


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "shot").mkdir()
    return tmp_path / "shot"


@pytest.fixture
def viewed(folder: Path) -> Iterator[Viewed]:
    found = Viewed(folder)
    yield found
    if found.process.poll() is None:
        found.end()


@pytest.fixture
def page(browser: Any, viewed: Viewed) -> Iterator[Any]:
    """The page of a folder without a frame."""
    size = {"width": 1280, "height": 900}
    with opened(browser, viewed.url, viewport=size, bypass_csp=True) as page:
        page.wait_for_selector("#asked")
        yield page


@pytest.fixture
def render(folder: Path, frame_file: Path) -> Callable[[str], Path]:
    """Puts a frame into the folder as a renderer does."""

    def put(name: str) -> Path:
        beside = folder / f".{name}"
        shutil.copy(frame_file, beside)
        return beside.rename(folder / name)

    return put


def light_of(page: Any, name: str) -> np.ndarray:
    """The numbers that the page has of a version, `(H, W, 3)`."""
    script = """name => { const { images, width, height } = state.scene;
      const { light } = images.find(i => i.name === name);
      return [[3, height, width], Array.from(light)]; }"""
    shape, values = page.evaluate(script, name)
    return np.reshape(values, shape).transpose(1, 2, 0)


def test_a_method_is_switched_and_a_folder_followed(
    page: Any, render: Callable[[str], Path], frame: jflnr.Frame
) -> None:
    """The page has what `denoise` gives, to half floats; time, errors and plan stand beside it."""
    render("f_2.exr")
    page.wait_for_selector(READY.format(1))
    expected = np.asarray(jflnr.denoise(frame, "flr"))
    np.testing.assert_allclose(light_of(page, "flr"), expected, rtol=2e-3, atol=2e-3)

    page.select_option("#method", "auto")
    page.select_option("#guides", label="without ao")
    page.select_option("#block", "16")
    page.click("#asked button")
    page.wait_for_selector(READY.format(2))
    name = "auto, without ao, blocks of 16 pixels"
    row = page.locator("#versions tbody tr").last
    assert name in row.inner_text() and " ms" in row.inner_text()
    assert "refined: 100% of the frame, in tiles of 64 pixels" in row.inner_text()
    assert row.locator("canvas").count() == 3
    expected = np.asarray(jflnr.denoise(frame, "auto", guides=("normal", "depth"), block=16))
    np.testing.assert_allclose(light_of(page, name), expected, rtol=2e-3, atol=2e-3)
    page.select_option("#map", "told")

    page.fill("#worth", "1")
    assert page.inner_text("#worth-text") == "100 % signal"
    page.click("#asked button")
    page.wait_for_selector(READY.format(3))
    coarse = "auto, from 100 % signal, without ao, blocks of 16 pixels"
    row = page.locator("#versions tbody tr").last.inner_text()
    assert coarse in row and "refined: 0% of the frame" in row
    method = method_of("auto", worth=1.0, block=16)
    expected = np.asarray(jflnr.denoise(frame, method, guides=("normal", "depth")))
    np.testing.assert_allclose(light_of(page, coarse), expected, rtol=2e-3, atol=2e-3)
    page.select_option("#method", "flr")
    assert page.locator("#worth").is_hidden()

    render("f_10.exr")
    page.wait_for_function("state.scene.name === 'f_10.exr' && state.left.name !== 'noisy'")
    assert page.locator("#scene option").all_inner_texts() == ["f_2.exr", "f_10.exr"]
    page.locator("#follow").uncheck()
    render("f_11.exr")
    page.wait_for_selector("#scene option:nth-child(3)", state="attached")
    assert page.evaluate("state.scene.name") == "f_10.exr"


def test_a_phone_needs_no_sideways_scrolling(
    browser: Any, viewed: Viewed, render: Callable[[str], Path]
) -> None:
    """With every control shown, and a version denoised."""
    size = {"width": 390, "height": 844}
    with opened(browser, viewed.url, viewport=size, bypass_csp=True) as page:
        render("f.exr")
        page.wait_for_selector(READY.format(1))
        page.select_option("#method", "auto")
        assert page.locator("#worth").is_visible()
        widths = "[document.documentElement, $('versions')].map(e => e.scrollWidth - e.clientWidth)"
        assert page.evaluate(widths) == [0, 0]


def test_no_serious_finding_of_axe(page: Any, render: Callable[[str], Path]) -> None:
    check_axe(page)
    render("f.exr")
    page.wait_for_selector(READY.format(1))
    check_axe(page)


def test_the_page_obeys_its_own_policy(browser: Any, viewed: Viewed, render: Any) -> None:
    """With the browser's protection on it works all the same."""
    render("f.exr")
    page = browser.new_page()
    page.goto(viewed.url)
    page.wait_for_selector(READY.format(1))
    page.close()


def test_a_broken_frame_is_said_and_a_whole_one_shown(
    browser: Any, viewed: Viewed, folder: Path, render: Callable[[str], Path]
) -> None:
    """As where a renderer writes over the frame in place."""
    (folder / "f.exr").write_bytes(b"v/1\x01 and no more")
    page = browser.new_page()
    page.goto(viewed.url)
    page.wait_for_selector("#trouble:not([hidden])")
    assert "f.exr" in page.inner_text("#trouble")
    render("f.exr")
    page.wait_for_selector(READY.format(1))
    assert page.locator("#trouble").is_hidden()
    page.close()


def test_only_its_own_page_is_answered(viewed: Viewed, render: Any) -> None:
    render("f.exr")
    assert viewed.get("/frames")[0] == 200
    assert viewed.get("/frames", Sec_Fetch_Site="same-origin")[0] == 200
    port = viewed.host.partition(":")[2]
    for host in ("evil.example", f"evil.example:{port}", "127.0.0.1", f"127.0.0.1:{port}.evil"):
        code, text = viewed.get("/frames", Host=host)
        assert code == 403 and "f.exr" not in text
    for site in ("cross-site", "same-site"):
        assert viewed.get("/frames", Sec_Fetch_Site=site)[0] == 403
    for method in ("POST", "PUT", "DELETE", "HEAD", "OPTIONS"):
        assert viewed.get("/frames", method)[0] == 501


@pytest.mark.parametrize(
    ("asked", "code", "said"),
    [
        ("/etc/passwd", 404, "there is no /etc/passwd"),
        ("/scene?frame=../f.exr", 400, "there is no frame ../f.exr"),
        ("/scene", 400, "there is no frame"),
        ("/denoise?frame=f.exr&method=magic", 400, "method must be one of"),
        ("/denoise?frame=f.exr&method=flr&guides=colour", 400, "'colour' is none of"),
        ("/denoise?frame=f.exr&method=flr&block=0", 400, "block"),
        ("/denoise?frame=f.exr&method=flr&block=x", 400, "invalid int value"),
    ],
)
def test_what_cannot_be_is_one_sentence(
    viewed: Viewed, render: Callable[[str], Path], asked: str, code: int, said: str
) -> None:
    render("f.exr")
    found, text = viewed.get(asked)
    error = json.loads(text)["error"]
    assert found == code and said in error and "\n" not in error


def test_it_ends_with_ctrl_c_and_has_written_nothing(viewed: Viewed, render: Any) -> None:
    path = render("f.exr")
    before = path.read_bytes()
    assert viewed.get("/denoise?frame=f.exr&method=flr&backend=jax")[0] == 200
    code, said = viewed.end()
    assert code == 130 and said == "jflnr: interrupted; no partial file is left\n"
    assert [*path.parent.iterdir()] == [path] and path.read_bytes() == before


def test_wrong_command_lines(
    viewed: Viewed, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "junk.exr").write_bytes(b"junk")
    port = viewed.host.partition(":")[2]
    for line, said in [
        (["gone.exr"], "gone.exr: there is no such file"),
        ([str(tmp_path / "junk.exr")], "junk.exr"),
        ([str(tmp_path), "--port", port], f"port {port} cannot be used: "),
    ]:
        assert main(["view", *line]) == 2
        error = capsys.readouterr().err
        assert said in error and error.count("\n") == 1
    with pytest.raises(SystemExit) as stop:
        main(["view", str(tmp_path), "--port", "70000"])
    assert stop.value.code == 2 and "--port" in capsys.readouterr().err
