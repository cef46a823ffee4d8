"""Writing the page: pictures as half floats, deflated, in base64, inside the HTML itself."""

import base64
import html
import json
import re
import zlib
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter

from jflnr.files import write_atomically
from jflnr.frame import HALF_MAX, Frame
from jflnr.metrics import LABELS, RELATIVE_EPSILON, display, exposure, flip_map
from jflnr.report.scenes import NOISY, REFERENCE, Scene
from jflnr.report.shot import Shot, shot_data

SCRIPTS = "data tone viewer panel player keys tables main".split()
LOWER_IS_BETTER = ("flip", "rmse", "smape", "mse", "mse_unbiased", "ms", "warped")
# Where to look first: so many squares, of so many pixels on a side.
COUNT, SIZE = 2, 64


def write_report(
    path: Path,
    scenes: Sequence[Scene | Shot],
    title: str,
    tables: Sequence[Mapping[str, Any]] = (),
    extra: str = "",
) -> None:
    """Write one HTML file that needs no other, atomically.

    tables: more tables, each `{"title", "note", "columns": {key: heading}, "rows": [{...}]}`.
    extra: HTML that is put before these tables; its scripts may use the page's functions once the
    page is loaded.
    """
    text = page(title, content(scenes, tables), extra)
    write_atomically(path, text.encode(errors="replace"))  # names of files need not be UTF-8


def content(
    scenes: Sequence[Scene | Shot], tables: Sequence[Mapping[str, Any]] = ()
) -> dict[str, Any]:
    """What the page shows, as values of JavaScript."""
    data = [shot_data(each) if isinstance(each, Shot) else scene_data(each) for each in scenes]
    return {
        "scenes": data,
        "tables": list(tables),
        "labels": LABELS | {"ms": "ms", "warped": "mean warped error"},
        "lower": LOWER_IS_BETTER,
        "epsilon": RELATIVE_EPSILON,
    }


def page(title: str, content: Mapping[str, Any], extra: str) -> str:
    """The template with styles, scripts and data put in."""
    parts = {
        "STYLE": read("style.css"),
        "EXTRA": extra,
        "SCRIPT": "\n".join(read(f"{name}.js") for name in SCRIPTS),
        "TITLE": html.escape(title),
        "DATA": script_data(content),
    }
    return re.sub("%%([A-Z]+)%%", lambda mark: parts[mark[1]], read("page.html"))


def read(name: str) -> str:
    """A file of the page."""
    return (files("jflnr.report") / "page" / name).read_text(encoding="utf-8")


def script_data(content: Mapping[str, Any]) -> str:
    """JavaScript, not JSON: NaN and Infinity stay. No "<": nothing can end the script early."""
    return json.dumps(content).replace("<", "\\u003c")


def scene_data(scene: Scene) -> dict[str, Any]:
    """What the page needs to know of one scene, as JSON values."""
    unit = unit_of(scene)
    layers = {} if scene.frame is None or scene.whole else _layers(scene.frame, unit)
    return {
        "name": scene.name,
        "height": scene.size[0],
        "width": scene.size[1],
        "unit": unit,
        "exposures": _exposures(scene),
        "layers": layers,
        "images": [image_data(scene, name, unit) for name in scene.images],
        "crops": find_crops(scene),
    }


def image_data(
    scene: Scene, name: str, unit: float, maps: Mapping[str, np.ndarray] | None = None
) -> dict[str, Any]:
    """What the page needs to know of one version.

    unit: that of the scene's data. maps: more maps `(H, W)` of 0 to 1, by the page's names.
    """
    measured = REFERENCE in scene.images and name != REFERENCE
    errors = _flip(scene, name) if measured else None
    maps = {**({} if errors is None else {"flip": errors}), **(maps or {})}
    bytes_of = lambda values: np.uint8(np.round(255 * values)).tobytes()
    return {
        "name": name,
        "light": pack(scene.images[name], unit),
        "maps": {name: _deflated(bytes_of(values)) for name, values in maps.items()},
        "metrics": scene.measure(name) if measured else None,
    }


def _flip(scene: Scene, name: str) -> np.ndarray | None:
    """The map of FLIP, whose mean is the metric; None where there is a NaN or an infinity."""
    x, y = (scene.radiance(scene.images[n]) for n in (name, REFERENCE))
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        return None
    scale = exposure(y)
    return flip_map(display(x, scale), display(y, scale))


def _layers(frame: Frame, unit: float) -> dict[str, str]:
    """What puts the picture together around the indirect light, as far as it is there."""
    found = {"albedo": pack(np.asarray(frame.albedo))}
    for name, image in (("direct", frame.direct), ("emission", frame.emission)):
        if image is not None:
            found[name] = pack(np.asarray(image), unit)
    return found


def unit_of(scene: Scene) -> float:
    """A power of two near the mean light, so that dividing by it is exact and suits half floats."""
    image = scene.judge
    mean = float(np.mean(np.abs(image[np.isfinite(image)]), dtype=np.float64))
    return 2.0 ** round(np.log2(mean)) if 0 < mean < np.inf else 1.0


def _exposures(scene: Scene) -> dict[str, float]:
    """The factor that each view is shown with: the metrics' rule, on what reflects."""
    judge = scene.judge
    lights = {"reflected": scene.known(judge)}
    if scene.frame is not None and not scene.whole:
        direct = 0 if scene.frame.direct is None else np.asarray(scene.frame.direct)
        light = np.nan_to_num(judge, posinf=0, neginf=0)
        lights |= {"picture": scene.known(judge + direct), "light": light}
    return {name: exposure(light) for name, light in lights.items()}


def find_crops(scene: Scene, size: int = SIZE) -> list[dict[str, int]]:
    """Squares `{"x", "y", "size"}` inside the picture, far apart, the most different first."""
    height, width = scene.size
    size = min(size, height, width)
    spread = uniform_filter(_spread(scene), size, mode="nearest")
    half = size // 2
    # Only centres whose square lies inside.
    inside = spread[half : height - size + half + 1, half : width - size + half + 1]
    found = []
    for _ in range(COUNT):
        y, x = (int(i) for i in np.unravel_index(np.argmax(inside), inside.shape))
        if inside[y, x] < 0:
            break
        found.append({"x": x, "y": y, "size": size})
        inside[max(y - size + 1, 0) : y + size, max(x - size + 1, 0) : x + size] = -1
    return found


def _spread(scene: Scene) -> np.ndarray:
    """How far the errors of the versions lie apart at every pixel, as displayed, (H, W)."""
    basis = scene.known(scene.judge)
    scale = exposure(basis)
    shown = lambda name: display(scene.known(scene.images[name]), scale)
    judged = [n for n in scene.images if n not in (NOISY, REFERENCE)] or scene.images
    errors = [np.mean((shown(name) - display(basis, scale)) ** 2, axis=-1) for name in judged]
    return np.ptp(errors, axis=0) if len(errors) > 1 else errors[0]


def pack(image: np.ndarray, unit: float = 1) -> str:
    """An (H, W, 3) image as base64 of deflated half floats: planes, high bytes before low ones."""
    scaled = np.asarray(image, np.float64) / unit
    limited = np.clip(scaled, -HALF_MAX, HALF_MAX, where=np.isfinite(scaled), out=scaled)
    bits = np.ascontiguousarray(limited.transpose(2, 0, 1).astype(np.float16)).view(np.uint16)
    return _deflated(np.stack([bits >> 8, bits & 255]).astype(np.uint8).tobytes())


def _deflated(data: bytes) -> str:
    return base64.b64encode(zlib.compress(data)).decode()
