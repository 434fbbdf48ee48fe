"""Says whether a measured jump can be trusted, in words for people, with the figures by phase that it rests on."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np

from analysis.result.model import (
    CameraMove,
    CameraOffset,
    JumperState,
    Phase,
    PulseState,
    RayTest,
    SmoothedState,
    TakeOff,
    Verdict,
)

#: A phase is measured well enough if so many of its pulses are solved by at least two rays each.
_ENOUGH_SOLVED: Final = 0.8
#: More gross errors among the rays than this say that something is wrong with the whole recording.
_MANY_REMOVED: Final = 0.05
#: The paper's requirement for coordinates, m (0.2 dm).
REQUIRED_SIGMA_M: Final = 0.02


def judge(
    pulses: Sequence[PulseState],
    takeoff: TakeOff | None,
    tests: Sequence[RayTest],
    synchrony: Mapping[str, CameraOffset],
    moved: Iterable[CameraMove] = (),
) -> Verdict:
    """The verdict on a jump.

    Args:
        pulses: of the jump.
        takeoff: None where it was not found.
        tests: of all rays.
        synchrony: by camera.
        moved: cameras that moved and whose pose was not corrected for it.
    """
    phases = {phase: figures([pulse for pulse in pulses if pulse.phase is phase]) for phase in Phase}
    troubles = [offset.message for offset in synchrony.values() if offset.message is not None]
    troubles += [move.message for move in moved]
    if takeoff is None:
        troubles.append("the take-off was not found, so phases and times are counted from the first pulse")
    for phase, of_phase in phases.items():
        if of_phase["pulses"] and of_phase["solved"] < _ENOUGH_SOLVED * of_phase["pulses"]:
            troubles.append(f"only {of_phase['solved']} of {of_phase['pulses']} pulses are solved ({_WORDS[phase]})")
    removed = sum(test.removed for test in tests)
    if tests and removed > _MANY_REMOVED * len(tests):
        troubles.append(f"{removed} of {len(tests)} rays were taken out as gross errors; see the protocol")
    total = sum(of_phase["pulses"] for of_phase in phases.values())
    solved = sum(of_phase["solved"] for of_phase in phases.values())
    if not total:
        troubles.append("no pulse was measured")
    counted = f"{solved} of {total} pulses solved"
    message = f"{counted}: {'; '.join(troubles)}" if troubles else f"measured well: {counted}"
    return Verdict(not troubles, message, phases)


def figures(pulses: Sequence[PulseState]) -> dict[str, Any]:
    """The figures of some pulses, ready for JSON.

    `solved` counts pulses in which all points and skis were measured; `controlled` those of them in which each was seen
    by three cameras or more; `median_sigma_m` is that of the coordinates of all smoothed points (raw ones where there
    are none), `coarse` the number of pulses in which one is larger than 0.02 m.
    """
    states: list[JumperState | SmoothedState] = [pulse.smoothed or pulse.raw for pulse in pulses]
    sigmas = [
        [np.sqrt(np.diagonal(point.covariance)) for point in state.points.values() if point is not None]
        for state in states
    ]
    everything = [value for of_pulse in sigmas for sigma in of_pulse for value in sigma.tolist()]
    return {
        "pulses": len(pulses),
        "solved": sum(is_solved(pulse.raw) for pulse in pulses),
        "controlled": sum(is_solved(pulse.raw) and _controlled(pulse.raw) for pulse in pulses),
        "median_sigma_m": float(np.median(everything)) if everything else None,
        "coarse": sum(any((sigma > REQUIRED_SIGMA_M).any() for sigma in of_pulse) for of_pulse in sigmas),
    }


def is_solved(state: JumperState) -> bool:
    """Whether all points and skis of a raw solution are there."""
    return all(part is not None for part in (*state.points.values(), *state.skis.values()))


def _controlled(state: JumperState) -> bool:
    parts = [part for part in (*state.points.values(), *state.skis.values()) if part is not None]
    return all(len(part.cameras) > 2 for part in parts)


_WORDS: Final = {Phase.TABLE: "on the table", Phase.EDGE: "around the edge", Phase.FLIGHT: "in flight"}
