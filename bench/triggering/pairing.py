"""Benchmark of the pairing: triplets mixed, not found and invented under clocks and rates that nobody told it of."""

import math
import time
from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any, Final

from bench.triggering.hill import Case, Hill

_STEPS: Final = (25.0, -25.0, 40.0, -50.0, 75.0, -100.0, 100.0, math.inf, -math.inf)
#: All cases; each camera misses one pulse in a hundred, and loses one frame in a hundred, if the name does not deny it.
CASES: Final = (
    Case("nothing wrong", missed=0.0, lost=0.0),
    Case("missed and lost, 1 % each"),
    Case("drift of 200 ppm", drift_ppm=(200.0, -200.0, 0.0)),
    Case("wander of 30 ppm", wander_ppm=30.0),
    Case("jitter of 2 ms", jitter_ms=2.0),
    Case("pauses", pauses=True),
    Case("random intervals", random_intervals=True),
    Case("clocks step by 25 to 100 ms", steps_ms=_STEPS[:7]),
    Case("clocks step by one period", steps_ms=_STEPS[7:]),
    Case("clocks step by 37 s", steps_ms=(37_000.0, -37_000.0)),
    Case("clocks step, arrivals spread", steps_ms=_STEPS, latency_ms=(5.0, 45.0)),
    *(Case(f"{rate:g} Hz, the rig file says 30", rates_hz=(rate,)) for rate in (31.5, 99.0, 101.0, 105.0, 110.0)),
    *(Case(f"{rate:g} Hz, the rig file says 30", rates_hz=(rate,)) for rate in (70.0, 95.0, 120.0)),
    *(Case(f"{rate:g} Hz, the rig file says 30", rates_hz=(rate,)) for rate in (15.0, 7.5)),
    Case("30, then 50, then 120 Hz", rates_hz=(30.0, 50.0, 120.0)),
    Case("double pulses, 1 ms apart", doubled=0.02, double_ms=1.0),
    Case("double pulses, 5 ms apart", doubled=0.02, double_ms=5.0),
    Case("cameras restart unannounced", reboots=True),
    Case("the computer is suspended", suspended=True),
    *(
        Case(f"times slip {words}{', at a missed pulse' * missed}", slips_ms=slips, at_miss=missed, every_s=15.0)
        for words, slips in (("one period back", (-math.inf,)), ("one period on", (math.inf,)), ("by 2 ms", (2.0,)))
        for missed in (False, True)
    ),
    Case("times of one camera slip by 2 ms", slips_ms=(2.0,), every_s=30.0, missed=0.05, lost=0.05),
    *(Case(f"clocks step by {ms:g} ms", steps_ms=(ms, -ms)) for ms in (0.8, 2.0, 5.0)),
    Case("clocks step back at a missed pulse", steps_ms=(-math.inf,), at_miss=True),
    Case("all clocks step together", steps_ms=(math.inf, -math.inf, 2.0), at_once=3),
    Case("all clocks step, at a missed pulse", steps_ms=(math.inf, -math.inf), at_miss=True, at_once=3),
    Case("times slip by half a period, at a missed pulse", slips_ms=(-16.5,), at_miss=True, every_s=15.0),
    Case("times of two cameras slip by 7 ms", slips_ms=(-7.0,), at_once=2, every_s=15.0),
    Case("single times are off", spikes_ms=(-math.inf, math.inf, -5.0, 16.0)),
    Case("single times are off, behind a lost frame", spikes_ms=(-math.inf,), at_loss=True),
    Case("single times are off, at a missed pulse", spikes_ms=(-math.inf,), at_miss=True),
    Case(
        "times slip two periods on, frames come later",
        rates_hz=(25.0,),
        rate_hz=25.0,
        slips_ms=(80.0,),
        delays_ms=(30.0,),
        latency_ms=(38.0, 39.5),
        every_s=15.0,
    ),
    Case("the computer stands still for 0.3 s", stalls_ms=(300.0,)),
    Case("the computer stands still, clocks step", stalls_ms=(300.0,), steps_ms=(math.inf, -math.inf)),
    Case("the computer stands still, times slip", stalls_ms=(300.0,), slips_ms=(-math.inf, math.inf), every_s=15.0),
    Case("all frames come one period later", delays_ms=(math.inf, 0.0), at_once=3),
    Case(
        "all frames come a little later, at 120 Hz", rates_hz=(120.0,), rate_hz=120.0, delays_ms=(8.0, 0.0), at_once=3
    ),
    Case("frames of one camera come 50 ms later", delays_ms=(50.0, 0.0), latency_ms=(5.0, 9.0)),
    Case("frame numbers skip", skipped_ids=(1, 2, 100)),
)


def run_case(case: Case, pulses: int) -> dict[str, Any]:
    """Run one case.

    Returns:
        Its name, the counts of `Result`, and the processor time, µs per pulse, of the simulation and the pairing.
    """
    before = time.process_time()
    result = Hill(replace(case), pulses).run()
    spent = (time.process_time() - before) / pulses
    return {
        "name": case.name, **asdict(result), "not_found": result.not_found, "us_per_pulse": round(1e6 * spent, 1),
    }  # fmt: skip


def run_pairing(pulses: int, cases: Sequence[Case] = CASES) -> list[dict[str, Any]]:
    """Run all cases with so many pulses each."""
    return [run_case(case, pulses) for case in cases]


def pairing_table(results: Sequence[dict[str, Any]]) -> list[str]:
    """The results for people."""
    head = f"{'case':34}{'pulses':>8}{'possible':>9}{'mixed':>7}{'not found':>10}{'invented':>9}  alarm"
    return [head] + [
        f"{of['name']:34}{of['pulses']:8}{of['possible']:9}{of['mixed']:7}{of['not_found']:10}{of['invented']:9}  "
        f"{'yes' if of['alarm'] else 'no'}"
        for of in results
    ]
