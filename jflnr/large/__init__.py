"""Frames larger than memory: piece by piece, with the result of the whole."""
