"""Bindings that are seen alone get their names from the whole path."""

import numpy as np

from analysis.identification.markers.left_right import name_bindings
from analysis.identification.over_time.prediction import Part, PathFilter
from rig.arrays import Floats

_PULSES = 40
_SIGMA_M = 0.01
_LEFT = np.array([0.0, 1.0, 0.0])
_HIDDEN = slice(5, 14)  # the pulses in which only P3 is in sight


def _bindings() -> PathFilter:
    path = np.array([[17.0, 0.0, -1.5], [26.0, 0.0, -6.0]])
    gap = np.stack((0.24 * _LEFT, 0.0 * _LEFT))
    hip = Part(np.zeros((2, 3)), (np.array((1.0, 0.08, 1.0)), np.array((4.0, 0.4, 4.0)), 5.0), 5.0)
    parts = [Part(path, (100.0, 6.0, 15.0), 15.0), Part(gap, (0.07, 1.0, 5.0), 4.0), hip]
    return PathFilter(3, parts, np.array([(1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (1.0, 0.0, 1.0)]))


def _flight(seed: int) -> tuple[Floats, Floats, Floats]:
    """Times, measured P3, P4 and hip (t, 3, 3), and the cost of pairs: an exchanged one does not look like a body."""
    time_s = np.arange(_PULSES) / 30.0
    middle = np.stack((26.0 * time_s, 0.0 * time_s, -4.9 * time_s**2), axis=1)
    xyz = np.stack((middle - 0.24 * _LEFT, middle + 0.24 * _LEFT, middle + np.array((-0.3, 0.05, 0.6))), axis=1)
    noise = np.random.default_rng(seed).normal(0.0, _SIGMA_M, xyz.shape)
    return time_s, xyz + noise, np.tile((0.0, 60.0), (_PULSES, 1))


def _named(xyz: Floats, time_s: Floats, strange: Floats) -> list[list[int]]:
    covariance = np.broadcast_to(_SIGMA_M**2 * np.eye(3), (*xyz.shape[:2], 3, 3))
    names: list[list[int]] = name_bindings(time_s, xyz, covariance, strange, _bindings()).tolist()
    return names


def test_bindings_that_are_named_rightly_keep_their_names() -> None:
    time_s, xyz, strange = _flight(1)
    xyz[_HIDDEN, 1] = np.nan
    expected = [[0, -1 if _HIDDEN.start <= t < _HIDDEN.stop else 1] for t in range(_PULSES)]
    assert _named(xyz, time_s, strange) == expected


def test_a_run_of_lone_bindings_with_the_wrong_name_gets_the_right_one() -> None:
    for seed in range(5):
        time_s, xyz, strange = _flight(seed)
        xyz[_HIDDEN, 1] = xyz[_HIDDEN, 0]
        xyz[_HIDDEN, 0] = np.nan
        # A wrong point beside one of them, as far away as a binding is: it pretends to be a pair
        xyz[9, 0] = xyz[9, 1] - (0.05, 0.3, -0.1)
        named = _named(xyz, time_s, strange)
        assert all(pair in ([1, -1], [-1, -1]) for pair in named[_HIDDEN]), "never the wrong name"
        assert sum(pair == [1, -1] for pair in named[_HIDDEN]) >= 7
        assert named[: _HIDDEN.start] + named[_HIDDEN.stop :] == [[0, 1]] * (_PULSES - 9)


def test_pairs_that_are_exchanged_in_some_pulses_are_set_right() -> None:
    time_s, xyz, strange = _flight(2)
    for t in (3, 17, 18, 30):
        xyz[t, :2] = xyz[t, 1::-1].copy()
        strange[t] = strange[t, ::-1].copy()
    assert _named(xyz, time_s, strange) == [[1, 0] if t in (3, 17, 18, 30) else [0, 1] for t in range(_PULSES)]


def test_a_point_far_from_the_path_is_no_binding() -> None:
    time_s, xyz, strange = _flight(3)
    xyz[20, 1] += (0.0, 0.25, 0.3)
    assert _named(xyz, time_s, strange)[20] == [0, -1]


def test_what_goes_along_with_the_body_does_not_make_a_lone_binding_the_other_one() -> None:
    """A glove beside the right binding: three points of it in a row are no more evidence than one."""
    for seed in range(5):
        time_s, xyz, strange = (part[:10] for part in _flight(seed))
        xyz[:, 1] = xyz[:, 0]
        xyz[:, 0] = np.nan
        xyz[4:7, 0] = xyz[4:7, 1] - (0.05, 0.30, 0.02)
        assert all(pair in ([1, -1], [-1, -1]) for pair in _named(xyz, time_s, np.zeros_like(strange)))
