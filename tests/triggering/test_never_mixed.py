"""Clocks that are set, rates that the rig file does not name, double pulses: no triplet mixes pulses."""

import math
from dataclasses import replace

import pytest

from bench.triggering.hill import Case, Hill, Result
from bench.triggering.pairing import CASES, pairing_table, run_case
from triggering.pairing.belief import Witness

PULSES = 1500
#: Triplets that each step, restart or suspension may cost: two frames show it, and those on their way are not used.
COST = 4


def run(case: Case) -> tuple[Result, int]:
    """The result of a case whose troubles come every four seconds, and the number of troubles."""
    rates = [1 / rate for rate in case.rates_hz]
    seconds = PULSES * sum(rates) / len(rates)
    troubles = math.ceil(seconds / 4) if case.steps_ms or case.reboots or case.suspended else 0
    return Hill(replace(case, every_s=4.0), PULSES).run(), troubles


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_no_triplet_mixes_pulses_and_every_possible_one_is_found(case: Case) -> None:
    result, troubles = run(case)
    assert result.possible > PULSES // 4
    assert result.mixed == 0
    assert result.invented == 0
    assert result.not_found <= COST * troubles


def test_the_bench_sees_mixed_triplets(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pairing that believes every clock mixes them."""
    monkeypatch.setattr(Witness, "believes", lambda *_: True)
    case = next(case for case in CASES if case.name == "clocks step by one period")
    assert run(case)[0].mixed > 0


def test_the_table_of_the_bench() -> None:
    head, line = pairing_table([run_case(CASES[0], 200)])
    assert " ".join(head.split()) == "case pulses possible mixed not found invented alarm"
    assert " ".join(line.split()) == "nothing wrong 200 200 0 0 0 no"
