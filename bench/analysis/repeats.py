"""Whether comparing jumps finds what it says: one jump rendered again and again, and with another leg angle."""

import tempfile
import time
from collections.abc import Iterable
from itertools import combinations, product
from pathlib import Path
from typing import Any, Final

from analysis.cameras.source import read_source
from analysis.comparison.aligned import MeasuredJump, comparable, measured_jump
from analysis.comparison.alignment import align
from analysis.comparison.difference import CHANGES, LEVEL, Difference, difference
from analysis.procedure.analyze import analyze
from bench.analysis.hill_logs import write_hill_log
from bench.analysis.jumps import PULSES, scenario_of
from simrig.world.scenario import Jumper, Scenario, Variation

RATE_HZ: Final = 30.0
_SEED: Final = 7000
_LEG: Final = "alpha"
_CHANGED_EVERY: Final = 3  #: jumps, of which the last one has another leg angle


def run_repeats(seconds: float) -> list[dict[str, Any]]:
    """Render, measure and compare jumps that are alike, and jumps with the leg angle changed by `CHANGES`.

    Every jump is of its own recording; all are oriented with the same survey. The jumps of all pairs are the same few,
    so that the pairs are not independent.

    Args:
        seconds: about how long to go on; two jumps of each kind at least.

    Returns:
        Cases with name, pairs, the share in which a difference was found, and what share was to be expected.
    """
    alike: list[MeasuredJump] = []
    changed: list[MeasuredJump] = []
    end = time.monotonic() + seconds
    made = 0
    with tempfile.TemporaryDirectory(prefix="svev-bench-") as folder:
        while min(len(alike), len(changed)) < 2 or time.monotonic() < end:
            other = made % _CHANGED_EVERY == _CHANGED_EVERY - 1
            scenario = _scenario(CHANGES[_LEG] if other else 0.0)
            (changed if other else alike).extend(_measured(Path(folder), scenario, made))
            made += 1
    same = [difference(align(list(pair))) for pair in combinations(alike, 2)]
    different = [difference(align(list(pair))) for pair in product(alike, changed)]
    predicted = [power.probability for each in different if (power := each.power[_LEG]) is not None]
    return [
        _case("jumps that are alike", same, (bool(each.found()) for each in same), LEVEL),
        _case(
            f"leg angle changed by {CHANGES[_LEG]:g} degrees",
            different,
            (_LEG in each.found() for each in different),
            sum(predicted) / max(1, len(predicted)),
        ),
    ]


def _case(name: str, compared: list[Difference], found: Iterable[bool], expected: float) -> dict[str, Any]:
    count = sum(found)
    quantities = [quantity for each in compared for quantity in each.found()]
    return {
        "name": name,
        "pairs": len(compared),
        "found": round(count / max(1, len(compared)), 3),
        "expected": round(expected, 3),
        "by_quantity": {quantity: quantities.count(quantity) for quantity in sorted(set(quantities))},
    }


def _scenario(leg_deg: float) -> Scenario:
    """A hill whose jumps are all alike, with the leg angle in flight larger by some degrees."""
    scenario = scenario_of("training", _SEED)
    legs = tuple((t, angle + (leg_deg if t > 0 else 0.0)) for t, angle in scenario.jumper.leg_angle_deg)
    jumper = Jumper.model_validate(scenario.jumper.model_dump() | {"leg_angle_deg": legs})
    none = Variation(**dict.fromkeys(Variation.model_fields, 0.0))
    return scenario.model_copy(update={"jumper": jumper, "variation": none})


def _measured(folder: Path, scenario: Scenario, jump: int) -> list[MeasuredJump]:
    """The jump number `jump` of a hill, if it was found."""
    begin = round(jump * scenario.jump_every_s * RATE_HZ)
    log = write_hill_log(folder / f"jump-{jump}", scenario, [begin + pulse for pulse in PULSES], rate_hz=RATE_HZ)
    result = analyze(log.path, read_source(log.survey, None)).result
    log.path.unlink()
    return [measured_jump(result, each.number, f"jump {jump}") for each in result.jumps if comparable(each)]
