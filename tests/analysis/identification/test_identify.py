"""Identification on candidates with much that is neither marker nor ski."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from analysis.candidates.model import ImageCandidates, Spots
from analysis.identification.identify import identify
from analysis.identification.markers.markers import Markers
from analysis.identification.markers.synchrony import lateness
from analysis.identification.over_time.flights import Flight
from analysis.identification.over_time.window import Window
from analysis.identification.space.views import Views
from analysis.measurements.model import POINTS, JumpMeasurements
from rig.arrays import Floats
from tests.analysis.identification.cluttered import Disturbed, Scene, SimulatedLook, scene
from tests.analysis.simulated import RATE_HZ, SIGMA_PX, true_cameras, true_jump

PULSES = range(15, 70)
#: A spot is the named marker if it lies within 6 sigma of it; spots of others or of nothing do so once in a million.
NEAR_PX = 6 * SIGMA_PX


def _wrong_points(jumps: Sequence[JumpMeasurements], made: Scene) -> list[tuple[int, str, str]]:
    return [
        (pulse.pulse, camera, label)
        for jump in jumps
        for pulse in jump.pulses
        for camera, image in pulse.images.items()
        for label, point in image.points.items()
        if np.linalg.norm(point.xy - made.spots.get((pulse.pulse, camera, label), np.full(2, np.inf))) > NEAR_PX
    ]


def _share(jumps: Sequence[JumpMeasurements], made: Scene) -> float:
    named = sum(len(image.points) for jump in jumps for pulse in jump.pulses for image in pulse.images.values())
    return named / len(made.spots)


@pytest.mark.parametrize(
    "disturbed",
    [
        Disturbed(),
        Disturbed(false_spots=20),
        Disturbed(false_spots=20, body_spots=3, lost=0.1),
    ],
    ids=["clean", "clutter", "clutter and losses"],
)
def test_nothing_is_named_wrongly_and_little_is_missed(disturbed: Disturbed) -> None:
    made = scene([true_jump(7)], true_cameras(), np.random.default_rng(1), PULSES, disturbed)
    jumps = identify(made.candidates, true_cameras(), RATE_HZ)
    assert len(jumps) == 1
    assert not _wrong_points(jumps, made)
    assert _share(jumps, made) > 0.97


def test_without_a_jumper_there_is_no_jump() -> None:
    disturbed = Disturbed(false_spots=25)
    made = scene([], true_cameras(), np.random.default_rng(3), range(60), disturbed)
    assert identify(made.candidates, true_cameras(), RATE_HZ) == []


def test_markers_hidden_in_two_views_are_not_invented() -> None:
    hidden = tuple((label, camera, 42, 46) for label in ("P2", "P3") for camera in ("K1", "K2"))
    made = scene([true_jump(7)], true_cameras(), np.random.default_rng(4), PULSES, Disturbed(20, hidden=hidden))
    jumps = identify(made.candidates, true_cameras(), RATE_HZ)
    assert not _wrong_points(jumps, made)
    named = [p for p in jumps[0].pulses if 42 <= p.pulse <= 46 for c in ("K1", "K2") if "P2" in p.images[c].points]
    assert not named


def test_a_late_camera_is_named_too() -> None:
    """8 ms are 0.2 m or 7 px: no ray of the late camera meets those of the others."""
    made = scene([true_jump(8)], true_cameras(), np.random.default_rng(5), PULSES, Disturbed(8, late_s={"K2": 0.008}))
    jumps = identify(made.candidates, true_cameras(), RATE_HZ)
    assert not _wrong_points(jumps, made)
    assert _share(jumps, made) > 0.97


def test_a_camera_one_frame_late_is_named_where_markers_are_often_missed() -> None:
    """The others show hardly six in ten of their markers, so the late one shows no more either."""
    disturbed = Disturbed(8, lost=0.36, late_s={"K2": 1 / RATE_HZ})
    made = scene([true_jump(8)], true_cameras(), np.random.default_rng(5), PULSES, disturbed)
    jumps = identify(made.candidates, true_cameras(), RATE_HZ)
    assert not _wrong_points(jumps, made)
    in_k2 = [label for jump in jumps for p in jump.pulses if "K2" in p.images for label in p.images["K2"].points]
    assert len(in_k2) > 0.75 * sum(camera == "K2" for _, camera, _ in made.spots)


def test_who_is_too_slow_for_times_to_differ_shows_no_late_camera(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[Views, Window, Markers, Flight]] = []

    def noted(views: Views, window: Window, markers: Markers, flight: Flight) -> Floats:
        asked.append((views, window, markers, flight))
        return lateness(views, window, markers, flight)

    monkeypatch.setattr("analysis.identification.identify.lateness", noted)
    disturbed = Disturbed(8, late_s={"K2": 1 / RATE_HZ})
    identify(
        scene([true_jump(8)], true_cameras(), np.random.default_rng(6), PULSES, disturbed).candidates,
        true_cameras(),
        RATE_HZ,
    )
    views, window, markers, flight = asked[0]
    assert lateness(views, window, markers, flight).any()
    walking = flight.motion * np.array(((1.0,), (0.03,), (1.0,)))
    assert not lateness(views, window, markers, replace(flight, motion=walking)).any()


@pytest.mark.parametrize("missing", ["P2", "P3", "P4"])
def test_a_marker_that_is_not_worn_is_not_found(missing: str) -> None:
    disturbed = Disturbed(10, body_spots=1, hidden=((missing, None, 0, 999),))
    made = scene([true_jump(7)], true_cameras(), np.random.default_rng(6), PULSES, disturbed)
    jumps = identify(made.candidates, true_cameras(), RATE_HZ)
    assert not _wrong_points(jumps, made)
    assert _share(jumps, made) > 0.95


def _put_beside(made: Scene, pulses: range, rng: np.random.Generator) -> None:
    """Put what looks like a marker into K2 and K3, as far to the right of P3 as P4 is to its left."""
    for at, candidates in enumerate(made.candidates):
        if candidates.pulse not in pulses:
            continue
        images = dict(candidates.images)
        place = true_jump(7).pose(candidates.pulse).markers[2] + np.array((rng.normal(0.0, 0.03), -0.3, 0.0))
        for camera in ("K2", "K3"):
            xy = true_cameras()[camera].project(place) + SIGMA_PX * rng.standard_normal(2)
            sigma = SIGMA_PX**2 * np.eye(2)
            one = Spots(xy[None], sigma[None], np.array([1.6]), np.array([80.0]), np.array([20.0]))
            images[camera] = ImageCandidates(Spots.joined([images[camera].spots, one]))
        made.candidates[at] = replace(candidates, images=images)


def test_rays_lose_the_names_that_they_got_from_untold_points() -> None:
    """P4 is hidden, and something beside P3 makes a pair with it: which of the two is P3 cannot be told."""
    rng = np.random.default_rng(7)
    hidden = (("P4", None, 0, 37), ("P3", "K1", 0, 31))
    made = scene([true_jump(7)], true_cameras(), rng, PULSES, Disturbed(10, hidden=hidden, lost=0.05))
    _put_beside(made, range(24, 29), rng)
    jumps = identify(made.candidates, true_cameras(), RATE_HZ)
    assert not _wrong_points(jumps, made)
    assert _share(jumps, made) > 0.93


def _all_are_true(jump: JumpMeasurements) -> None:
    """Whether all named points are where their markers are."""
    for pulse in jump.pulses:
        for camera, image in pulse.images.items():
            for label, point in image.points.items():
                marker = true_jump(7).pose(pulse.pulse).markers[POINTS.index(label)]
                assert np.linalg.norm(point.xy - true_cameras()[camera].project(marker)) < NEAR_PX


@pytest.mark.long
@pytest.mark.parametrize("marker", ["P1", "P4"])
def test_what_is_no_disc_like_the_markers_is_none_and_a_marker_in_the_shade_is_one(marker: str) -> None:
    """A face, e.g., where the helmet has no marker, is as faint as one in the shade."""
    lights = dict.fromkeys(POINTS, 80.0) | {marker: 40.0}
    dim = Disturbed(light={marker: 0.5})
    made = scene([true_jump(7)], true_cameras(), np.random.default_rng(1), PULSES, dim)
    for look, named in ((SimulatedLook(lights), True), (SimulatedLook({**lights, marker: 1e9}), False)):
        (jump,) = identify(made.candidates, true_cameras(), RATE_HZ, None, look)
        found = {label for pulse in jump.pulses for image in pulse.images.values() for label in image.points}
        assert found == {label for label in POINTS if named or label != marker}
        _all_are_true(jump)
        made = scene([true_jump(7)], true_cameras(), np.random.default_rng(1), PULSES, dim)


def test_what_is_never_a_disc_is_none_also_where_few_markers_are() -> None:
    """Small markers, half covered ones and poor light: one spot of three is a disc."""
    lights = dict.fromkeys(POINTS, 80.0) | {"P1": 1e9}
    made = scene([true_jump(7)], true_cameras(), np.random.default_rng(1), PULSES, Disturbed(light={"P1": 0.5}))
    (jump,) = identify(made.candidates, true_cameras(), RATE_HZ, None, SimulatedLook(lights, every=3))
    found = {label for pulse in jump.pulses for image in pulse.images.values() for label in image.points}
    assert found == {"P2", "P3", "P4"}


@pytest.mark.long
def test_a_second_look_adds_what_was_missed() -> None:
    made = scene([true_jump(7)], true_cameras(), np.random.default_rng(7), PULSES, Disturbed(5, lost=0.3))

    system = true_cameras()
    before = identify(made.candidates, system, RATE_HZ)
    after = identify(made.candidates, system, RATE_HZ, None, SimulatedLook())
    assert _share(after, made) > 1.25 * _share(before, made)
    _all_are_true(after[0])
