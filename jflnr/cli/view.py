"""view: look at frames in a browser, denoise them on demand, follow a renderer.

Serves the report's page to this machine's browsers only, until Ctrl-C, and writes no file. The page
denoises a frame by other methods, budgets, guides, blocks and back ends, and shows their times,
maps of errors and, of method auto, where it refines, side by side. Frames that come into a folder,
or change, are shown and denoised as they come.
"""

import argparse
import contextlib
import functools
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jflnr import layouts
from jflnr.cli import denoise
from jflnr.cli.common import INPUT_ERRORS, add_map, printable, sentence, to_json
from jflnr.cli.frames import Loaded, Worker
from jflnr.cli.jobs import Job, frames_in
from jflnr.cli.settings import settings_of
from jflnr.frame import Frame, frame_of
from jflnr.images.guides import choose
from jflnr.methods import AUTO, BACKENDS, HOMES, default_of, method_of

EXAMPLES = """\
  jflnr view room.exr
  jflnr view shot/ --port 8000         a folder that a renderer writes to
"""

JSON = "text/plain"
# What a page may ask to be denoised by: options of `jflnr denoise`.
OPTIONS = ("method", "worth", "guides", "block", "backend")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("input", metavar="IN", type=Path, help="an EXR frame, or a folder of them")
    add("--port", type=_port, default=0, metavar="N", help="where to listen (one that is free)")
    add("--spp", type=int, default=1, metavar="N", help="noisy layer indirect_N of a frame (1)")
    add_map(parser)


def _port(text: str) -> int:
    if 0 <= (port := int(text)) < 1 << 16:
        return port
    raise ValueError


def run(arguments: argparse.Namespace) -> int:
    from jflnr.report.server import Server

    frames = Frames(arguments.input, arguments.spp, arguments.map)
    with Server(arguments.port, frames.answer) as server:
        where = f"http://127.0.0.1:{server.server_port}/"
        print(f"{where} shows {printable(arguments.input)}; Ctrl-C ends it", flush=True)
        server.serve_forever()
    return 0


class Frames:
    """What is looked at, and what denoises it.

    path: a file, or a folder. spp, layers: as of `read_frame`. Raises what reading a file does.
    """

    def __init__(self, path: Path, spp: int, layers: list[tuple[str, str]]) -> None:
        self.path, self.spp, self.layers = path, spp, dict(layers)
        self.read = functools.lru_cache(maxsize=2)(self._read)
        self.workers = functools.cache(self._worker)
        self.alone = threading.Lock()  # a machine denoises one frame at a time
        if not path.is_dir():
            self.read(path, "")

    def listed(self) -> dict[str, tuple[Path, str]]:
        """By name, the files that are there, and what changes when they do."""
        found = {}
        for path in frames_in(self.path) if self.path.is_dir() else [self.path]:
            with contextlib.suppress(FileNotFoundError):  # a renderer that puts it in place
                status = path.stat()
                found[path.name] = path, f"{status.st_mtime_ns}.{status.st_size}"
        return found

    def opened(self, name: str) -> tuple[Loaded, Frame]:
        """The frame of that name as it is now, twice."""
        there = self.listed()
        if name not in there:
            raise FileNotFoundError(f"{self.path}: there is no frame {name}")
        return self.read(*there[name])

    def _read(self, path: Path, stamp: str) -> tuple[Loaded, Frame]:
        source = layouts.load(path, self.spp, self.layers)
        frame = frame_of(source)
        return Loaded(Job(path, path), source, frame), frame

    def page(self) -> str:
        from jflnr.report import page

        choices = {"methods": [*HOMES], "backends": [AUTO, *BACKENDS]}
        choices["worth"] = method_of("auto").worth
        script = page.read("view.js")
        content = page.content([]) | {"view": choices}
        return page.page(self.path.resolve().name, content, f"<script>\n{script}</script>")

    def names(self, asked: Mapping[str, str]) -> dict[str, Any]:
        return {"frames": [(name, stamp) for name, (_, stamp) in self.listed().items()]}

    def scene(self, asked: Mapping[str, str]) -> dict[str, Any]:
        """A frame as it comes, for the page."""
        from jflnr.report.page import scene_data
        from jflnr.report.scenes import of_frame

        name = asked.get("frame", "")
        _, frame = self.opened(name)
        own = {"method": default_of(frame), "guides": choose(frame, None)}
        return scene_data(of_frame(name, frame, {})) | own

    def denoised(self, asked: Mapping[str, str]) -> dict[str, Any]:
        """A version of a frame, for the page, with its time, warnings, and plan."""
        from jflnr.cli.pictures import plan_of
        from jflnr.report.page import image_data, unit_of
        from jflnr.report.scenes import of_frame

        loaded, frame = self.opened(asked.get("frame", ""))
        worker = self.workers(tuple((name, asked[name]) for name in OPTIONS if asked.get(name)))
        with self.alone:
            done = worker.denoise(loaded)
        if isinstance(done, dict):
            raise ValueError(done["error"])
        light, picture, error = done.result.light, done.result.picture, done.result.error
        image = picture if light is None or frame.beauty is not None else light
        maps, said = {}, None
        if error is not None:
            maps["told"] = told(error, picture if light is None else light)
        method = worker.denoiser.method_for(frame)
        if method.name == "auto":
            maps["plan"], said = plan_of(frame, method, worker.settings["guides"])
        scene, unit = of_frame("", frame, {"": image}), unit_of(of_frame("", frame, {}))
        return done.record | {"image": image_data(scene, "", unit, maps), "plan": said}

    def _worker(self, options: tuple[tuple[str, str], ...]) -> Worker:
        """What denoises as `jflnr denoise` does with these options."""
        parser = argparse.ArgumentParser(exit_on_error=False)
        denoise.add_arguments(parser)
        given = [f"--{name}={value}" for name, value in options]
        tells = hasattr(method_of(dict(options).get("method", "flr")), "with_error")
        given += ["--error-map"] * tells
        arguments = parser.parse_args([*given, "-q", "-o", ".", str(self.path)])
        return Worker(settings_of(arguments), arguments, None)

    def answer(self, what: str, asked: Mapping[str, str]) -> tuple[int, str, str]:
        """The code of HTTP, and what a page asks for: the page itself, HTML, or else JSON."""
        answers = {"/frames": self.names, "/scene": self.scene, "/denoise": self.denoised}
        try:
            if what == "/":
                return 200, "text/html", self.page()
            if what in answers:
                return 200, JSON, to_json(answers[what](asked))
            return 404, JSON, to_json({"error": f"there is no {what}"})
        except (*INPUT_ERRORS, argparse.ArgumentError) as error:
            return 400, JSON, to_json({"error": sentence(error)})


def told(error: np.ndarray, image: np.ndarray) -> np.ndarray:
    """The standard error `(H, W, 1)` over the mean of what it is of, as the page's map shows it:
    from 1e-3 to 10, on a logarithmic scale from 0 to 1."""
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.log10(error[..., 0] / np.nanmean(np.abs(image))) / 4 + 0.75
    return np.clip(np.nan_to_num(share), 0, 1)
