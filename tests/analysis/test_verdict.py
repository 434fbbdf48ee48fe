"""The verdict on a jump of which not all points are ever seen together."""

from dataclasses import replace

import numpy as np

from analysis.measurements.model import JumpMeasurements
from analysis.procedure.jump import compute_jump
from tests.analysis.simulated import simulated_measurements, true_cameras, true_jump


def test_points_that_are_never_seen_together_may_be_named_wrong() -> None:
    system = true_cameras()
    measured = simulated_measurements(true_jump(3), system, np.random.default_rng(3))
    whole = measured.jumps[0]
    without = tuple(
        replace(
            pulse,
            images={
                name: replace(image, points={key: of for key, of in image.points.items() if key != "P2"})
                for name, image in pulse.images.items()
            },
        )
        for pulse in whole.pulses
    )
    assert "which is which" not in compute_jump(whole, measured, system).jump.verdict.message
    verdict = compute_jump(JumpMeasurements(1, without), measured, system).jump.verdict
    assert not verdict.ok
    assert "no pulse shows all four points, so it is not certain which is which" in verdict.message
