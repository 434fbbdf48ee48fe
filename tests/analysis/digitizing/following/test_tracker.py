"""A mark by hand is carried through the pulses: as far as the images show the thing, and no farther."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.digitizing.following.points.candidates import Origin
from analysis.digitizing.following.points.tracker import Tracker
from analysis.digitizing.following.points.tracks import Mark
from analysis.measurements.model import POINTS, PointMeasurement
from rig.errors import BadInputError
from tests.analysis.digitizing.following.tracked_hill import HAND_PX, NAMES, RATE_HZ, TrackedHill, hill

FEW = 8


def _start(of: TrackedHill, thing: str) -> int:
    return of.in_sight(thing)[2]


@pytest.mark.parametrize("direction", [1, -1])
def test_a_helmet_is_carried_through_some_pulses(direction: int) -> None:
    of = hill(21)
    start = of.in_sight("P1")[2 if direction == 1 else -3]
    (track,) = of.tracker.track({start: of.marks(start, "P1")}, start, direction, FEW)
    assert list(track.places) == [start + direction * k for k in range(1, FEW + 1)]
    assert track.stopped.text == "it was tracked as far as was asked"
    assert np.abs(of.errors(track, "P1")).max() < 4
    assert all(place.origin is Origin.TRACKED for places in track.places.values() for place in places.values())


def test_nothing_is_given_out_that_no_image_shows() -> None:
    of = hill(21)
    start = _start(of, "P1")

    def blind(pulse: int) -> dict[str, NDArray[np.uint8]]:
        images = of.frames(pulse)
        return images if pulse <= start + 3 else {name: np.full_like(image, 120) for name, image in images.items()}

    tracker = Tracker(blind, RATE_HZ, of.system, of.background(30))
    (track,) = tracker.track({start: of.marks(start, "P1")}, start, 1, FEW)
    assert list(track.places) == [start + 1, start + 2, start + 3]
    assert track.last == start + 3
    assert "K1 shows nothing that" in track.stopped.text
    assert track.stopped.text.startswith(f"pulse {start + 6}: ")


def test_a_lost_frame_is_bridged() -> None:
    of = hill(21)
    start = _start(of, "P1")
    tracker = Tracker(
        lambda pulse: {} if pulse == start + 3 else of.frames(pulse), RATE_HZ, of.system, of.background(30)
    )
    (track,) = tracker.track({start: of.marks(start, "P1")}, start, 1, FEW)
    assert start + 3 not in track.places
    assert start + FEW in track.places


def test_marks_on_the_way_win() -> None:
    of = hill(21)
    start = _start(of, "P1")
    marks = {start: of.marks(start, "P1"), start + 4: of.marks(start + 4, "P1")}
    (track,) = of.tracker.track(marks, start, 1, FEW)
    assert start + 4 not in track.places
    assert start + 5 in track.places
    assert np.abs(of.errors(track, "P1")).max() < 4


def test_a_mark_that_contradicts_the_track_stops_it() -> None:
    of = hill(21)
    start = _start(of, "P1")
    wrong = {name: replace(mark, xy=mark.xy + np.array((0, 8))) for name, mark in of.marks(start + 4, "P1").items()}
    (track,) = of.tracker.track({start: of.marks(start, "P1"), start + 4: wrong}, start, 1, FEW)
    assert list(track.places) == [start + 1, start + 2, start + 3]
    assert track.stopped.text.startswith(f"pulse {start + 4}: the marks of K1, K2, K3 contradict the track")


def test_marks_that_contradict_each_other_are_refused() -> None:
    of = hill(21)
    start = _start(of, "P1")
    marks = of.marks(start, "P1")
    marks["K2"] = replace(marks["K2"], xy=marks["K2"].xy + np.array((0, 12)))
    with pytest.raises(BadInputError, match="contradict each other"):
        of.tracker.track({start: marks}, start, 1, FEW)
    with pytest.raises(BadInputError, match="not marked there"):
        of.tracker.track({start: marks}, start + 1, 1, FEW)


def test_what_was_measured_automatically_is_taken_where_it_agrees() -> None:
    of = hill(21)
    start = _start(of, "P1")

    def automatic(pulse: int) -> dict[str, PointMeasurement]:
        off = 9.0 if pulse == start + 2 else 0.0
        return {"K2": PointMeasurement(of.true(pulse, "K2", "P1") + off, 0.05**2 * np.eye(2))}

    (track,) = of.tracker.track({start: of.marks(start, "P1")}, start, 1, 4, automatic)
    origins = {pulse: places["K2"].origin for pulse, places in track.places.items()}
    assert origins[start + 3] is Origin.AUTOMATIC
    assert origins[start + 2] is Origin.TRACKED
    assert all(places["K1"].origin is Origin.TRACKED for places in track.places.values())


def test_a_camera_that_is_not_oriented_is_tracked_by_itself() -> None:
    of = hill(21)
    start = _start(of, "P1")
    tracker = Tracker(of.frames, RATE_HZ)
    tracks = tracker.track({start: of.marks(start, "P1")}, start, 1, FEW)
    assert len(tracks) == len(NAMES)
    for name, track in zip(NAMES, tracks, strict=True):
        assert {key for places in track.places.values() for key in places} <= {name}
        assert track.velocity is None
        assert np.abs(of.errors(track, "P1")).max(initial=0.0) < 4
    assert sum(len(track.places) == FEW for track in tracks) >= 2


def test_things_of_one_jumper_are_tracked_together() -> None:
    of = hill(21)
    start = max(_start(of, thing) for thing in ("P1", "P2", "P3"))
    marks = {thing: {start: of.marks(start, thing)} for thing in ("P1", "P2", "P3")}
    tracks = of.tracker.track_together({**marks, "P4": {}}, start, 1, FEW)
    assert set(tracks) == {"P1", "P2", "P3"}
    for thing, (track,) in tracks.items():
        assert len(track.places) == FEW, track.stopped
        assert np.abs(of.errors(track, thing)).max() < 4
        assert track.velocity is not None
        assert np.linalg.norm(track.velocity - of.truth[start]["velocity"]) < 6
    with pytest.raises(BadInputError, match="nothing is marked there"):
        of.tracker.track_together(marks, start + 1, 1, FEW)


def test_cameras_that_follow_different_things_end_the_track() -> None:
    """The images of one camera begin to sink by half a px in each pulse: it shows no longer the same place in space."""
    of = hill(21)
    start = _start(of, "P1")
    sinks = start + 6

    def slipping(pulse: int) -> dict[str, NDArray[np.uint8]]:
        images = of.frames(pulse)
        return {**images, "K3": np.roll(images["K3"], max(0, pulse - sinks) // 2, axis=0)}

    tracker = Tracker(slipping, RATE_HZ, of.system)
    marks = {name: Mark(of.true(start, name, "P1"), np.full(2, HAND_PX)) for name in NAMES}
    (track,) = tracker.track({start: marks}, start, 1, 20)
    assert track.last < sinks + 10
    assert track.last == max(track.places, default=start)
    assert (
        "contradict each other or the motion" in track.stopped.text or "follow different things" in track.stopped.text
    )


@pytest.mark.long
@pytest.mark.parametrize("markers", [True, False])
def test_thirty_pulses_are_carried_with_honest_sigmas(markers: bool) -> None:
    """On seeds that nothing was chosen by; without markers a binding on a plain ski is not asked for."""
    errors, lengths = [], []
    for seed in range(31, 36):
        of = hill(seed, markers=markers)
        for thing in POINTS if markers else ("P1", "P2"):
            start = of.in_sight(thing)[2]
            marks = {start: of.marks(start, thing)}
            track = of.tracker.track_together({thing: marks}, start, 1, 30)[thing][0]
            errors.append(of.errors(track, thing))
            lengths.append(len(track.places))
    joined = np.concatenate(errors)
    assert 0.8 < np.sqrt((joined**2).mean()) < 1.3
    assert np.abs(joined).max() < 5
    assert np.mean(np.array(lengths) >= 28) > 0.7


def test_shaking_cameras_and_changing_light_do_not_end_a_track() -> None:
    """Every frame is off by some tenths of a px and a fifth brighter or darker; marks are where the frames show it."""
    of, random = hill(21), np.random.default_rng(5)
    start = _start(of, "P1")
    pulses = range(start - FEW, start + FEW + 1)
    shifts = {(pulse, name): random.normal(0, 0.4, 2) for pulse in pulses for name in NAMES}
    light = {key: random.uniform(0.75, 1.05) for key in shifts}

    def shown(pulse: int) -> dict[str, NDArray[np.uint8]]:
        frames = {}
        for name, image in of.frames(pulse).items():
            move = np.column_stack((np.eye(2), shifts[pulse, name]))
            moved = cv2.warpAffine(image, move, image.shape[::-1], flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
            frames[name] = np.clip(np.rint(light[pulse, name] * moved), 0, 255).astype(np.uint8)
        return frames

    marks = {name: replace(mark, xy=mark.xy + shifts[start, name]) for name, mark in of.marks(start, "P1").items()}
    (track,) = Tracker(shown, RATE_HZ, of.system).track({start: marks}, start, 1, FEW)
    assert list(track.places) == [start + k for k in range(1, FEW + 1)], track.stopped
    for pulse, places in track.places.items():
        for name, place in places.items():
            off = place.xy - shifts[pulse, name] - of.true(pulse, name, "P1")
            assert np.abs(off / place.sigma).max() < 4, (pulse, name)


def test_a_mark_has_a_sigma_that_the_track_keeps() -> None:
    of = hill(21)
    start = _start(of, "P1")
    vague = {name: Mark(mark.xy, np.full(2, 1.0)) for name, mark in of.marks(start, "P1").items()}
    (track,) = of.tracker.track({start: vague}, start, 1, 3)
    assert all((place.sigma >= 1.0).all() for places in track.places.values() for place in places.values())
    assert HAND_PX < 1.0
