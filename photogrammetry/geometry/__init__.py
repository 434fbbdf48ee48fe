"""Cameras, rotations and similarity transformations."""
