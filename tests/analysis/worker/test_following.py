"""Who is followed from pulse to pulse, and what becomes of markers that come into sight later."""

import numpy as np
import pytest

from analysis.identification.seeking import Seeker
from analysis.measurements.model import POINTS, MeasuredCamera
from analysis.result.model import Status
from analysis.worker.following import Followed, Follower
from tests.analysis.identification.cluttered import Disturbed, SimulatedLook, scene
from tests.analysis.simulated import RATE_HZ, true_cameras, true_jump

BEGUN, SHOWN, LAST = 28, 34, 54  # pulses: he is found, his bindings are hidden until here, the end
SOUGHT = 15  # pulses that are searched
LARGEST = 4.5  # sigmas; 3e-5 of points are farther off


def _measured(followed: Followed, label: str) -> bool:
    point = followed.state.points[label]
    return point is not None and point.status is not Status.PREDICTED


def test_bindings_that_come_into_sight_later_are_found_by_seeking_anew() -> None:
    """By the past alone they could be anywhere, and each of them the other one."""
    system, truth = true_cameras(), true_jump(7)
    hidden = Disturbed(false_spots=5, hidden=tuple((label, None, 0, SHOWN) for label in ("P3", "P4")))
    made = scene([truth], system, np.random.default_rng(1), range(15, LAST), hidden)
    cameras = {name: MeasuredCamera((640, 480), 0.0) for name in system.names}
    until = [c for c in made.candidates if c.pulse <= BEGUN]
    seeker, follower, told = Seeker(system, {}), Follower(system, cameras, RATE_HZ), []
    assert follower.find(seeker, until[-SOUGHT:])
    looks = 0
    for candidates in made.candidates[len(until) :]:
        follower.expected(candidates.time)
        followed = follower.follow(candidates)
        told.append((followed, follower.hidden()))
        if not follower.look_is_due():
            continue
        looks += 1
        again = Follower(system, cameras, RATE_HZ)
        recent = [c for c in made.candidates if candidates.pulse - SOUGHT < c.pulse <= candidates.pulse]
        if again.find(seeker, recent, 4 - follower.hidden()) and again.knows_more_than(follower):
            assert not follower.knows_more_than(again)
            again.continue_from(follower)
            follower = again
    assert [left for followed, left in told if followed.pulse <= SHOWN] == [2] * (SHOWN - BEGUN)
    assert [left for _, left in told][-5:] == [0] * 5
    assert 1 < looks < 5
    for followed, _ in told:
        for i, label in enumerate(("P1", "P2", "P3", "P4")):
            point = followed.state.points[label]
            if point is not None and _measured(followed, label):
                off = point.xyz - truth.pose(followed.pulse).markers[i]
                assert off @ np.linalg.solve(point.covariance, off) < LARGEST**2
    assert all(_measured(told[-1][0], label) for label in ("P3", "P4"))


def test_what_was_never_seen_is_expected_where_people_have_it() -> None:
    system, truth = true_cameras(), true_jump(7)
    hidden = Disturbed(hidden=tuple((label, None, 0, 999) for label in ("P3", "P4")))
    made = scene([truth], system, np.random.default_rng(1), range(15, LAST), hidden)
    cameras = {name: MeasuredCamera((640, 480), 0.0) for name in system.names}
    follower = Follower(system, cameras, RATE_HZ)
    assert follower.find(Seeker(system, {}), made.candidates[:SOUGHT])
    for candidates in made.candidates[SOUGHT:]:
        expected = follower.expected(candidates.time)
        for name, of in expected.items():
            places = system[name].project(truth.pose(candidates.pulse).markers)
            off = np.linalg.norm(of.markers - places, axis=1)
            assert (off < of.reach).all()
            assert (of.reach[2:] < 100.0).all()  # px; the filter alone knows nothing within metres
        follower.follow(candidates)
    assert follower.hidden() == 2


@pytest.mark.parametrize(
    ("hidden", "given"),
    [pytest.param(("P2",), set(), id="three markers alone"), pytest.param((), {"P1", "P2", "P3", "P4"}, id="all")],
)
def test_markers_whose_names_nothing_bears_out_are_not_told(hidden: tuple[str, ...], given: set[str]) -> None:
    """No ski is seen: a helmet and two gloves would look the same."""
    system, truth = true_cameras(), true_jump(7)
    disturbed = Disturbed(hidden=tuple((label, None, 0, 999) for label in hidden))
    made = scene([truth], system, np.random.default_rng(1), range(15, 40), disturbed)
    cameras = {name: MeasuredCamera((640, 480), 0.0) for name in system.names}
    follower = Follower(system, cameras, RATE_HZ)
    told = follower.find(Seeker(system, {}), made.candidates[:SOUGHT])
    told += [follower.follow(candidates) for candidates in made.candidates[SOUGHT:]]
    assert told
    assert follower.last == made.candidates[-1].pulse, "he is followed, whatever is told of him"
    for followed in told:
        assert {label for label, point in followed.state.points.items() if point is not None} == given
        assert (followed.state.height is not None) == bool(given)
        assert all(ski is None for ski in followed.state.skis.values())


@pytest.mark.parametrize("worn", [False, True])
def test_what_is_no_disc_like_the_markers_is_not_followed_as_one(*, worn: bool) -> None:
    """A face where the helmet has no marker: the whole jump says so at its end, and every state before."""
    system, truth = true_cameras(), true_jump(7)
    made = scene([truth], system, np.random.default_rng(1), range(15, 40), Disturbed(5, light={"P1": 0.5}))
    look = SimulatedLook(dict.fromkeys(POINTS, 80.0) | {"P1": 40.0 if worn else 1e9})
    cameras = {name: MeasuredCamera((640, 480), 0.0) for name in system.names}
    seeker, follower, told = Seeker(system, {}), Follower(system, cameras, RATE_HZ), []
    assert follower.find(seeker, made.candidates[:SOUGHT], look=look)
    for end in range(SOUGHT, len(made.candidates)):
        told.append(follower.follow(made.candidates[end], look))
        again = Follower(system, cameras, RATE_HZ)
        if follower.look_is_due() and again.find(seeker, made.candidates[end - SOUGHT : end + 1], look=look):
            assert worn or not again.knows_more_than(follower)
    assert any(_measured(followed, "P1") for followed in told) == worn
    assert sum(_measured(followed, "P4") for followed in told) > len(told) / 2 or not worn
