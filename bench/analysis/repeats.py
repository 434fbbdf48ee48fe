"""Whether comparing jumps finds what it says: one jump filmed again and again, and with another leg angle.

The images of either jump are rendered once; each recording has noise of its own. The cameras are oriented once, as for
a day of training, so that the errors of the calibration are the same in all recordings. Beside them stand simulated
measurements of many jumps: these comparisons are independent.
"""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np

from analysis.cameras.poses_file import Calibration, read_poses
from analysis.cameras.source import read_source
from analysis.comparison.aligned import MeasuredJump, measured_jump
from analysis.comparison.alignment import align
from analysis.comparison.difference import CHANGES, FOUND, LEVEL, Difference, Power, difference
from analysis.procedure.analyze import analyze
from analysis.result.model import QUANTITIES
from bench.analysis.hill_logs import HillLog, write_hill_log
from bench.analysis.jumps import PULSES, scenario_of
from bench.analysis.same_images import SameImages
from bench.analysis.simulated_repeats import measured_twice
from photogrammetry.reports.procedures import orientation_to_json
from photogrammetry.reports.result_file import write_result
from simrig.world.scenario import Jumper, Scenario, Variation

RATE_HZ: Final = 30.0
SIZE: Final = (640, 480)
_SEED: Final = 7000
_LEG: Final = "alpha"
_PER_CHANGED: Final = 8  #: comparisons of each changed jump
_NEXT: Final = (1, 2)  #: with which jumps of the ring each is compared
_FEWEST: Final = 5  #: jumps in a ring, so that no pair comes twice


def run_repeats(comparisons: int) -> list[dict[str, Any]]:
    """Film, measure and compare jumps that are alike, and such with another leg angle.

    The leg angle is changed by as much as the comparison tells the chance of, and by as little as it says to find in
    80 % of the comparisons. Jumps that are alike stand in a ring: each is compared with the next two, so that it is in
    four comparisons. Each changed jump is compared with eight of them.

    Args:
        comparisons: of jumps that are alike; there are half as many such jumps, and a sixteenth with each change. Of
            simulated measurements there are as many comparisons.

    Returns:
        Cases with name, pairs, the share in which a difference was found, what share was to be expected, in how many
        pairs each quantity was found different, and the mean square of differences over their stated sigmas.
    """
    count = max(comparisons // len(_NEXT), _FEWEST)
    with tempfile.TemporaryDirectory(prefix="svev-bench-") as name:
        folder = Path(name)
        hill = _Hill(folder, 0.0)
        poses = hill.oriented()
        ring = [hill.measured(number, poses) for number in range(count)]
        same = [_compared(one, ring[(k + step) % count]) for step in _NEXT for k, one in enumerate(ring)]
        cases = [_case("jumps that are alike", same, _anything, LEVEL)]
        power = _mean_power(same)
        for change_deg, expected in ((power.change, power.probability), (power.change_80, FOUND)):
            hill = _Hill(folder, change_deg)
            others = [hill.measured(count + k, poses) for k in range(-(-count // _PER_CHANGED))]
            different = [_compared(one, others[k // _PER_CHANGED]) for k, one in enumerate(ring)]
            title = f"leg angle changed by {change_deg:.3g} degrees"
            cases.append(_case(title, different, lambda each: _LEG in each.found(), expected))
    simulated = [_compared(*measured_twice(draw)) for draw in range(comparisons)]
    return [*cases, _case("simulated measurements, jumps that are alike", simulated, _anything, LEVEL)]


def _anything(compared: Difference) -> bool:
    return bool(compared.found())


def _compared(one: MeasuredJump, other: MeasuredJump) -> Difference:
    return difference(align([one, other]))


def _mean_power(compared: list[Difference]) -> Power:
    """What would have been found in the leg angle."""
    known = [power for each in compared if (power := each.power[_LEG]) is not None]
    probability = float(np.mean([power.probability for power in known]))
    return Power(CHANGES[_LEG], probability, float(np.mean([power.change_80 for power in known])))


class _Hill:
    """A hill whose jumps are all alike.

    Args:
        folder: for its logs.
        leg_deg: by how much the leg angle in flight is larger.
    """

    def __init__(self, folder: Path, leg_deg: float) -> None:
        self._folder, self._scenario = folder, _scenario(leg_deg)
        self._images = SameImages(self._scenario, PULSES, SIZE, RATE_HZ)

    def oriented(self) -> Calibration:
        """The cameras, oriented by a recording of their own."""
        log = self._filmed(0)
        orientation = analyze(log.path, read_source(log.survey, None)).orientation
        if orientation is None:
            raise RuntimeError("the simulated hill was not oriented")
        write_result(orientation_to_json(orientation), poses := self._folder / "poses.json")
        return read_poses(poses)

    def measured(self, number: int, poses: Calibration) -> MeasuredJump:
        """A jump of a recording with noise of its own."""
        log = self._filmed(number + 1)
        result = analyze(log.path, poses).result
        log.path.unlink()
        return measured_jump(result, 1, f"jump {number}")

    def _filmed(self, seed: int) -> HillLog:
        path = self._folder / f"jump-{seed}"
        return write_hill_log(path, self._scenario, PULSES, SIZE, RATE_HZ, self._images.noisy(seed))


def _case(
    name: str, compared: list[Difference], found: Callable[[Difference], bool], expected: float
) -> dict[str, Any]:
    quantities = [quantity for each in compared for quantity in each.found()]
    squares = np.nanmean([np.nanmean((each.value / each.repeat) ** 2, axis=1) for each in compared], axis=0)
    return {
        "name": name,
        "pairs": len(compared),
        "found": round(sum(map(found, compared)) / len(compared), 3),
        "expected": round(expected, 3),
        "by_quantity": {quantity: quantities.count(quantity) for quantity in sorted(set(quantities))},
        "mean_square": dict(zip(QUANTITIES, squares.round(2).tolist(), strict=True)),
    }


def _scenario(leg_deg: float) -> Scenario:
    """A hill whose jumps are all alike, with the leg angle in flight larger by some degrees."""
    scenario = scenario_of("training", _SEED)
    legs = tuple((t, angle + (leg_deg if t > 0 else 0.0)) for t, angle in scenario.jumper.leg_angle_deg)
    jumper = Jumper.model_validate(scenario.jumper.model_dump() | {"leg_angle_deg": legs})
    none = Variation(**dict.fromkeys(Variation.model_fields, 0.0))
    return scenario.model_copy(update={"jumper": jumper, "variation": none})
