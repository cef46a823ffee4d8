"""report: compare pictures in one HTML page.

IN are frames, files that `jflnr denoise` wrote from them, or plain R, G, B pictures. The page
needs no network and no other file. It shows the real values at any exposure, splits, flips, zooms,
and maps the errors where there is a reference: the frame's own or --map reference=FILE, or for
pictures, also those of other programs' files, --reference.

A version is named by its file, or by its folder where the file is named like the frame.

With --temporal a folder of frames and those that `jflnr denoise` wrote from it are a shot: the page
plays it, in 8 bits and at the frames' rate, with the warped error of each frame.
"""

import argparse
from pathlib import Path

from jflnr.cli.common import add_map, kept_as_it_is, printable
from jflnr.cli.jobs import borrowed, check_apart, expand, make_folder

EXAMPLES = """\
  jflnr report room.exr out/room.exr -o report.html     a frame and what was denoised from it
  jflnr report render.exr out/render.exr --reference converged.exr -o report.html
  jflnr report a.exr b.exr --reference c.exr -o r.html  plain pictures
  jflnr report shot/ clean/ --temporal -o shot.html     a film that plays
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("inputs", metavar="IN", nargs="+", type=Path, help="EXR files, or folders of them")
    add("-o", "--output", metavar="OUT", type=Path, required=True, help="HTML file to write")
    add("--spp", type=int, default=1, metavar="N", help="noisy layer indirect_N of a frame (1)")
    add_map(parser)
    add("--reference", metavar="FILE", type=Path, help="what pictures are measured against")
    add("--temporal", action="store_true", help="play the frames of a folder: it is a shot")
    add("--title", help="heading of the page (the scenes' names)")
    add("--overwrite", action="store_true", help="replace OUT if it exists")


def run(arguments: argparse.Namespace) -> int:
    from jflnr.report.page import write_report
    from jflnr.report.scenes import Scene, collect
    from jflnr.report.shot import Shot, collect_shot

    output = arguments.output
    if output.is_dir():
        raise IsADirectoryError(f"{output} is a folder; name the HTML file to write")
    paths = expand(arguments.inputs)
    check_apart([output], [*paths, arguments.reference, *borrowed(arguments.map, paths)])
    if output.exists() and not arguments.overwrite:
        print(kept_as_it_is(output))
        return 0
    spp, layers, scenes = arguments.spp, dict(arguments.map), list[Scene | Shot]()
    if not arguments.temporal:
        scenes += collect(paths, spp, arguments.reference, layers)
    elif arguments.reference is None:
        scenes.append(collect_shot(paths, spp, layers))
    else:
        one = "--reference is one picture, and a shot has one for each frame"
        raise ValueError(f"{one}: --map reference=FOLDER/{{stem}}.exr")
    make_folder(output)
    title = arguments.title or ", ".join(scene.name for scene in scenes)
    write_report(output, scenes, title)
    print(f"{printable(output)} ({output.stat().st_size / 1e6:.1f} MB)")
    return 0
