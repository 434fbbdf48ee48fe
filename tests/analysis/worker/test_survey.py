"""Live, a survey whose Z axis does not point up is refused as soon as a jump shows it, and that is said once."""

import json
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from analysis.cameras.oriented_scene import OrientedScene
from analysis.measurements.model import MeasuredCamera
from analysis.scene.camera_system import CameraSystem
from analysis.worker.live import LiveAnalysis
from analysis.worker.whole_jump import JumpTask
from photogrammetry.geometry.rotation import rotation_from_vector
from rig.errors import BadInputError
from tests.analysis.identification.cluttered import scene
from tests.analysis.scene.hill import survey_json, training
from tests.analysis.simulated import RATE_HZ, true_cameras, true_jump
from tests.analysis.worker.found import Found

Y_UP = rotation_from_vector(np.array((np.pi / 2, 0.0, 0.0)))


def _turned(system: CameraSystem) -> CameraSystem:
    cameras = {
        name: replace(camera, position=Y_UP @ camera.position, rotation=Y_UP @ camera.rotation)
        for name, camera in system.cameras.items()
    }
    return replace(system, cameras=cameras)


def test_a_jump_that_falls_sideways_refuses_the_survey() -> None:
    system = true_cameras()
    made = scene([true_jump(7)], system, np.random.default_rng(1), range(15, 60))
    cameras = {name: MeasuredCamera((640, 480), 0.0) for name in system.names}
    oriented = cast("OrientedScene", SimpleNamespace(system=_turned(system)))
    task = JumpTask("r", 1, RATE_HZ, cameras, tuple(made.candidates), oriented, cast("Any", None))
    with pytest.raises(BadInputError, match="the Z axis of the survey does not point up"):
        task.computed()


def test_it_is_said_once(tmp_path: Path) -> None:
    (tmp_path / "survey.json").write_text(json.dumps(survey_json(training(), 1)))
    found = Found()
    with LiveAnalysis(tmp_path / "survey.json", None, found) as analysis:
        for _ in range(2):
            refused: Future[Any] = Future()
            refused.set_exception(BadInputError("Z is not up"))
            analysis._computing.append(refused)
            analysis.idle(0.0)
    assert found.said == ["error: no jump is measured any more: Z is not up; then start the analysis again"]
    assert not found.jumps
