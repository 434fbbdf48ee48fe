"""Logs mixed on purpose, by a pairing that believes every time: the ledger names all wrong frames, no right ones."""

import math
from dataclasses import replace

import pytest

from bench.triggering.hill import Case, Hill
from bench.triggering.pairing import CASES
from tests.triggering.tags import recount, tags_of
from triggering.ledger.recounted import Recounted
from triggering.pairing.camera.plausibility import Plausibility, Verdict
from triggering.pairing.outcomes import ClosedPulse

PULSES = 900
#: Troubles in this time; each concerns the next camera. When the times of all have slipped, no pulse is mixed.
TROUBLES = 2
#: Frames of a camera that come at once when the computer has stood still: their arrivals say nothing.
IN_STALL = 12
OWN = (
    Case("25 Hz: times slip, at a missed pulse", (25.0,), 25.0, slips_ms=(-math.inf, math.inf), at_miss=True),
    Case("50 Hz: times slip by two periods", (50.0,), 50.0, slips_ms=(-40.0, 40.0)),
    Case(
        "50 Hz: clocks step at a missed pulse, arrivals spread",
        (50.0,),
        50.0,
        steps_ms=(-math.inf, math.inf),
        at_miss=True,
        latency_ms=(5.0, 11.0),
    ),
    Case(
        "25 Hz: the computer stands still, clocks step at a missed pulse",
        (25.0,),
        25.0,
        stalls_ms=(300.0,),
        steps_ms=(-math.inf, math.inf),
        at_miss=True,
    ),
    Case("100 Hz: single times are off, at a missed pulse", (100.0,), 100.0, spikes_ms=(-math.inf,), at_miss=True),
    Case("50 Hz: many missed and lost, clocks step", (50.0,), 50.0, steps_ms=(-math.inf,), missed=0.1, lost=0.1),
)
#: Of the bench those in which such a pairing mixes pulses.
MIXED = (
    "times slip one period back", "times slip one period back, at a missed pulse", "clocks step back at a missed pulse",
    "single times are off, behind a lost frame", "single times are off, at a missed pulse",
    "the computer stands still, clocks step", "the computer stands still, times slip",
)  # fmt: skip


class MixedHill(Hill):
    """A hill that knows of each frame in a log which pulse it is of.

    Attributes:
        closed: the decided pulses.
        later: of how many pulses later each frame is, by pulse number and camera; those of pulses whose frames all are
            of one other pulse are left out.
    """

    def __init__(self, case: Case) -> None:
        super().__init__(replace(case, every_s=PULSES / case.rates_hz[0] / (TROUBLES + 0.5)), PULSES)
        self.closed: list[ClosedPulse] = []
        self.later: dict[tuple[int, int], int] = {}

    def _check(self, closed: list[ClosedPulse]) -> None:
        for pulse in closed:
            self.closed.append(pulse)
            own = min(self._times, key=lambda each: abs(self._host(self._times[each]) - pulse.time))
            frames = {place: one.record.slot for place, one in enumerate(pulse.outcomes) if one.record is not None}
            if set(frames.values()) != {own} and len(set(frames.values())) == 1:
                continue
            self.later |= {(pulse.number, place): slot - own for place, slot in frames.items()}
        super()._check(closed)


def named(found: Recounted) -> set[tuple[int, int]]:
    """Pulse and camera of all frames that the ledger calls frames of other pulses."""
    return {
        (pulse, int(each.camera[1:]) - 1)
        for each in found.misfiled
        if each.last is not None
        for pulse in range(each.pulse, each.last + 1)
    }


@pytest.mark.parametrize("case", [*OWN, *(case for case in CASES if case.name in MIXED)], ids=lambda case: case.name)
def test_wrong_frames_are_named_and_right_ones_never(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Plausibility, "judge", lambda *_, **__: Verdict.ACCEPTED)
    hill = MixedHill(case)
    hill.run()
    said = named(recount(tags_of(hill.closed)))
    wrong = {frame for frame, by in hill.later.items() if by}
    assert wrong, "the log is mixed"
    assert len(wrong - said) <= (IN_STALL * TROUBLES if case.stalls_ms else 0)
    assert not {frame for frame in said if hill.later.get(frame) == 0}
