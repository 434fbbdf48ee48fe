"""Printed targets: their patterns and sheets, their corners in pictures, and calibrations by them (paper, step 1)."""
