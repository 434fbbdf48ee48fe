"""Centres of circles: an ellipse's middle is not the picture of the centre, and what that comes to is taken off."""

import numpy as np
import pytest

from analysis.targets.circles import measurable, projected_centres
from analysis.targets.pattern import CORNERS, DISC
from tests.analysis.targets.drawn import Array, DrawnCamera, looking

_SIDE = 80.0


def _pictured(camera: DrawnCamera, pose: tuple[Array, Array], places: Array) -> Array:
    """(n, 2) px of places (n, 2) on a target's plane, in units of its side; y points down."""
    k = (np.column_stack((places * (_SIDE, -_SIDE), np.zeros(len(places)))) - pose[0]) @ pose[1]
    return np.asarray(-camera.c * k[:, :2] / k[:, 2:] * (1.0, -1.0))


@pytest.mark.parametrize(
    "square",
    [
        [(100, 100), (300, 100), (300, 300), (-1, 300)],  # one is outside
        [(100, 100), (114, 100), (114, 114), (100, 114)],  # discs smaller than four pixels
        [(100, 100), (300, 100), (150, 120), (100, 300)],  # no picture of a square
        [(np.nan, 100), (300, 100), (300, 300), (100, 300)],
        [(10, 10), (630, 10), (321, 470), (319, 470)],  # its plane is seen from the edge
    ],
)
def test_what_cannot_be_measured_is_left_alone(square: list[tuple[float, float]]) -> None:
    assert not measurable(np.array(square, dtype=float), (640, 480))
    assert measurable(np.array([(100, 100), (300, 110), (310, 300), (100, 320)], dtype=float), (640, 480))


_ANGLES = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
_EDGE = np.column_stack((np.cos(_ANGLES), np.sin(_ANGLES)))


def _middle_of_ellipse(edge: Array) -> Array:
    """The middle of the conic through points (n, 2) of a disc's edge, by their equation."""
    x, y = edge.T
    a, b, c, d, e = np.linalg.lstsq(np.column_stack((x * x, x * y, y * y, x, y)), np.ones(len(x)), rcond=None)[0]
    return np.linalg.solve([[2.0 * a, b], [b, 2.0 * c]], [-d, -e])


@pytest.mark.parametrize(("along", "up"), [(0.0, 0.0), (45.0, 0.0), (-30.0, 40.0), (60.0, 10.0)])
def test_the_offset_of_a_disc_seen_aslant_is_taken_off(along: float, up: float) -> None:
    camera = DrawnCamera(c=900.0)
    pose = looking(np.zeros(3), 1000.0, along=along, up=up, roll=20.0)
    ellipses = np.array([_middle_of_ellipse(_pictured(camera, pose, centre + DISC * _EDGE)) for centre in CORNERS])
    centres = _pictured(camera, pose, CORNERS)
    offset = float(np.linalg.norm(ellipses - centres, axis=1).max())
    aslant = np.arccos(np.cos(np.radians(along)) * np.cos(np.radians(up)))
    expected = camera.c * (DISC * _SIDE / 1000.0) ** 2 * np.sin(aslant) * np.cos(aslant)
    assert offset == pytest.approx(expected, rel=0.25, abs=0.01)  # the formula of the documentation
    assert np.abs(projected_centres(ellipses) - centres).max() < 1e-4


@pytest.mark.parametrize(("wide", "off"), [(10.0, 0.0015), (25.0, 0.01)])
def test_the_bend_of_distortion_within_a_disc_is_as_small_as_the_page_says(wide: float, off: float) -> None:
    camera = DrawnCamera(a1=5.0 / 500.0**3)
    edge = np.column_stack(camera.distorted(*((500.0, 0.0) + wide / 2.0 * _EDGE).T))
    centre = np.array(camera.distorted(np.array(500.0), np.array(0.0)))
    expected = 3.0 * camera.a1 * 500.0 * (wide / 2.0) ** 2
    assert expected == pytest.approx(off, rel=0.1)
    # a conic through all of it takes up a part of the bend in its shape
    assert np.linalg.norm(_middle_of_ellipse(edge - centre) - 0.0) == pytest.approx(expected, rel=0.1)
