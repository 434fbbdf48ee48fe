"""Targets of a frame that were clicked calibrate the cameras, and a network needs a survey."""

import json
from dataclasses import replace

import numpy as np
import pytest

from analysis.digitizing.exchange.delivery import delivered
from analysis.digitizing.marks.journal import Entered, Key
from analysis.digitizing.programs.clicked_balls import clicked_network
from analysis.scene.survey import Survey
from bench.analysis.hill_logs import HillLog
from photogrammetry.network.file import network_from_json
from photogrammetry.network.file_writer import metric_to_pixel, network_to_json
from photogrammetry.network.model import Point, Role
from photogrammetry.procedures.calibration import calibrate
from rig.errors import StateForbidsError
from tests.analysis.digitizing.hill import opened
from tests.photogrammetry.synthetic import SIZE, empty_observations, lab_frame

#: Targets that the survey lacks: landmarks of one's own.
OWN = {f"F{number}" for number in range(1, 11)}


def test_targets_that_were_clicked_calibrate_the_cameras() -> None:
    case = lab_frame(3)
    network, random = case.network, np.random.default_rng(3)
    marks = []
    seen = network.observations
    for image, point, xy, sigma in zip(seen.image, seen.point, seen.xy, seen.sigma, strict=True):
        name = network.points[point].name
        x, y = metric_to_pixel(xy, np.array(SIZE, float)).tolist()
        thing = f"mark:{name}" if name in OWN else f"ball:{name}"
        camera, pulse = network.cameras[network.images[image].camera].name, int(image) // 3 + 1
        marks.append((Key(pulse, camera, thing), Entered(xy=(x, y), sigma=tuple(sigma.tolist()))))
    surveyed = tuple(
        Point(point.name, Role.CONTROL, point.xyz + random.normal(0, 0.02, 3), np.full(3, 0.02))
        for point in network.points
        if point.name not in OWN and point.xyz is not None
    )
    survey = Survey(replace(network, images=(), points=surveyed, observations=empty_observations()), "frame.json")
    made = clicked_network({camera.name: SIZE for camera in network.cameras}, survey, sorted(marks))
    assert {image.name for image in made.images} == {f"K{k} pulse {p}" for k in (1, 2, 3) for p in (1, 2, 3)}
    found = calibrate(network_from_json(network_to_json(made), "network.json")).outcome.adjustment
    unknowns = found.problem.unknowns
    error = (found.state.interior - case.truth.interior)[:, unknowns.selection]
    assert np.abs(error / found.sigmas(unknowns.camera)).max() < 4.5  # 12 numbers: a chance of 0.01 %


def test_a_network_of_clicked_balls_has_the_survey_and_needs_one(jump: HillLog) -> None:
    without = opened(jump, survey=False)
    with pytest.raises(StateForbidsError, match="name it with --survey"):
        delivered(without, "Anna", "network.json")
    without.close()
    desk, place = opened(jump), Entered(xy=(100.5, 99.25), sigma=(0.2, 0.2))
    desk.put("Anna", [(Key(3, "K2", thing), place) for thing in ("ball:B1", "P1")])
    file = json.loads(delivered(desk, "Anna", "network.json"))
    assert file["observations"] == [["K2 pulse 3", "B1", 100.5, 99.25, 0.2]]
    assert set(file["points"]) >= {"B1", "B2"}
    desk.close()
