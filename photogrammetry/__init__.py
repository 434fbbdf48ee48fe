"""Photogrammetry for the three cameras: calibration, pose estimation, intersection, planning; numpy and scipy alone."""
