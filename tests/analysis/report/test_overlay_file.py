"""The file of what is drawn over the images: it lies on the true jumper, also where cameras shake."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.cameras.standing import FrameShake, Standing
from analysis.report import overlay_file
from analysis.report.course import best_state, course_of
from analysis.report.overlay import SKI_LENGTH_M
from analysis.report.scrubbing import quantity_at
from analysis.result.model import MeasuredRecording
from photogrammetry.geometry.rotation import rotation_from_vector
from rig.arrays import Floats
from rig.pulse import PulseNumber
from tests.analysis.report.jumps import JUMP_SEED, measured_recording
from tests.analysis.result.recordings import model, without_takeoff
from tests.analysis.simulated import RATE_HZ, SIZE, training, true_cameras


def _written(result: MeasuredRecording, standing: Standing, folder: Path) -> dict[str, Any]:
    overlay_file.write_overlay(result, {jump.number: standing for jump in result.jumps}, folder / "overlay.json")
    content: dict[str, Any] = json.loads((folder / "overlay.json").read_text())
    return content


def test_points_and_skis_lie_on_the_true_jumper_in_every_image(tmp_path: Path) -> None:
    content = _written(measured_recording(), Standing(true_cameras(), {}), tmp_path)
    (jump,) = content["jumps"]
    truth, cameras = model(JUMP_SEED).truth, {camera.name: camera for camera in training().cameras}
    off: list[Floats] = []
    for pulse in jump["pulses"]:
        pose = truth.pose(pulse["pulse"])
        ends = [pose.markers[2] + sign * SKI_LENGTH_M / 2 * pose.skis[0] for sign in (-1, 1)]
        for name, image in pulse["images"].items():
            hill = cameras[name].projection(*SIZE)
            points = np.array([image["points"][point] for point in ("P1", "P2", "P3", "P4")])
            off.append(points - hill.pixels(pose.markers))
            right = image["lines"]["right"]
            assert [right[0], right[-1]] == [pytest.approx(hill.pixels(end[None])[0], abs=1.0) for end in ends]
            assert np.allclose(image["lines"]["feet"][0], image["points"]["P3"], atol=0.11)
    assert len(off) > len(jump["pulses"])
    assert np.abs(off).max() < 1.0
    assert (
        np.abs(np.mean(off, axis=(0, 1))).max() < 0.05
    )  # a pixel frame that began elsewhere would be half a pixel off
    assert len((tmp_path / "overlay.json").read_bytes()) < 3000 * len(jump["pulses"])


def test_in_a_frame_that_shook_the_model_lies_where_that_frame_shows_it() -> None:
    system, pulse = true_cameras(), measured_recording().jumps[0].pulses[30]
    shake = FrameShake(np.radians((0.2, -0.3, 0.5)), np.zeros((3, 3)))
    still = overlay_file.projected(best_state(pulse), pulse.pulse, Standing(system, {}))
    shaking = Standing(system, {"K1": {pulse.pulse: shake, PulseNumber(pulse.pulse + 1): shake.reversed()}})
    shaken = overlay_file.projected(best_state(pulse), pulse.pulse, shaking)
    turned = replace(system["K1"], rotation=system["K1"].rotation @ rotation_from_vector(shake.turn))
    for name, point in best_state(pulse).points.items():
        assert point is not None
        assert shaken["K1"]["points"][name] == pytest.approx(turned.project(point.xyz), abs=1e-6)
        assert np.linalg.norm(shaken["K1"]["points"][name] - still["K1"]["points"][name]) > 1.0
        assert shaken["K2"]["points"][name] == pytest.approx(still["K2"]["points"][name])


def test_curves_and_places_are_those_of_the_report(tmp_path: Path) -> None:
    result = measured_recording()
    (jump,) = _written(result, Standing(true_cameras(), {}), tmp_path)["jumps"]
    course = course_of(result.jumps[0], RATE_HZ)
    curves = {curve["name"]: curve for curve in jump["curves"]}
    assert {"height", "speed", "alpha", "beta", "gamma", "dphi", "phi", "angle_of_attack"} == set(curves)
    for name, curve in curves.items():
        quantities = [quantity_at(course, name, i) for i in range(len(course.pulses))]
        assert curve["value"] == [q if q is None else pytest.approx(q.value, abs=1e-5) for q in quantities]
        assert curve["sigma"] == [q if q is None else pytest.approx(q.sigma, abs=1e-5) for q in quantities]
    assert jump["takeoff"]["pulse"] == result.jumps[0].takeoff.pulse  # type: ignore[union-attr]
    assert [pulse["pulse"] for pulse in jump["pulses"]] == [pulse.pulse for pulse in result.jumps[0].pulses]
    hidden = jump["pulses"][15]
    assert (hidden["smoothed"], hidden["status"]["P1"]) == (True, "predicted")


def test_without_a_model_over_time_what_was_not_measured_is_not_drawn(tmp_path: Path) -> None:
    (jump,) = _written(without_takeoff(measured_recording()), Standing(true_cameras(), {}), tmp_path)["jumps"]
    hidden = jump["pulses"][15]
    assert (jump["takeoff"], hidden["smoothed"]) == (None, False)
    assert all("P1" not in image["points"] for image in hidden["images"].values())
    assert next(curve for curve in jump["curves"] if curve["name"] == "angle_of_attack")["value"][15] is None
