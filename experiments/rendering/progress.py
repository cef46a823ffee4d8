"""A progress bar with the time left: on a terminal; nothing but the last line elsewhere."""

from __future__ import annotations

import sys

from tqdm import tqdm


class Progress:
    """Called with the share done (0 to 1) and a remark; a context manager."""

    def __init__(self, title: str) -> None:
        form = "{desc}: {percentage:3.0f}%|{bar}| {elapsed}<{remaining} {postfix}"
        self.bar = tqdm(total=1.0, desc=title, bar_format=form, disable=not sys.stderr.isatty())

    def __enter__(self) -> Progress:
        return self

    def __call__(self, share: float, remark: str) -> None:
        self.bar.set_postfix_str(remark, refresh=False)
        self.bar.update(max(0.0, share - self.bar.n))

    def __exit__(self, *error: object) -> None:
        self.bar.close()
