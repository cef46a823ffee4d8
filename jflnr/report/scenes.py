"""What a page compares: one frame, or pictures without one, in several versions."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jflnr import checks, exr, layouts, metrics
from jflnr.frame import Frame, read_frame

NOISY = "noisy"
REFERENCE = "reference"


@dataclass(frozen=True)
class Scene:
    """Versions of one picture, (H, W, 3) float32 each, under the names of the page.

    Of a `frame` of ours they are demodulated indirect light, of another program's and without one
    radiance. The version called `reference`, if there is one, is what the others are measured
    against, and comes last.
    """

    name: str
    images: dict[str, np.ndarray]
    frame: Frame | None = None

    def __post_init__(self) -> None:
        checks.same_size(**self.images, frame=self.frame and self.frame.normal)

    @property
    def size(self) -> tuple[int, int]:
        """Height and width in pixels."""
        return next(iter(self.images.values())).shape[:2]

    @property
    def whole(self) -> bool:
        """Whether the versions are pictures."""
        return self.frame is None or self.frame.beauty is not None

    @property
    def judge(self) -> np.ndarray:
        """The version that sets the brightness for all: the reference, else the last."""
        return self.images.get(REFERENCE, list(self.images.values())[-1])

    def radiance(self, image: np.ndarray) -> np.ndarray:
        """What is measured, (H, W, 3) float64: the light that `image` reflects, or itself."""
        if self.frame is None:
            return np.asarray(image, np.float64)
        return metrics.reflected(self.frame, image)

    def known(self, image: np.ndarray) -> np.ndarray:
        """`radiance`, 0 where it is NaN or infinite."""
        return np.nan_to_num(self.radiance(image), posinf=0, neginf=0)

    def measure(self, name: str) -> dict[str, float | None]:
        """The metrics of version `name` against the reference."""
        if self.frame is None or self.whole:
            return metrics.compare(self.images[name], self.images[REFERENCE])
        return metrics.measure(self.frame, self.images[name])


def of_frame(name: str, frame: Frame, denoised: dict[str, np.ndarray]) -> Scene:
    """The frame's noisy light, or its picture if it is another program's, what is `denoised` of
    that, and its reference if it has one."""
    noisy = frame.indirect if frame.beauty is None else frame.beauty
    images = {NOISY: np.asarray(noisy), **denoised}
    if frame.reference is not None:
        images.setdefault(REFERENCE, np.asarray(frame.reference))
    return Scene(name, images, frame)


def collect(
    paths: Sequence[Path], spp: int, reference: Path | None, layers: Mapping[str, str] | None = None
) -> list[Scene]:
    """Read files of any kind and put together what belongs together.

    A frame starts a scene, with its noisy light `indirect_{spp}` and its reference, or, of another
    program, with its picture. What `jflnr denoise` wrote joins the one frame there is or, of
    several, the one whose name it has. Without frames, plain R, G, B are compared. Pictures are
    measured against that of the file `reference`. layers: of frames, as of `read_frame`.
    Raises OSError and ValueError, in one sentence, for what cannot be compared.
    """
    channels = {path: exr.read_channels(path) for path in paths}
    frames = [path for path in paths if not is_picture(channels[path])]
    pictures = [path for path in paths if path not in frames]
    if not frames and layers:
        raise ValueError(f"--map is for frames, and {paths[0]} is a picture")
    if not frames:
        name = paths[0].stem if len(paths) == 1 else "pictures"
        return [Scene(name, _plain(_names(pictures), channels, reference))]
    owners = {path: _owner(path, frames) for path in pictures}
    scenes = []
    for source in frames:
        names = _names([path for path in pictures if owners[path] == source], source.stem)
        exr.check_aligned(source, *names, *([] if reference is None else [reference]))
        frame = read_frame(source, spp, layers)
        if frame.beauty is not None:
            scenes.append(of_frame(source.stem, frame, _plain(names, channels, reference)))
            continue
        if reference is not None:
            raise ValueError(
                f"--reference is for pictures, and {source} is a frame: --map reference=FILE"
            )
        lights = {name: _light(channels[path], path) for path, name in names.items()}
        scenes.append(of_frame(source.stem, frame, lights))
    return scenes


def is_picture(names: Collection[str]) -> bool:
    """Whether channels of these names are one finished image, and no frame with guides."""
    return "indirect.R" in names or set(names) <= set("RGBA")


def _plain(
    names: Mapping[Path, str], channels: Mapping[Path, dict], reference: Path | None
) -> dict[str, np.ndarray]:
    """The pictures of files by their names, and that of the file `reference`."""
    exr.check_aligned(*names, *([] if reference is None else [reference]))
    images = {name: layouts.picture(channels[p], str(p)) for p, name in names.items()}
    if reference is not None:
        images[REFERENCE] = layouts.picture(exr.read_channels(reference), str(reference))
    return images


def _owner(path: Path, frames: Sequence[Path]) -> Path:
    if len(frames) == 1:
        return frames[0]
    if same := [frame for frame in frames if frame.name == path.name]:
        return same[0]
    raise ValueError(
        f"{path}: there are several frames and none is called {path.name}, so that it cannot be "
        "told which one this was denoised from"
    )


def _names(paths: Sequence[Path], frame: str | None = None) -> dict[Path, str]:
    """The shortest names: the file's, or its folder's where it is named like its frame."""
    folder = {path: path.parent.resolve().name for path in paths}
    for names in (
        {path: folder[path] if path.stem == frame else path.stem for path in paths},
        folder,
        {path: f"{folder[path]}/{path.stem}" for path in paths},
    ):
        if len({NOISY, REFERENCE, *names.values()}) == len(names) + 2:
            return names
    return {path: str(path) for path in paths}


def _light(channels: dict[str, np.ndarray], path: Path) -> np.ndarray:
    if "indirect.R" not in channels:
        raise ValueError(
            f"{path} holds no layer indirect, so that it cannot be compared with a frame; "
            "leave the frame out to compare plain pictures"
        )
    return layouts.layer(channels, "indirect", tuple(f"indirect.{c}" for c in "RGB"), str(path))
