"""FLNR: adaptive FLR corrected by a small network (section 3.3 of the paper)."""
