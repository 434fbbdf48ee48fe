"""What counts of the automatic measurement and of the marks of a person: the marks, and the rest of the automatic ones.

A mark of a point or ski takes the place of the automatic measurement in its image, also one that says that nothing can
be measured there. A guess takes its place as well, and is not computed from.
"""

from collections.abc import Iterable, Mapping
from typing import Final

import numpy as np

from analysis.digitizing.marks.journal import Entered, Key
from analysis.digitizing.marks.things import LINES
from analysis.measurements.entries import SIGMA_BY_HAND
from analysis.measurements.model import (
    POINTS,
    ImageMeasurements,
    JumpMeasurements,
    Measurements,
    PointMeasurement,
    PulseMeasurements,
    SkiMeasurement,
    Source,
)
from rig.api.digitizing import MarkSource, MarkState
from rig.arrays import Floats
from rig.clocks import UtcNs
from rig.pulse import PulseNumber

#: Marks farther apart are of different jumps, s.
_ANOTHER_JUMP_S: Final = 2.0
_BY_HAND: Final = frozenset({MarkSource.HAND, MarkSource.REFINED})


def sigma_of(entered: Entered) -> tuple[float, float]:
    """Standard deviations of a mark in x and y, px."""
    return entered.sigma or (SIGMA_BY_HAND, SIGMA_BY_HAND)


def covariance_of(entered: Entered) -> Floats:
    """Covariance (2, 2) of a mark, px^2."""
    return np.diag(np.square(sigma_of(entered)))


def effective_pulse(
    pulse: int, time: UtcNs, marks: Mapping[Key, Entered], automatic: PulseMeasurements | None
) -> PulseMeasurements:
    """What counts at a pulse.

    Args:
        pulse: its number.
        time: when it fired.
        marks: of a person at this pulse.
        automatic: what was measured automatically; None: nothing.
    """
    images = {} if automatic is None else dict(automatic.images)
    for camera in dict.fromkeys(key.camera for key in marks):
        there = images.get(camera, ImageMeasurements({}, {}))
        points, skis = dict(there.points), dict(there.skis)
        own = {key: entered for key, entered in marks.items() if key.camera == camera}
        for thing in dict.fromkeys(key.thing for key in own):
            if thing in POINTS:
                points.pop(thing, None)
                if (point := _point(own[Key(pulse, camera, thing)])) is not None:
                    points[thing] = point
            elif thing in LINES:
                skis.pop(LINES[thing], None)
                if (ski := _ski([e for k, e in sorted(own.items()) if k.thing == thing])) is not None:
                    skis[LINES[thing]] = ski
        images[camera] = ImageMeasurements(points, skis)
    return PulseMeasurements(PulseNumber(pulse), time, images)


def effective(
    automatic: Measurements, marks: Iterable[tuple[Key, Entered]], times: Mapping[int, UtcNs]
) -> Measurements:
    """What counts of a recording, jump by jump.

    Marks between or near the pulses of a jump that was measured automatically belong to it; others make new jumps.

    Args:
        automatic: what was measured automatically; its rate and cameras are those of the log.
        marks: of a person; things of which the stick model knows nothing are left out.
        times: when the pulses fired; marks of other pulses are left out.
    """
    by_pulse: dict[int, dict[Key, Entered]] = {}
    for key, entered in marks:
        if key.pulse in times and (key.thing in POINTS or key.thing in LINES):
            by_pulse.setdefault(key.pulse, {})[key] = entered
    known = {int(pulse.pulse): (jump.number, pulse) for jump in automatic.jumps for pulse in jump.pulses}
    gap = _ANOTHER_JUMP_S * automatic.rate_hz
    groups: list[list[int]] = []
    of_jump: int | None = None
    for number in sorted(known.keys() | by_pulse.keys()):
        own = known[number][0] if number in known else None
        another = own is not None and of_jump is not None and own != of_jump
        if not groups or another or number - groups[-1][-1] > gap:
            groups.append([])
            of_jump = None
        groups[-1].append(number)
        of_jump = own or of_jump
    jumps = []
    for count, group in enumerate(groups, 1):
        pulses = range(group[0], group[-1] + 1)
        jumps.append(
            JumpMeasurements(
                count,
                tuple(
                    effective_pulse(n, times[n], by_pulse.get(n, {}), known[n][1] if n in known else None)
                    for n in pulses
                    if n in times
                ),
            )
        )
    return Measurements(automatic.recording, automatic.rate_hz, automatic.cameras, tuple(jumps))


def _point(entered: Entered) -> PointMeasurement | None:
    if entered.state is not MarkState.MEASURED or entered.xy is None:
        return None
    return PointMeasurement(np.array(entered.xy), covariance_of(entered), _source(entered))


def _ski(vertices: list[Entered]) -> SkiMeasurement | None:
    measured = [v for v in vertices if v.state is MarkState.MEASURED and v.xy is not None]
    if len(measured) < 2:
        return None
    xy = np.array([v.xy for v in measured])
    sigma = np.array([np.sqrt(np.mean(np.square(sigma_of(v)))) for v in measured])
    by_hand = any(v.source in _BY_HAND for v in measured)
    return SkiMeasurement(xy, sigma, Source.BY_HAND if by_hand else Source.AUTOMATIC)


def _source(entered: Entered) -> Source:
    return Source.BY_HAND if entered.source in _BY_HAND else Source.AUTOMATIC
