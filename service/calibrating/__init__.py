"""Helps to calibrate cameras: takes pictures of a target while somebody moves it, and computes what comes of them."""
