"""What is said while pictures are taken: what is missing, and when the target is still in a new pose."""

from collections.abc import Sequence

import numpy as np

from analysis.targets.detection import Corner, Sight
from analysis.targets.moving import Watch
from analysis.targets.pattern import Layout
from analysis.targets.views import PICTURES, views
from tests.analysis.targets.drawn import EXACT, Array, DrawnCamera, board_sheet, corner_places, looking, seen_at

_CAMERA = DrawnCamera((480, 360), 600.0)
_SIDES = ["target_left_near", "target_right_near", "target_upper_near", "target_lower_near"]


def _sight(
    away: float = 320.0, along: float = 0.0, up: float = 0.0, roll: float = 0.0, shift: Array | None = None
) -> Sight:
    at = np.zeros(3) if shift is None else shift
    seen = seen_at(_CAMERA, *looking(at, away, along=along, up=up, roll=roll), corner_places([board_sheet()]))
    corners = {name: Corner(float(x), float(y), 0.01, 0.01, EXACT) for name, (x, y) in seen.items()}
    return Sight(_CAMERA.size, corners, {}, (), mirrored=False, blur=0.8)


def _missing(sights: Sequence[Sight]) -> list[str]:
    return [each.code for each in views(sights, Layout()).missing]


def test_without_pictures_pictures_are_missing() -> None:
    assert _missing([]) == ["target_more"]


def test_each_side_that_was_shown_is_not_asked_for_again() -> None:
    front = _sight()
    assert _missing([front])[:4] == _SIDES
    assert _missing([front])[4:6] == ["target_roll", "target_distance"]
    # a camera that stands to the right of the board sees the board's right side nearer
    for view, shown in (
        (_sight(along=-35.0), "target_left_near"),
        (_sight(along=35.0), "target_right_near"),
        (_sight(up=35.0), "target_upper_near"),
        (_sight(up=-35.0), "target_lower_near"),
    ):
        assert [code for code in _SIDES if code not in _missing([front, view])] == [shown]


def test_a_side_is_one_as_the_camera_sees_it() -> None:
    """A board that is turned by 90 degrees: its right side is up, or down."""
    turned = _sight(along=35.0, roll=90.0)
    shown = [code for code in _SIDES if code not in _missing([_sight(), turned])]
    assert shown in (["target_upper_near"], ["target_lower_near"])
    upper = max(turned.corners.values(), key=lambda corner: -corner.y)
    lower = max(turned.corners.values(), key=lambda corner: corner.y)
    width = {
        end: np.ptp([corner.x for corner in turned.corners.values() if abs(corner.y - at.y) < 25.0])
        for end, at in (("target_upper_near", upper), ("target_lower_near", lower))
    }
    assert width[shown[0]] == max(width.values())


def test_two_turned_pictures_are_asked_for_and_one_is_not_enough() -> None:
    upright, turned = [_sight(away=300.0 + 20 * k) for k in range(4)], [_sight(roll=r) for r in (90.0, -90.0)]
    assert "target_roll" in _missing(upright + turned[:1])
    assert "target_roll" in _missing(turned[:1] + upright)
    assert "target_roll" not in _missing(upright + turned)
    assert "target_roll" in _missing([*upright, *upright, _sight(roll=180.0)])


def test_nothing_is_missing_when_all_was_shown() -> None:
    sights = [_sight(away=240.0), _sight(away=330.0), _sight(roll=90.0), _sight(roll=-90.0)]
    sights += [_sight(along=35.0), _sight(along=-35.0), _sight(up=35.0), _sight(up=-35.0)]
    assert _missing(sights) == ["target_more"]
    sights += [_sight(away=260.0)]
    found = views(sights, Layout())
    assert (found.missing, found.pictures) == ((), PICTURES)
    far = [_sight(away=900.0 + 100 * k, along=-35.0 + 9 * k) for k in range(9)]
    assert "target_fill" in _missing(far)
    assert (views(far, Layout()).cells[0] == 0).all()  # the upper row shows nothing


def _moved(px: float) -> Sight:
    """The front view, shifted in the picture."""
    return _sight(shift=np.array([px * 320.0 / _CAMERA.c, 0.0, 0.0]))


def test_a_picture_is_kept_once_the_target_is_still() -> None:
    watch = Watch()
    looks = [watch.look({"K1": _moved(x)}, {}) for x in (0.0, 30.0, 60.0, 60.2, 60.3)]
    assert looks == [frozenset()] * 4 + [frozenset({"K1"})]
    assert watch.look({"K1": _moved(60.3)}, {"K1": [_moved(60.3)]}) == frozenset()  # there is one of this pose
    assert watch.look({"K1": _moved(60.3)}, {}) == frozenset()  # it was thrown away, for a reason
    looks = [watch.look({"K1": _moved(x)}, {}) for x in (90.0, 90.0, 90.0)]
    assert looks[-1] == {"K1"}


def test_all_cameras_that_see_it_count() -> None:
    watch, far = Watch(), Sight(_CAMERA.size, {}, {}, (), mirrored=False, blur=np.nan)
    for x in (0.0, 10.0, 20.0, 30.0):  # it seems to stand still in one of them only
        assert not watch.look({"K1": _moved(0.0), "K2": _moved(x)}, {})
    assert not watch.look({"K1": _moved(0.0), "K2": _moved(30.0), "K3": far}, {})
    assert watch.look({"K1": _moved(0.0), "K2": _moved(30.0), "K3": far}, {}) == {"K1", "K2"}
    kept = {"K1": [_moved(0.0)]}
    watch = Watch()
    for _ in range(2):
        assert not watch.look({"K1": _moved(0.0), "K2": _moved(30.0)}, kept)
    assert watch.look({"K1": _moved(0.0), "K2": _moved(30.0)}, kept) == {"K1", "K2"}  # new for K2: both, of one pulse
