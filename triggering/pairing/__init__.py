"""Pairing: the pulse of each frame, and what became of every pulse in every camera."""
