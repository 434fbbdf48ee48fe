"""Cameras: what a back end must offer, the back ends, and the grabber's loop that drives one camera."""
