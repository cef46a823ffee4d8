"""Denoising of one-sample path-traced light by Fast Local (Neural) Regression.

What it offers is in `__init__.pyi`, and imported when asked for: JAX takes a second, which
`jflnr --help` need not wait for.
"""

import lazy_loader

__version__ = "0.1.0"
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
