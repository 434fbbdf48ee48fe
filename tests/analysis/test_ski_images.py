"""What following a jumper learns of his skis' images, with a camera that shows 30 px per metre."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.candidates.model import Trace
from analysis.identification.space.views import Sight
from analysis.result.model import PointState, Quantity, SkiState, SmoothedState, Status, Vector
from analysis.worker.ski_images import SkiImages
from rig.arrays import Floats

_PX_PER_M = 30.0
_WIDTH_PX = 3.0
_BINDINGS = np.array(((10.0, 0.0, 2.0), (10.0, 0.5, 2.0)))


def _state(sigma_deg: float) -> SmoothedState:
    """Skis along X with the bindings half a metre apart, X and Y in the image."""
    points = {
        label: PointState(xyz, 1e-6 * np.eye(3), (), Status.PREDICTED)
        for label, xyz in zip(("P3", "P4"), _BINDINGS, strict=True)
    }
    angle = Quantity(0.0, sigma_deg)
    ski = SkiState(np.array((1.0, 0.0, 0.0)), angle, angle, 0.0, (), Status.PREDICTED)
    still = Vector(np.zeros(3), np.zeros((3, 3)))
    return SmoothedState(points, {"right": ski, "left": ski}, {}, None, None, still, still, None, np.zeros((11, 0)))


def _sight(xyz: Floats) -> Sight:
    n = len(xyz)
    by_point = np.tile(_PX_PER_M * np.eye(2, 3), (n, 1, 1))
    return Sight(xyz[:, :2] * _PX_PER_M, by_point, np.zeros((n, 2, 2)), np.ones(n, bool))


def _trace(row: float, width: float, one_sided: float = 0.0) -> Trace:
    """From 1.1 m behind the binding to 1.3 m before it."""
    column = np.linspace(270.0, 335.0, 12)
    xy, points = np.column_stack((column, np.full(12, row))), np.full(12, one_sided)
    ends = np.array(((267.0, row), (339.0, row)))
    return Trace(xy, np.full(12, 0.05), 0.02, ends, width, 120.0, points, np.zeros(12), 0.1, 0.01, 0.01)


def test_what_was_seen_says_where_the_next_image_shows_the_skis() -> None:
    skis, state = SkiImages(1), _state(0.5)
    sight = _sight(skis.places(state))
    assert skis.expected(0, state, sight) == (), "nothing was seen yet"
    skis.learn(0, {0: [_trace(0.0, _WIDTH_PX)], 1: [_trace(15.0, _WIDTH_PX)]})
    right, left = skis.expected(0, state, sight)
    assert right.ends == pytest.approx(np.array(((267.0, 0.0), (339.0, 0.0))))
    assert left.ends == pytest.approx(np.array(((267.0, 15.0), (339.0, 15.0))))
    assert right.width == pytest.approx(_WIDTH_PX)
    assert right.brighter
    assert right.near
    assert left.near
    anew = SkiImages(1)
    anew.continue_from(skis)
    assert [ski.ends.tolist() for ski in anew.expected(0, state, sight)] == [right.ends.tolist(), left.ends.tolist()]
    vague = _state(2.0)  # 1.4 m turned by that are 1.5 px, and three times that more than a ski's width
    right, left = skis.expected(0, vague, sight)
    assert right.sigma == pytest.approx(_PX_PER_M * 1.4 * np.radians(2.0), rel=0.01)
    assert not right.near
    assert not left.near


def test_the_width_of_clear_skis_moves_the_axes_of_those_that_hide_each_other() -> None:
    skis, state = SkiImages(1), _state(0.5)
    hidden = _trace(2.0, _WIDTH_PX + 0.6, one_sided=1.0)
    skis.expected(0, state, _sight(skis.places(state)))
    assert skis.told_apart(0, (hidden,)) == (hidden,), "its width may be right"
    for _ in range(4):
        skis.told_apart(0, (_trace(0.0, _WIDTH_PX), _trace(15.0, _WIDTH_PX)))
    (told,) = skis.told_apart(0, (hidden,))
    assert told.width == pytest.approx(_WIDTH_PX, abs=0.03), "the fit alone knows it five times worse"
    assert told.xy - hidden.xy == pytest.approx(np.tile((0.0, -0.3), (12, 1)), abs=0.015)
    (sure,) = skis.told_apart(0, (replace(hidden, width_spread=0.004),))
    assert sure.xy == pytest.approx(hidden.xy, abs=0.015), "the skis of a V look differently wide"
    assert skis.told_apart(0, (replace(hidden, width=_WIDTH_PX),))[0].xy == pytest.approx(hidden.xy, abs=1e-6)
