"""The ledger recomputed from a log's tags and events: it agrees with what is true, and names every tag that is not."""

from collections import Counter
from collections.abc import Callable, Sequence

import msgspec
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rig.clocks import NS_PER_S, DeviceNs, UtcNs
from rig.events import Event, Level
from rig.frame import FrameStatus
from rig.pulse import PulseNumber
from rig.tag import CameraTag, TripletTag
from tests.triggering.simulation import MS, Hill, Outage, Run, Scenario
from tests.triggering.tags import OK, recount, tags_of

LOST, MISSED, DAMAGED, ABSENT = FrameStatus.LOST, FrameStatus.MISSED, FrameStatus.DAMAGED, FrameStatus.ABSENT
#: What becomes of single frames, (pulse, camera); all others come.
FAULTS = {(100, 1): LOST, (120, 1): MISSED, (140, 1): DAMAGED, (160, 0): LOST, (160, 2): MISSED}


def changed(tags: Sequence[TripletTag], pulse: int, change: Callable[[CameraTag], CameraTag]) -> list[TripletTag]:
    """The tags, with K2's part of one pulse changed."""
    found = list(tags)
    at = next(place for place, tag in enumerate(found) if tag.pulse == pulse)
    first, middle, *rest = found[at].cameras
    found[at] = msgspec.structs.replace(found[at], cameras=(first, change(middle), *rest))
    return found


@pytest.fixture(scope="module")
def tags() -> list[TripletTag]:
    run = Run(Hill(Scenario(seed=1, pulses=240, faults=FAULTS)))
    found = tags_of(run.closed)
    assert {(tag.pulse - 1, place) for tag in found for place, c in enumerate(tag.cameras) if c.status is not OK} == {
        *FAULTS
    }
    return found


@pytest.mark.parametrize("trigger_counts", [False, True])
@pytest.mark.parametrize("modulus", [0, 65_535])
def test_it_agrees_with_the_truth_whatever_was_lost_or_missed(trigger_counts: bool, modulus: int) -> None:
    """The frame numbers wrap in the middle; the clocks drift by 200 ppm."""
    scenario = Scenario(
        seed=5, pulses=1500, missed=0.02, lost=0.02, damaged=0.01, first_id=65_000, modulus=modulus,
        drift_ppm=(0.0, 200.0, -200.0), trigger_counts=trigger_counts,
    )  # fmt: skip
    run = Run(Hill(scenario))
    assert not run.silent
    found = recount(tags_of(run.closed))
    assert found.agrees, found.differences
    assert found.pulses == 1500
    truth = [Counter(fates[camera] for fates in run.hill.fates) for camera in range(3)]
    assert found.unproven <= 3 * 2, "only what lies before the first and after the last frame of a camera"
    wrong = sum((states - true).total() for states, true in zip(found.states.values(), truth, strict=True))
    assert wrong <= found.unproven


@pytest.mark.parametrize(
    ("pulse", "tagged", "found"),
    [(101, MISSED, LOST), (101, ABSENT, LOST), (121, LOST, MISSED), (121, ABSENT, MISSED), (141, MISSED, LOST)],
)
def test_a_false_tag_is_named(tags: list[TripletTag], pulse: int, tagged: FrameStatus, found: FrameStatus) -> None:
    lie = changed(tags, pulse, lambda part: msgspec.structs.replace(part, status=tagged))
    (difference,) = recount(lie).differences
    assert (difference.pulse, difference.camera, difference.tagged, difference.found) == (pulse, "K2", tagged, found)
    assert difference.in_words().startswith(f"pulse {pulse}: K2 is tagged {tagged} and was {found}: its frame numbers")


def test_frames_under_the_wrong_pulse_are_named_as_one_stretch(tags: list[TripletTag]) -> None:
    """From pulse 40 to 59 K2's frames are those of the next pulse, and their times say so."""
    mixed = list(tags)
    for pulse in range(40, 60):
        other = tags[pulse].cameras[1]
        mixed = changed(mixed, pulse, lambda _, other=other: other)  # type: ignore[misc]
    mixed = changed(mixed, 60, lambda part: CameraTag(part.name, part.columns, LOST))
    found = recount(mixed)
    (stretch,) = [each for each in found.differences if each.found is None]
    assert (stretch.pulse, stretch.last, stretch.camera, stretch.by) == (40, 59, "K2", 1)
    assert "33.3 ms after this pulse" in stretch.why


