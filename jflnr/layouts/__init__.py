"""Which channels of a program's file make up which layer of a Frame.

One module per program says what its channels are called; `assemble` turns them into the layers of
a Frame, so that nothing behind this package knows where a frame came from (docs/layouts.md).
"""

from jflnr.layouts import native
from jflnr.layouts.assemble import assemble
from jflnr.layouts.channels import LAYERS, PICTURE, Layout, layer
from jflnr.layouts.output import CHOICES, output_channels, pass_names
from jflnr.layouts.source import Source, is_picture, load, picture
from jflnr.layouts.surface import denoised
