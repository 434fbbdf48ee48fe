"""Poses that three points alone fix are shown, all of them, and none is believed."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.network.diagnosis import NotSolvableError
from photogrammetry.network.file_writer import write_network
from photogrammetry.network.model import Camera, Image, ImageFrame, ImageObservations, Network, Point, Role
from photogrammetry.procedures.orientation import orient
from photogrammetry.procedures.stages import snoop_network
from rig.images.viewing import look_at
from svev.cli import main
from tests.photogrammetry.synthetic import hill

_PLACE = np.array([-12.0, -38.0, 4.0])
_BALLS = np.array([[2.0, -3.0, -5.0], [17.0, 2.0, -4.0], [9.0, 4.0, 2.0], [5.0, 5.0, -1.0]])


def _one_image(points: int) -> Network:
    """One image of a few surveyed balls, without an approximate pose."""
    camera = IdealCamera(1420.0, _PLACE, look_at(_PLACE, (10.0, 0.0, -2.0)))
    index = np.arange(points, dtype=np.intp)
    return Network(
        (Camera("K1", np.array([1420.0, *[0.0] * 9]), size=(640, 480)),),
        (Image("hill-1", 0),),
        tuple(Point(f"B{i + 1}", Role.CONTROL, _BALLS[i], np.full(3, 0.012)) for i in range(points)),
        ImageObservations(
            np.zeros_like(index),
            index,
            camera.project(_BALLS[:points]),
            np.full((points, 2), 0.33),
            np.zeros_like(index),
        ),
        length_unit="m",
        image_frame=ImageFrame.PIXEL,
    )


@pytest.mark.parametrize("command", ["adjust", "orient"])
def test_three_points_fit_several_poses(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_network(_one_image(3), tmp_path / "hill.json")
    assert main([command, str(tmp_path / "hill.json"), "--force", "-o", str(tmp_path / "poses.json")]) == 3
    result = json.loads((tmp_path / "poses.json").read_text())
    assert result["diagnosis"][0]["images"] == ["hill-1"]
    assert "images" not in result
    words = capsys.readouterr().out
    assert "(-12.000, -38.000, 4.000)" in words
    assert words.count(" / (") >= 1


def test_a_fourth_point_or_an_approximate_pose_decides() -> None:
    network = _one_image(4)
    assert np.abs(orient(network).outcome.adjustment.state.position[0] - _PLACE).max() < 1e-6
    near = Image("hill-1", 0, _PLACE + 0.5, look_at(_PLACE, (10.0, 0.0, -2.0)))
    network = replace(_one_image(3), images=(near,))
    assert np.abs(orient(network).outcome.adjustment.state.position[0] - _PLACE).max() < 1e-6


def test_further_images_of_the_same_three_points_do_not_decide() -> None:
    one = _one_image(3)
    o = one.observations
    xy, sigma = np.tile(o.xy, (2, 1)), np.tile(o.sigma, (2, 1))
    twice = ImageObservations(np.repeat(np.arange(2), 3), np.tile(o.point, 2), xy, sigma, np.tile(o.group, 2))
    network = replace(one, images=(*one.images, Image("hill-2", 0)), observations=twice)
    with pytest.raises(NotSolvableError, match="image hill-2 shows three points only"):
        orient(network)


def test_cameras_that_are_all_unknown_are_not_exchanged(monkeypatch: pytest.MonkeyPatch) -> None:
    """Self-calibration with one wrong survey point: no images without survey are tried with each other's cameras.

    Nothing tells cameras apart whose interior orientations are start values only, and each trial takes seconds.
    """

    def forbidden(network: Network) -> Network:
        raise AssertionError("tries exchanged cameras")

    monkeypatch.setattr("photogrammetry.procedures.doubtful_poses.complete", forbidden)
    network = hill(8).network
    cameras = tuple(replace(camera, estimate=("c", "x0", "y0")) for camera in network.cameras)
    points = list(network.points)
    points[10] = replace(points[10], xyz=np.asarray(points[10].xyz, dtype=float) + np.array([0.3, -0.4, 0.2]))
    images = tuple(replace(image, position=None, rotation=None) for image in network.images)
    outcome = snoop_network(replace(network, cameras=cameras, points=tuple(points), images=images))
    assert [gone.network.points[gone.blunder.suspect.index].name for gone in outcome.removed] == ["B11"]
    assert outcome.adjustment.ratio < 1.2
