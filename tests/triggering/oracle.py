"""Checks the pairing of simulated cameras against the truth, by three rules.

1. No triplet mixes pulses. 2. Every pulse that any camera saw has exactly one tag. 3. The cause of every missing frame
is right; where frames of one gap are missing for several causes, the number of each cause is right.
"""

from collections import Counter
from collections.abc import Iterator
from itertools import pairwise

from rig.frame import FrameStatus
from tests.triggering.simulation import Run

OK, LOST, MISSED = FrameStatus.OK, FrameStatus.LOST, FrameStatus.MISSED
DAMAGED, ABSENT = FrameStatus.DAMAGED, FrameStatus.ABSENT


def check(run: Run, *, causes: bool = True) -> None:
    """Check all three rules."""
    pulses = check_no_pulse_is_mixed(run)
    check_every_pulse_has_one_tag(run, pulses)
    if causes:
        for camera in range(run.hill.scenario.cameras):
            check_causes(run, pulses, camera)


def check_no_pulse_is_mixed(run: Run) -> list[int | None]:
    """Check rule 1, and that numbers, times, offsets and cargo are consistent.

    Returns:
        The true pulse of each decided one, None where no frame came.
    """
    pulses: list[int | None] = []
    assert [closed.number for closed in run.closed] == list(range(1, len(run.closed) + 1))
    assert all(before.time < after.time for before, after in pairwise(run.closed))
    for closed in run.closed:
        slots = [outcome.record.slot for outcome in closed.outcomes if outcome.record is not None]
        true = {run.hill.pulse_of[slot] for slot in slots}
        assert len(true) <= 1, f"pulse {closed.number} mixes the true pulses {true}"
        assert sorted(slots) == sorted(closed.cargo if isinstance(closed.cargo, list) else [])
        for camera, outcome in enumerate(closed.outcomes):
            assert (outcome.record is not None) == (outcome.status is OK) == (outcome.offset_ns is not None)
            if outcome.record is not None:
                assert run.hill.fates[run.hill.pulse_of[outcome.record.slot]][camera] is OK
        pulses.append(true.pop() if true else None)
    return pulses


def check_every_pulse_has_one_tag(run: Run, pulses: list[int | None]) -> None:
    """Check rule 2, for delivered pulses and for those between them that some camera took but none delivered."""
    hill = run.hill
    delivered = [pulse for pulse in pulses if pulse is not None]
    assert all(before < after for before, after in pairwise(delivered)), "a pulse has two tags, or out of order"
    refused = Counter(hill.pulse_of[slot] for slot in run.unplaced)
    came = {pulse for pulse, fates in enumerate(hill.fates) if fates.count(OK) > refused[pulse]}
    assert came == set(delivered), "a pulse that a camera delivered has no tag"
    presumed = any(counters.presumed for counters in run.pairer.counters)
    for before, after, inserted in undelivered(pulses):
        paused = any(pulse in hill.scenario.pauses for pulse in range(before + 1, after + 1))
        assert paused or inserted <= after - before - 1, "a pulse was invented"
        if presumed:
            continue  # a frame taken before a pause may be proven only after the pause, and then counts there
        between = range(before + 1, after)
        taken = sum(any(fate in (LOST, DAMAGED) for fate in hill.fates[pulse]) for pulse in between)
        assert not paused or inserted <= taken, "a pause was filled"
        # In longer gaps the ids tell how many pulses there were, but not between which others: see the causes.
        if len(between) <= 4:
            seen = sum(can_prove(run, pulse) for pulse in between)
            assert inserted >= seen, "a pulse that a camera saw has no tag"


def can_prove(run: Run, pulse: int) -> bool:
    """Whether the ids of some camera can tell in time that it took a frame that did not come.

    They can if its frames before and after came, in one connection and one unbroken train of pulses.
    """
    cameras = set(range(run.hill.scenario.cameras)) - run.silent
    return any(
        run.hill.fates[pulse][camera] in (LOST, DAMAGED)
        and nearest(run, camera, range(pulse, -1, -1)) is OK
        and nearest(run, camera, range(pulse, len(run.hill.fates))) is OK
        for camera in cameras
    )


def nearest(run: Run, camera: int, pulses: range) -> FrameStatus | None:
    """The first pulse of these that is not a single failure: ok, absent, or None at a pause or the end."""
    for pulse in pulses:
        fate = run.hill.fates[pulse][camera]
        if fate in (OK, ABSENT):
            return fate
        if (pulse if pulses.step < 0 else pulse + 1) in run.hill.scenario.pauses:
            return None
    return None


def undelivered(pulses: list[int | None]) -> Iterator[tuple[int, int, int]]:
    """Pairs of successive delivered pulses, and how many pulses without a frame were inserted between them."""
    before, count = None, 0
    for pulse in pulses:
        if pulse is None:
            count += 1
            continue
        if before is not None:
            yield before, pulse, count
        before, count = pulse, 0


def check_causes(run: Run, pulses: list[int | None], camera: int) -> None:
    """Check rule 3 for one camera, gap by gap."""
    statuses: list[FrameStatus] = []
    last = -1
    for pulse, closed in zip(pulses, run.closed, strict=True):
        outcome = closed.outcomes[camera]
        if outcome.status is not OK:
            statuses.append(outcome.status)
            continue
        assert pulse is not None
        check_gap(run, camera, range(last + 1, pulse), statuses)
        last, statuses = pulse, []
    assert MISSED not in statuses, "nothing came any more, so nothing can be known to be missed"


def check_gap(run: Run, camera: int, gap: range, statuses: list[FrameStatus]) -> None:
    """Check one gap: `statuses` were decided for the pulses between two frames of a camera."""
    hill, is_first = run.hill, gap.start == 0
    truth = [hill.fates[pulse][camera] for pulse in gap]
    presumed = run.pairer.counters[camera].presumed > 0
    if ABSENT in truth:
        # Its last pulses count as lost if the other cameras had not shown by their deadline that it was gone.
        allowed = {ABSENT, DAMAGED, LOST} if presumed else {ABSENT, DAMAGED}
        assert set(statuses) <= allowed, f"camera {camera} was away, not {statuses}"
        return
    reconnected = any(outage.camera == camera for outage in hill.scenario.outages)
    if is_first and (hill.scenario.first_id != 1 or reconnected):
        # Ids that did not begin at 1, or began earlier, prove nothing before the first frame.
        assert reconnected or set(statuses) <= {ABSENT, DAMAGED}
        return
    if ABSENT in statuses:
        assert camera in run.silent or is_first
        assert len(truth) >= 3, f"camera {camera} is said to be absent after {len(truth)} pulses"
        return
    expected, decided = Counter(truth), Counter(statuses)
    where = f"camera {camera}, {gap}: {truth} decided as {statuses}"
    paused = any(pulse in hill.scenario.pauses for pulse in (*gap, gap.stop))
    if presumed and (paused or len(truth) >= 3):
        # Decided at the deadline, before the camera could tell: then they count as lost.
        assert decided[LOST] >= expected[LOST], where
        assert decided[DAMAGED] <= expected[DAMAGED], where
        return
    untagged = len(truth) - len(statuses)
    if is_first:
        # Pulses before the first tag that no camera delivered are not known.
        assert all(0 <= expected[status] - decided[status] <= untagged for status in FrameStatus), where
        return
    # All cameras missed the pulses without a tag.
    assert expected == decided + Counter({MISSED: untagged}), where