def slipped(tags: Sequence[TripletTag], first: int, last: int, by: int) -> list[TripletTag]:
    """K2's times slip by whole periods while the camera numbers its frames on: pulses hold those of others.

    The pulses from `first` to `last` hold the frames of `by` pulses later, at the times of their own pulses. Where two
    frames have one pulse, the second one is not used.
    """
    found, own = list(tags), {tag.pulse: tag for tag in tags}
    nothing = CameraTag("K2", tags[0].cameras[1].columns, MISSED)
    for tag in tags:
        source = own.get(PulseNumber(tag.pulse + by))
        if last < tag.pulse <= last + by or (first <= tag.pulse <= last and (source is None or source.pulse < first)):
            found = changed(found, tag.pulse, lambda _: nothing)
        elif first <= tag.pulse <= last and source is not None:
            part = source.cameras[1]
            if part.device_time is not None:
                part = msgspec.structs.replace(part, device_time=DeviceNs(part.device_time - (source.time - tag.time)))
            found = changed(found, tag.pulse, lambda _, part=part: part)  # type: ignore[misc]
    return found


@pytest.mark.parametrize("by", [1, -1, 2, -2])
@pytest.mark.parametrize("last", [300, 400])
@pytest.mark.parametrize(("seed", "latest_ms", "unnamed"), [(0, 9, 3), (1, 9, 3), (3, 9, 3), (4, 45, 40)])
def test_a_stretch_of_frames_of_other_pulses_is_named_whole(
    by: int, last: int, seed: int, latest_ms: int, unnamed: int
) -> None:
    """The times slip at pulse 150 and come back at 300, or never; what is named are the pulses that are mixed.

    Where arrivals scatter over more than a period, a few frames beside missing ones may not be named.
    """
    scenario = Scenario(
        seed=seed, pulses=400, missed=0.01, lost=0.01, damaged=0.005, drift_ppm=(0.0, 50.0, -50.0),
        latency_ns=(5 * MS, latest_ms * MS),
    )  # fmt: skip
    right = tags_of(Run(Hill(scenario)).closed)
    assert recount(right).agrees
    tags = slipped(right, 150, last, by)
    own = {tag.pulse: tag.cameras[1].frame_id for tag in right}
    mixed = [tag.pulse for tag in tags if tag.cameras[1].status is OK and tag.cameras[1].frame_id != own[tag.pulse]]
    (stretch,) = recount(tags).differences
    assert (stretch.camera, stretch.by) == ("K2", by)
    assert stretch.last is not None
    assert mixed[0] <= stretch.pulse <= mixed[0] + unnamed
    assert mixed[-1] - unnamed <= stretch.last <= mixed[-1]
    pulses = "pulse" if abs(by) == 1 else "pulses"
    said = f"pulses {stretch.pulse} to {stretch.last}: K2 holds the frames of {abs(by)} {pulses} "
    assert stretch.in_words().startswith(said)
    found = stretch.to_json()
    assert (found["pulse"], found["last_pulse"], found["by_pulses"]) == (stretch.pulse, stretch.last, by)


@pytest.mark.parametrize("at_miss", [True, False])
def test_right_frames_behind_mixed_ones_are_not_accused(at_miss: bool) -> None:
    """K2's clock is set back by one period, and is believed for nine pulses more: its frames behind them are right."""
    faults = {(149, 1): MISSED} if at_miss else {}
    right = tags_of(Run(Hill(Scenario(seed=2, pulses=400, faults=faults))).closed)
    assert recount(right).agrees
    tags, period_ns = slipped(right, 150, 158, 1), right[200].time - right[199].time
    for tag in tags[159:]:
        part = tag.cameras[1]
        assert part.device_time is not None
        set_back = msgspec.structs.replace(part, device_time=DeviceNs(part.device_time - period_ns))
        tags = changed(tags, tag.pulse, lambda _, part=set_back: part)  # type: ignore[misc]
    for each in recount(tags).misfiled:
        assert 149 <= each.pulse <= (each.last or each.pulse) <= 159


