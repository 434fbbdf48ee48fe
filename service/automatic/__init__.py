"""Recordings that begin by themselves: by a mark from outside, or when something moves in a camera's image."""
