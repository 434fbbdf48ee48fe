"""The verdict on a jump: what it says when something is missing or wrong, and that it accuses nobody else."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Final

import numpy as np
import pytest

from analysis.measurements.model import (
    POINTS,
    SIDES,
    ImageMeasurements,
    JumpMeasurements,
    Measurements,
    PulseMeasurements,
    Source,
)
from analysis.procedure.jump import compute_jump
from analysis.procedure.names import told_names
from analysis.result.model import Jump, JumperState
from tests.analysis.simulated import simulated_measurements, true_cameras, true_jump


def _renamed(
    names: dict[str, str], skis: tuple[str, ...] = ("right", "left")
) -> Callable[[int, PulseMeasurements], PulseMeasurements]:
    """Measurements with other names for the points; those without a new one are not measured."""

    def changed(_: int, pulse: PulseMeasurements) -> PulseMeasurements:
        images = {
            camera: ImageMeasurements(
                {names[key]: of for key, of in image.points.items() if key in names},
                {side: of for side, of in image.skis.items() if side in skis},
            )
            for camera, image in pulse.images.items()
        }
        return replace(pulse, images=images)

    return changed


_RIGHT: Final = {name: name for name in POINTS}
_NO_HELMET: Final = {name: name for name in POINTS if name != "P1"}
_NO_HIP: Final = {name: name for name in POINTS if name != "P2"}


@pytest.mark.parametrize(
    ("names", "skis", "given"),
    [
        pytest.param(_RIGHT, (), "P1 P2 P3 P4", id="all four look like a body"),
        pytest.param(_NO_HIP, ("right", "left"), "P1 P3 P4", id="bindings on skis, and no hip is so far from them"),
        pytest.param(_NO_HIP, ("left",), "P1 P4", id="of a binding without its ski another thing may be the marker"),
        pytest.param(_NO_HIP, (), "", id="three markers alone"),
        pytest.param(
            _NO_HELMET, ("right", "left"), "P2 P3 P4", id="bindings on skis, and no helmet is so near in flight"
        ),
        pytest.param(_NO_HELMET, (), "", id="hip and bindings alone"),
        pytest.param({"P1": "P2", "P3": "P3", "P4": "P4"}, ("right", "left"), "P3 P4", id="the helmet as the hip"),
        pytest.param({"P1": "P1", "P2": "P2"}, (), "P1 P2", id="helmet and hip tell each other"),
        pytest.param({"P2": "P1", "P4": "P4"}, ("left",), "P4", id="the hip as the helmet"),
        pytest.param({"P1": "P3", "P2": "P4", "P3": "P1", "P4": "P2"}, (), "", id="not like a body"),
    ],
)
def test_what_nothing_names_is_not_given(names: dict[str, str], skis: tuple[str, ...], given: str) -> None:
    jump = _computed(_renamed(names, skis))
    assert len(jump.pulses) == len(_measured().jumps[0].pulses)
    told = {name for pulse in jump.pulses for name, point in pulse.raw.points.items() if point is not None}
    assert told == set(given.split())
    smoothed = [pulse.smoothed for pulse in jump.pulses if pulse.smoothed is not None]
    assert {name for state in smoothed for name, point in state.points.items() if point is not None} <= told
    lost = sorted(set(names.values()) - told)
    if not told:
        assert not smoothed
        assert jump.verdict.message.count("which marker is which cannot be told, so none is given") == 1
    elif lost:
        assert jump.verdict.message.startswith(f"{' and '.join(lost)} is not given: ")
    else:
        assert "not given" not in jump.verdict.message
    never = sorted(set(POINTS) - set(names.values()))
    assert (f"no pulse shows {', '.join(never)}: " in jump.verdict.message) is bool(told and never)
    assert jump.verdict.ok is (names == _RIGHT and len(skis) == len(SIDES))


@pytest.mark.parametrize(("ahead_m", "told"), [(0.05, "P1 P2 P3 P4"), (0.2, "P1 P2"), (-0.2, "P1 P2")])
def test_bindings_of_which_one_lies_ahead_of_the_other_are_not_told(ahead_m: float, told: str) -> None:
    """A glove or a knee beside the right ski, e.g., which would shift heights and angles by centimetres."""

    def moved(state: JumperState) -> JumperState:
        binding, ski = state.points["P3"], state.skis["right"]
        if binding is None or ski is None:
            return state
        elsewhere = replace(binding, xyz=binding.xyz + ahead_m * ski.direction)
        return replace(state, points={**state.points, "P3": elsewhere})

    states = [pulse.raw for pulse in _whole().pulses]
    assert told_names(states) == {*POINTS, *SIDES}
    assert told_names([moved(state) for state in states]) == {*told.split(), *SIDES}, "skis open forwards"


def test_a_single_binding_on_the_wrong_side_is_not_told() -> None:
    """Only one binding and its ski are ever seen, and named as those of the other side."""

    def single(right: str) -> frozenset[str]:
        def seen(state: JumperState) -> JumperState:
            points = {"P1": state.points["P1"], "P2": None, "P3": state.points[right], "P4": None}
            side = "right" if right == "P3" else "left"
            return replace(state, points=points, skis={"right": state.skis[side], "left": None})

        return told_names([seen(pulse.raw) for pulse in _whole().pulses])

    assert single("P3") == {"P1", "P3", *SIDES}
    assert "P3" not in single("P4")


@cache
def _measured() -> Measurements:
    return simulated_measurements(true_jump(3), true_cameras(), np.random.default_rng(3))


def _computed(change: Callable[[int, PulseMeasurements], PulseMeasurements]) -> Jump:
    """A simulated jump, computed from changed measurements; pulses are counted from 0."""
    measured = _measured()
    changed = tuple(change(k, pulse) for k, pulse in enumerate(measured.jumps[0].pulses))
    return compute_jump(JumpMeasurements(1, changed), measured, true_cameras()).jump


@cache
def _whole() -> Jump:
    """The jump from its measurements as they are."""
    return _computed(lambda _, pulse: pulse)


def test_a_camera_that_was_gone_contradicts_nobody() -> None:
    count = len(_measured().jumps[0].pulses)

    def gone(k: int, pulse: PulseMeasurements) -> PulseMeasurements:
        return replace(pulse, images={n: i for n, i in pulse.images.items() if n != "K2" or k < count // 5})

    def blind(k: int, pulse: PulseMeasurements) -> PulseMeasurements:
        nothing = ImageMeasurements({}, {})
        images = {n: i if n != "K2" or k < count // 5 else nothing for n, i in pulse.images.items()}
        return replace(pulse, images=images)

    assert "points in its images" not in _computed(gone).verdict.message
    assert "camera K2 has the jumper's points in its images" in _computed(blind).verdict.message


def test_without_a_take_off_nothing_is_said_of_edge_and_flight() -> None:
    flying = _computed(lambda k, pulse: pulse if k >= 25 and k % 3 else replace(pulse, images={}))
    assert flying.takeoff is None
    assert "the take-off was not found" in flying.verdict.message
    assert "two cameras must see the edge of the table, and him some metres before it" in flying.verdict.message
    assert "around the edge" not in flying.verdict.message
    assert "in flight" not in flying.verdict.message


def test_a_raw_point_that_the_motion_contradicts_is_marked() -> None:
    """Measured by hand, so that it is not given up although it has two rays only."""
    right, system, wrong = _whole(), true_cameras(), 20
    state = right.pulses[wrong].smoothed
    assert state is not None
    point = state.points["P3"]
    assert point is not None
    place = point.xyz
    ray = place - system["K1"].position
    along = 0.2 * ray / np.linalg.norm(ray)  # farther away for K1: its ray and that of K3 meet there without a residual
    off = np.diff(system["K3"].project(np.array((place, place + along))), axis=0)[0]

    def two_rays(k: int, pulse: PulseMeasurements) -> PulseMeasurements:
        if k != wrong:
            return pulse
        images = {name: image for name, image in pulse.images.items() if name != "K2"}
        point = images["K3"].points["P3"]
        points = {**images["K3"].points, "P3": replace(point, xy=point.xy + off, source=Source.BY_HAND)}
        return replace(pulse, images={**images, "K3": replace(images["K3"], points=points)})

    jump = _computed(two_rays)
    number = jump.pulses[wrong].pulse
    assert not _marked(right)
    assert _marked(jump) == [(number, "P3")]
    assert f"raw points that the motion contradicts: 1, P3 at pulse {number} the most (0.2" in jump.verdict.message


def _marked(jump: Jump) -> list[tuple[int, str]]:
    """Pulse and name of the raw points that the motion contradicts."""
    points = [(pulse.pulse, name, point) for pulse in jump.pulses for name, point in pulse.raw.points.items()]
    return [(pulse, name) for pulse, name, point in points if point is not None and point.contradicted]


def _without(
    camera: str, from_pulse: int, until: int | None = None
) -> Callable[[int, PulseMeasurements], PulseMeasurements]:
    """Measurements in which a camera has frames, but shows nothing, in pulses of a jump counted from 0."""

    def changed(k: int, pulse: PulseMeasurements) -> PulseMeasurements:
        if k < from_pulse or (until is not None and k >= until):
            return pulse
        return replace(pulse, images={**pulse.images, camera: ImageMeasurements({}, {})})

    return changed


def test_measured_well_wants_all_points_controlled_in_four_of_five_pulses_in_sight() -> None:
    whole = _whole()
    assert whole.verdict.ok
    assert "controlled by a third camera in" in whole.verdict.message
    half = len(whole.pulses) // 2
    controlled = _computed(_without("K2", half, half + 1))
    assert controlled.verdict.ok, controlled.verdict.message
    uncontrolled = _computed(_without("K2", half))
    assert "pulses show all points" not in uncontrolled.verdict.message, "two cameras measure them"
    assert not uncontrolled.verdict.ok
    assert "do three cameras or more see each point" in uncontrolled.verdict.message


def test_a_camera_that_is_not_oriented_is_named_and_two_cameras_are_not_relied_on() -> None:
    measured, system = _measured(), true_cameras()
    jump = compute_jump(measured.jumps[0], measured, system.only(("K1", "K3"))).jump
    assert not jump.verdict.ok
    assert jump.verdict.message.startswith("camera K2 is left out: it has no frames in this recording, or is not")
    assert "only in 0 of" in jump.verdict.message


def test_every_sentence_of_a_verdict_can_be_said_in_another_language() -> None:
    doubtful = _computed(_without("K2", 0)).verdict
    assert [each.code for each in doubtful.said] == ["jump_uncontrolled", "jump_counted"] or not doubtful.ok
    assert all(each.code and each.text in doubtful.message for each in doubtful.said)
    assert doubtful.message == "; ".join(map(str, doubtful.said[:-1])) + f" ({doubtful.said[-1]})"
    good = _whole().verdict
    assert good.message == f"measured well: {'; '.join(map(str, good.said))}"
    assert good.said[0].values.keys() == {"count", "pulses", "controlled"}


def test_a_camera_without_a_frame_of_the_jump_is_named() -> None:
    jump = _computed(lambda _, pulse: replace(pulse, images={n: i for n, i in pulse.images.items() if n != "K2"}))
    assert not jump.verdict.ok
    assert jump.verdict.message.startswith("camera K2 has no frame of this jump; ")
