"""Calibration, pose estimation, intersection: the paper's photogrammetry as pure functions."""
