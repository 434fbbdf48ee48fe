"""Tests of printed targets and of calibrations from pictures."""
