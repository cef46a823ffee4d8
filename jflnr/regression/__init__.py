"""Local regression on plain arrays, one file per step of section 3.2, one per method."""
