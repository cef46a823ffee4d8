"""Scenes of this project: geometry, textures and lights made by functions of a seed."""
