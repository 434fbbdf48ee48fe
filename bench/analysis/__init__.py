"""Benchmarks of the analysis on rendered jumps: speed, accuracy and honesty, and what it says of faults."""
