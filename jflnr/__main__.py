"""`python -m jflnr` is the command `jflnr`."""

import sys

from jflnr.cli import main

sys.exit(main())
