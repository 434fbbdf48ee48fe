"""Cameras that are away, silent, slow, of other kinds."""
