"""Errors that last: what they do to the motion and to the cameras' synchrony stands in their sigmas."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.measurements.model import POINTS, JumpMeasurements
from analysis.motion.adjustment.lasting import LASTING_S
from analysis.motion.smoother import smooth
from bench.analysis.smoothing import Honesty, judge
from rig.arrays import Floats
from tests.analysis.simulated import simulated_measurements, true_cameras, true_jump

pytestmark = pytest.mark.long

DRAWS = 4
OFF_PX, MARKER_OFF_PX = 0.1, 0.3
ANGLES = ("gamma", "dphi", "phi")


def test_errors_that_last_are_not_averaged_away() -> None:
    """Axes are off for some tenths of a second; images tell how far, in every other draw only the residuals do."""
    honesty, system = Honesty(), true_cameras()
    for draw in range(DRAWS):
        rng, truth = np.random.default_rng(draw), true_jump(draw)
        measured = simulated_measurements(truth, system, rng)
        jump = _off_for_long(measured.jumps[0], measured.rate_hz, rng, OFF_PX * (draw % 2))
        judge(truth, jump, smooth(jump, measured, system), honesty)
    pairs = np.array(
        [p for (phase, name), of in honesty.pairs.items() if name in ANGLES and phase != "table" for p in of]
    )
    error, sigma = pairs.T
    # Errors that last tell little of their own size in so few jumps; as independent ones they give 8.
    assert 0.4 < np.mean((error / sigma) ** 2) < 2.5


def test_markers_that_are_off_for_long_do_not_make_a_camera_late() -> None:
    """Each marker is off by as much in all images of a camera, as where an arm is beside it; one camera is late."""
    system, late, squares = true_cameras(), {"K2": 0.008}, []
    for draw in range(2 * DRAWS):
        rng, truth = np.random.default_rng(draw), true_jump(draw)
        for late_s in ({}, late) if draw == 0 else ({},):
            measured = simulated_measurements(truth, system, rng, late_s=late_s)
            motion = smooth(_markers_off(measured.jumps[0], rng), measured, system)
            assert [name for name, offset in motion.offsets.items() if offset.message] == list(late_s)
            if not late_s:
                squares += [(offset.offset_ms / offset.sigma_ms) ** 2 for offset in motion.offsets.values()]
    # as if errors were independent it is 3, and cameras are called late in one draw of twelve
    assert np.mean(squares) < 1.8


def _markers_off(jump: JumpMeasurements, rng: np.random.Generator) -> JumpMeasurements:
    """The same with markers that are off, in each camera for themselves, alike in all pulses."""
    off = {(name, label): MARKER_OFF_PX * rng.standard_normal(2) for name in ("K1", "K2", "K3") for label in POINTS}
    pulses = []
    for pulse in jump.pulses:
        images = {
            name: replace(image, points={of: replace(p, xy=p.xy + off[name, of]) for of, p in image.points.items()})
            for name, image in pulse.images.items()
        }
        pulses.append(replace(pulse, images=images))
    return replace(jump, pulses=tuple(pulses))


def _off_for_long(jump: JumpMeasurements, rate_hz: float, rng: np.random.Generator, told: float) -> JumpMeasurements:
    """The same with axes that are shifted and turned, in each camera for itself, alike in neighbouring pulses."""
    alike = np.exp(-1 / (rate_hz * LASTING_S))
    errors: dict[tuple[str, str], Floats] = {}
    pulses = []
    for pulse in jump.pulses:
        images = {}
        for name, image in pulse.images.items():
            skis = {}
            for side, ski in image.skis.items():
                new = rng.standard_normal(2)
                before = errors.get((name, side))
                error = new if before is None else alike * before + np.sqrt(1 - alike**2) * new
                errors[name, side] = error
                place = np.linspace(-1, 1, len(ski.xy)) * np.sqrt(3)  # tail to tip, root mean square 1
                axis = ski.xy[-1] - ski.xy[0]
                across = np.array((-axis[1], axis[0])) / np.hypot(*axis)
                off = OFF_PX * (error[0] + error[1] * place)
                skis[side] = replace(ski, xy=ski.xy + off[:, None] * across, common=OFF_PX, lasting=told)
            images[name] = replace(image, skis=skis)
        pulses.append(replace(pulse, images=images))
    return replace(jump, pulses=tuple(pulses))
