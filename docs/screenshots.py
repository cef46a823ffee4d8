"""Makes the pictures of the report in docs/, in headless Chromium.

python docs/screenshots.py
"""

import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from playwright.sync_api import sync_playwright

import jflnr
from jflnr.denoising import SHIPPED_FRAME
from jflnr.report.page import write_report
from jflnr.report.scenes import of_frame

DOCS = Path(__file__).parent
LARGE = 300_000


def main() -> None:
    frame = jflnr.read_frame(SHIPPED_FRAME)
    lights = {method: np.asarray(jflnr.denoise(frame, method)) for method in jflnr.METHODS}
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        path = Path(folder) / "report.html"
        write_report(path, [of_frame("room", frame, lights)], "room")
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox"]
        )
        laptop = open_page(browser, path, width=1180, height=760)
        laptop.keyboard.press("3")
        shoot(laptop, "report.png")
        for key in ("l", "m"):
            laptop.keyboard.press(key)
        laptop.mouse.move(330, 330)
        shoot(laptop, "report_error.png")
        shoot(open_page(browser, path, width=390, height=844, has_touch=True), "report_phone.png")


def open_page(browser: Any, path: Path, width: int, height: int, **options: Any) -> Any:
    page = browser.new_page(viewport={"width": width, "height": height}, **options)
    page.goto(path.resolve().as_uri())
    page.wait_for_selector("#images li")
    return page


def shoot(page: Any, name: str) -> None:
    """A picture of the window; in 256 colours where it would be large."""
    page.wait_for_timeout(500)
    path = DOCS / name
    page.screenshot(path=path)
    with Image.open(path) as picture:
        picture.convert("RGB").save(path, optimize=True)
        if path.stat().st_size > LARGE:
            picture.convert("RGB").quantize(256).save(path, optimize=True)


if __name__ == "__main__":
    main()
