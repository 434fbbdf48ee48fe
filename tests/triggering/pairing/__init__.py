"""Frames and pulses are set side by side: never mixed, every possible triplet."""
