"""Skis, followed as bars in space."""
