"""Clocks that are set, rates that the rig file does not name, double pulses: no triplet mixes pulses.

The ledger, recomputed from the tags, accuses nobody of more than what the pairing itself found out too late.
"""

import math
from dataclasses import replace

import pytest

from bench.triggering.hill import Case, Hill, Result
from bench.triggering.pairing import CASES, pairing_table, run_case
from tests.support.reliability import FaultTable
from tests.triggering.tags import recount, tags_of
from triggering.alarms.momentary import momentary
from triggering.ledger.recounted import Recounted
from triggering.pairing.camera.plausibility import Plausibility, Verdict
from triggering.pairing.outcomes import ClosedPulse

PULSES = 1500
NAMES = ["K1", "K2", "K3"]
#: Triplets that each step, restart or suspension may cost: two frames show it, and those on their way are not used.
COST = 4
#: A step that only the next reading of the clock shows costs all frames until then, a quarter of a second: at 30 Hz,
#: at other rates as long. So does a time in which the computer takes no frames, and a link that has become slower.
COST_LATE = 16
#: A pulse is decided after so long, whatever waits: the hold, and as long as a frame may wait for its clock.
MOST_OPEN_S = 1.3
#: Steps that are smaller are seen by the times of frames only.
LEAST_SEEN_MS = 10.0


#: Pulses between two looks at what is wrong; that is told for ten seconds.
LOOK = 30


class WatchedHill(Hill):
    """A hill whose decided pulses are kept.

    Attributes:
        closed: the decided pulses.
        said: the first thing that was said of clocks, trigger or rate; empty: nothing.
        most_open: most pulses that were undecided at a time: each takes a buffer for its images.
    """

    def __init__(self, case: Case) -> None:
        super().__init__(case if case.slips_ms else replace(case, every_s=4.0), PULSES)
        self.closed: list[ClosedPulse] = []
        self.said = ""
        self.most_open = 0

    def _check(self, closed: list[ClosedPulse]) -> None:
        self.most_open = max(self.most_open, len(self._pairer.open))
        for pulse in closed:
            self.closed.append(pulse)
            if not self.said and len(self.closed) % LOOK == 0:
                health = self._pairer.health()
                self.said = next((alarm.said.text for alarm in momentary(health, NAMES, self._case.rate_hz)), "")
        super()._check(closed)

    @property
    def contradicted(self) -> int:
        """Frames that the pairing itself called lost before their numbers said that there were none."""
        return sum(camera.contradicted for camera in self._pairer.health().cameras)


def troubles_of(case: Case) -> int:
    """How many troubles come, one every four seconds."""
    rates = [1 / rate for rate in case.rates_hz]
    seconds = PULSES * sum(rates) / len(rates)
    single = case.steps_ms or case.spikes_ms or case.stalls_ms or case.skipped_ids or case.delays_ms
    return math.ceil(seconds / 4) if single or case.reboots or case.suspended else 0


def told(result: Result, said: str, found: Recounted) -> tuple[str, str]:
    """What is lost, and what alarm and ledger say, for the table of faults."""
    lost = f"{result.not_found} of {result.possible} triplets, 0 mixed" if result.not_found else "none, 0 mixed"
    first = "the ledger agrees" if found.agrees else f"the ledger: {found.differences[0].in_words()}"
    return lost, f"{said}; {first}" if said else first


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_no_triplet_mixes_pulses_and_every_possible_one_is_found(case: Case, fault_table: FaultTable) -> None:
    hill, troubles = WatchedHill(case), troubles_of(case)
    result = hill.run()
    assert result.possible > PULSES // 4
    assert result.mixed == 0
    assert hill.most_open <= MOST_OPEN_S * max(case.rates_hz) * (2 if case.slips_ms or case.doubled else 1)
    found = recount(tags_of(hill.closed))
    if case.slips_ms:  # nobody can find them again: the camera is not used any more, and that is said
        assert "contradict each other" in hill.said or "and no camera has both" in hill.said
        assert not result.invented or case.every_s * max(case.rates_hz) * 2 < PULSES, "one camera slips: no second tag"
    else:
        # The time of a single frame may be taken for that of a pulse beside the rhythm.
        assert result.invented <= troubles * bool(case.spikes_ms or case.at_once == 3)
        until_read = COST_LATE * max(1.0, case.rate_hz / 30)
        assert result.not_found <= troubles * (until_read if case.stalls_ms or case.at_miss or case.delays_ms else COST)
        assert case.reboots or found.unproven <= len(NAMES) * COST * (troubles + 1)
    asleep = len(NAMES) * troubles if case.suspended or case.skipped_ids or case.at_once == 3 else 0
    # Pulses at which the times of all cameras have slipped have no tag, and the ledger says of which frames.
    accused = [each for each in found.misfiled if not (case.slips_ms and each.why.endswith("have no pulse"))]
    assert asleep or not accused, "right frames are accused"
    small = bool(case.steps_ms) and max(map(abs, case.steps_ms)) < LEAST_SEEN_MS
    several = case.spikes_ms or case.stalls_ms or case.skipped_ids or case.at_once == 3 or case.at_miss
    untagged = len(found.misfiled) - len(accused)
    assert found.disagreements <= untagged + hill.contradicted + asleep + troubles * bool(small or several), (
        found.differences
    )
    lost, said = told(result, hill.said, found)
    fault_table.tell("Clocks, rates and pulses", case.name, lost=lost, said=said)


def test_the_bench_sees_mixed_triplets(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pairing that believes every clock mixes them."""
    monkeypatch.setattr(Plausibility, "judge", lambda *_, **__: Verdict.ACCEPTED)
    case = next(case for case in CASES if case.name == "clocks step by one period")
    hill = WatchedHill(case)
    assert hill.run().mixed > 0
    wrong = [each for each in recount(tags_of(hill.closed)).differences if each.found is None]
    assert wrong, "what is mixed is named afterwards"


def test_the_table_of_the_bench() -> None:
    head, line = pairing_table([run_case(CASES[0], 200)])
    assert " ".join(head.split()) == "case pulses possible mixed not found invented alarm"
    assert " ".join(line.split()) == "nothing wrong 200 200 0 0 0 no"
