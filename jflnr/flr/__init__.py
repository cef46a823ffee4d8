"""Fast Local Regression on plain arrays, one file per step of section 3.2."""

from jflnr.flr.parameters import Parameters
from jflnr.flr.regression import flr

__all__ = ["Parameters", "flr"]
