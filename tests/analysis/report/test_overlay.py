"""Overlays: projected where the camera sees them, with the covariance that many draws show."""

import math

import numpy as np
import pytest

from analysis.report.course import best_state
from analysis.report.crops import CROP_HEIGHT, CROP_WIDTH, windows_of
from analysis.report.overlay import SKI_LENGTH_M, half_axes, overlay_of, stick_lines
from analysis.result.fates import Fate, ImageFate, PartFate
from tests.analysis.report.jumps import measured_recording, measurements
from tests.analysis.simulated import true_cameras

STATE = best_state(measured_recording().jumps[0].pulses[20])


def test_the_stick_model_has_the_lines_of_fig_6() -> None:
    lines = stick_lines(STATE)
    points = {name: point.xyz for name, point in STATE.points.items() if point is not None}
    assert set(lines) == {"body", "feet", "right", "left"}
    assert lines["body"][2] == pytest.approx((points["P3"] + points["P4"]) / 2)
    assert np.linalg.norm(lines["right"][1] - lines["right"][0]) == pytest.approx(SKI_LENGTH_M)
    assert lines["left"].mean(axis=0) == pytest.approx(points["P4"])


def test_points_that_were_not_measured_have_no_lines() -> None:
    raw = measured_recording().jumps[0].pulses[15].raw
    assert raw.points["P1"] is None
    assert "body" in stick_lines(raw)  # from hip to O
    assert len(stick_lines(raw)["body"]) == 2


def test_an_overlay_lies_on_what_was_measured() -> None:
    pulse = measurements().jumps[0].pulses[20]
    assert pulse.pulse == measured_recording().jumps[0].pulses[20].pulse
    for name, camera in true_cameras().cameras.items():
        overlay = overlay_of(STATE, pulse.images[name], camera)
        for point, (place, _) in overlay.ellipses.items():
            # 0.15 px of the image, and some mm in space
            assert overlay.points[point] == pytest.approx(place, abs=1.5)


def test_the_ellipse_of_a_point_is_that_of_many_draws() -> None:
    camera, point = true_cameras()["K1"], STATE.points["P1"]
    assert point is not None
    _, covariance = overlay_of(STATE, None, camera).ellipses["P1"]
    draws = np.random.default_rng(1).multivariate_normal(point.xyz, point.covariance, 20_000)
    # A variance from n draws is known to sqrt(2 / n) = 1 %.
    assert covariance == pytest.approx(np.cov(camera.project(draws).T), rel=0.05, abs=0.02 * np.trace(covariance))


def test_half_axes_are_turned_from_x_towards_y() -> None:
    long, short, turn = half_axes(np.array([[2.5, 1.5], [1.5, 2.5]]), 1.0)
    assert (long, short, turn % 180) == pytest.approx((2.0, 1.0, 45.0))


def test_all_windows_of_a_camera_are_equally_large_and_within_the_image() -> None:
    system, jump = true_cameras(), measured_recording().jumps[0]
    overlays = {
        int(pulse.pulse): {n: overlay_of(best_state(pulse), None, c) for n, c in system.cameras.items()}
        for pulse in jump.pulses
    }
    windows = windows_of(overlays, system)
    assert len(windows) > 60
    for name in system.names:
        own = [window for (_, camera), window in windows.items() if camera == name]
        assert len({(window.width, window.height) for window in own}) == 1
        assert own[0].width * CROP_HEIGHT == own[0].height * CROP_WIDTH
        width, height = system[name].size
        assert all(w.left >= 0 and w.left + w.width <= width for w in own)
        assert all(w.top >= 0 and w.top + w.height <= height for w in own)


def test_what_is_measured_and_not_used_has_a_turned_cross() -> None:
    camera, measured = true_cameras()["K1"], measurements().jumps[0].pulses[20].images["K1"]
    overlay = overlay_of(STATE, measured, camera, {"P1": PartFate(Fate.USED, {"K1": ImageFate.GROSS_ERROR})})
    lines = list(overlay.crosses(4.0))
    assert {"P1", "P2"} <= set(overlay.points)
    assert len(lines) == 2 * len(overlay.points)
    for i, name in enumerate(overlay.points):
        for (x, y), (to_x, to_y) in lines[2 * i : 2 * i + 2]:
            assert math.hypot(to_x - x, to_y - y) == pytest.approx(8.0)
            assert bool(min(abs(to_x - x), abs(to_y - y)) > 1.0) == (name == "P1")
