"""Pictures of the pages that show frames: `python -m experiments pictures NAME...`."""

NAMES = ("animation", "bmfr", "failures", "figure9", "flnr", "seams", "steps", "whole")
