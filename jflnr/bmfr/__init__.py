"""Blockwise Multi-Order Feature Regression (Koskela et al. 2019)."""
