"""FLNR: adaptive FLR steered by a small network (section 3.3 of the paper)."""

# From the smallest network to the largest.
METHODS = ("flnr-tiny", "flnr-small", "flnr")
