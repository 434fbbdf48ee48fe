"""Cameras: the seam, the back ends and the grabber."""