def test_a_pulse_without_any_tag_is_noticed(tags: list[TripletTag]) -> None:
    rest = [tag for tag in tags if tag.pulse != 50]
    assert recount(rest).agrees, "its number is missing, which `verify` says"
    renumbered = [msgspec.structs.replace(tag, pulse=PulseNumber(tag.pulse - (tag.pulse > 50))) for tag in rest]
    found = recount(renumbered)
    assert {(each.pulse, each.camera) for each in found.differences} == {(49, "K1"), (49, "K2"), (49, "K3")}
    assert "its frame numbers tell of 1 frames until pulse 50 that have no pulse" in found.differences[0].why


@pytest.mark.parametrize("step_s", [37.0, -37.0, 0.033, -0.05])
def test_a_clock_that_is_set_accuses_nobody(tags: list[TripletTag], step_s: float) -> None:
    def stepped(part: CameraTag) -> CameraTag:
        if part.device_time is None:
            return part
        return msgspec.structs.replace(part, device_time=DeviceNs(part.device_time + round(step_s * NS_PER_S)))

    after = list(tags)
    for tag in tags[79:]:
        after = changed(after, tag.pulse, stepped)
    for pulse in (80, 81, 82):
        after = changed(after, pulse, lambda part: CameraTag(part.name, part.columns, DAMAGED))
    found = recount(after)
    assert found.agrees, found.differences
    assert found.unproven == 3


def test_absent_needs_an_event_that_says_so() -> None:
    """K2 is frozen for a second; its clock and its numbers go on as if nothing had happened."""
    run = Run(Hill(Scenario(seed=2, pulses=200, outages=(Outage(1, 2.0, 3.0, None),))))
    assert run.silent == {1}
    frozen = tags_of(run.closed)
    away = [tag for tag in frozen if tag.cameras[1].status is ABSENT]
    assert len(away) > 20
    silent = Event(UtcNs(away[2].time), Level.WARNING, "K2", "silent: three pulses behind the other cameras")
    assert recount(frozen, [silent]).agrees
    assert {each.tagged for each in recount(frozen).differences} == {ABSENT}
    elsewhere = msgspec.structs.replace(silent, name="K3")
    assert not recount(frozen, [elsewhere]).agrees


_NUMBERS = st.one_of(st.integers(0, 100), st.integers(-(10**20), 10**20), st.just(10**400))
_TIMES = st.one_of(st.integers(0, 10**10), st.integers(-(10**20) + 1, 10**20 - 1), st.just(5))


@settings(max_examples=100)
@example([(pulse, pulse * 2 * NS_PER_S, OK, pulse, pulse, 5, 5) for pulse in (1, 2, 3)])
@example([(pulse, pulse * NS_PER_S, OK, 10**400 * pulse, 1, 5 * pulse, 5) for pulse in (1, 2, 3)])
@given(
    st.lists(
        st.tuples(st.integers(1, 10**12), _TIMES, st.sampled_from(FrameStatus), _NUMBERS, _NUMBERS, _TIMES, _TIMES),
        max_size=12,
    )
)
def test_whatever_a_log_says_it_is_judged(rows: list[tuple[int, int, FrameStatus, int, int, int, int]]) -> None:
    """Damaged and hostile logs hold tags that no recorder wrote."""
    tags = [
        TripletTag(
            PulseNumber(pulse), UtcNs(time), "", "r", (48, 64),
            (CameraTag("K1", (0, 64), status, frame_id, triggers, DeviceNs(device), UtcNs(host)),),
        )
        for pulse, time, status, frame_id, triggers, device, host in rows
    ]  # fmt: skip
    found = recount(tags)
    assert found.pulses <= len(rows)
    assert sum(states.total() for states in found.states.values()) <= found.pulses
    assert all(difference.in_words() for difference in found.differences)
