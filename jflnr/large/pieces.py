"""Overlapping pieces of a line of pixels or blocks."""

from __future__ import annotations

from typing import NamedTuple


class Piece(NamedTuple):
    """What is worked on (`low` to `high`) for the sake of its inner part (`start` to `stop`)."""

    low: int
    high: int
    start: int
    stop: int

    @property
    def outer(self) -> slice:
        return slice(self.low, self.high)

    @property
    def inner(self) -> slice:
        return slice(self.start, self.stop)

    @property
    def kept(self) -> slice:
        """The inner part, counted from where the piece begins."""
        return slice(self.start - self.low, self.stop - self.low)

    def on(self, side: int) -> Piece:
        """The same piece counted in blocks of `side`, with those at the end that are not whole; 0
        stands for pixels."""
        side = side or 1
        first, last = self.low // side, self.start // side
        return Piece(first, -(-self.high // side), last, -(-self.stop // side))


def pieces(size: int, step: int, reach: int, align: int) -> list[Piece]:
    """Cut `size` into inner parts of `step`, each with `reach` more on both sides.

    Pieces begin at multiples of `align`. All but the last are of one length, so that few programs
    are compiled: one that would pass the border is moved inside and overlaps more.
    """
    step, reach = (-(-length // align) * align for length in (step, reach))
    length = step + 2 * reach
    if length >= size:
        return [Piece(0, size, 0, size)]
    found = []
    for start in range(0, size, step):
        low = max(start - reach, 0)
        if low + length > size:
            low = (size - length) // align * align
        high = size if low + length + align > size else low + length
        found.append(Piece(low, high, start, min(start + step, size)))
    return found
