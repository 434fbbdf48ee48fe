"""Simulated measurements for the tests: those of the benchmarks."""

from bench.analysis.simulated import (
    RATE_HZ,
    SIGMA_PX,
    SIZE,
    SKI_SIGMA_PX,
    START_NS,
    TrueJump,
    drawn,
    simulated_measurements,
    training,
    true_cameras,
    true_jump,
)

__all__ = [
    "RATE_HZ",
    "SIGMA_PX",
    "SIZE",
    "SKI_SIGMA_PX",
    "START_NS",
    "TrueJump",
    "drawn",
    "simulated_measurements",
    "training",
    "true_cameras",
    "true_jump",
]
