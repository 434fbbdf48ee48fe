"""`protocol.html` and `protocol.txt`: everything that a geodesist needs to judge a measured recording.

Nothing of the session stands in them. Names are corrected later, and only the files of `analysis.result.naming` are
written anew then; what was noted about an athlete is for nobody who opens the link to his jump.
"""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from analysis.measurements.model import POINTS, SIDES, JumpMeasurements, Measurements, Source
from analysis.report.fates import WHY, fates_drawing, why_missing
from analysis.report.figures import fixed
from analysis.report.protocol_norwegian import norwegian
from analysis.result.model import (
    Jump,
    JumperState,
    MeasuredRecording,
    OrientationResult,
    Phase,
    PulseState,
    RayTest,
    Status,
)
from photogrammetry.procedures.orientation import Orientation
from photogrammetry.reports.document import Drawing, Report, Section, Table, write_report
from photogrammetry.reports.procedures import orientation_report
from rig.errors import BadInputError

#: How many rays are listed; what was removed is listed whole.
WORST_RAYS = 40
_MM = 1000.0
Part = str | Table | Drawing


def write_protocol(
    result: MeasuredRecording, measurements: Measurements, out: Path, orientation: Orientation | None = None
) -> tuple[Path, Path]:
    """Write `protocol.txt` and `protocol.html` into a folder; the page is in English and Norwegian.

    Args:
        result: what was measured.
        measurements: what was measured in the images of its jumps.
        out: the folder, made if it does not exist.
        orientation: the adjustment of the network of balls, if the cameras were oriented by it.

    Returns:
        The text and the page.

    Raises:
        BadInputError: the folder cannot be written to.
    """
    try:
        english = protocol(result, measurements, orientation)
        return write_report(english, out, norwegian(english, result))
    except OSError as error:
        raise BadInputError(f"{out}: cannot be written ({error.strerror}); choose another folder") from None


def protocol(result: MeasuredRecording, measurements: Measurements, orientation: Orientation | None = None) -> Report:
    """The protocol; see `write_protocol`."""
    measured = {jump.number: jump for jump in measurements.jumps}
    sections = [
        Section("Recording", tuple(_recording(result))),
        Section("Orientation of the cameras", tuple(_orientation(result.orientation))),
        Section("Balls", tuple(_balls(result.orientation))),
        Section("Synchrony", tuple(_synchrony(result))),
    ]
    for jump in result.jumps:
        sections += _jump(jump, measured.get(jump.number), result.rate_hz)
    if not result.jumps:
        sections.append(Section("Jumps", ("there is no jump in this recording",)))
    if orientation is not None:
        adjusted = orientation_report(orientation)
        sections += [Section(f"Network of balls: {s.title}", s.parts) for s in adjusted.sections]
    return Report(f"Protocol of recording {result.recording}", tuple(sections))


def _recording(result: MeasuredRecording) -> Iterable[Part]:
    yield f"recording {result.recording}, {result.rate_hz:g} pulses per second, {len(result.jumps)} jumps"
    yield (
        "lengths m, sigmas of lengths mm, angles and their sigmas degrees; sigmas are standard deviations and hold in "
        "the frame of the survey"
    )


def _orientation(orientation: OrientationResult) -> Iterable[Part]:
    yield f"source: {orientation.source}; {len(orientation.parameters)} uncertain parameters with one joint covariance"
    head = ("camera", "X0", "Y0", "Z0", "sX0", "sY0", "sZ0", "s right", "s up", "s axis")
    rows = [
        (
            name,
            *(fixed(v, 3) for v in image.position),
            *(fixed(v * _MM, 1) for v in image.sigma_position),
            *(fixed(v, 4) for v in image.sigma_angles),
        )
        for name, image in orientation.images.items()
    ]
    yield Table(head, tuple(rows))
    yield "s right, s up, s axis: sigma of the turns about the camera's own axes"
    yield from (f"moved: {move.message} (p = {move.p:.1e})" for move in orientation.moved)
    if not orientation.moved:
        yield "no camera moved"
    yield from orientation.messages


def _balls(orientation: OrientationResult) -> Iterable[Part]:
    if not orientation.balls:
        yield "none"
        return
    rows = [
        (
            name,
            ball.role,
            *(fixed(float(v), 3) for v in ball.xyz),
            *(fixed(float(v) * _MM, 1) for v in ball.sigma),
            " ".join(ball.images) or "none",
        )
        for name, ball in orientation.balls.items()
    ]
    yield Table(("ball", "role", "X", "Y", "Z", "sX", "sY", "sZ", "images"), tuple(rows))
    places = [
        (name, camera, *(fixed(float(v), 2) for v in place[:2]), *(fixed(float(v), 3) for v in place[2:]))
        for name, ball in orientation.balls.items()
        for camera, place in ball.images.items()
    ]
    if places:
        yield "measured in the images, px:"
        yield Table(("ball", "camera", "x", "y", "sx", "sy"), tuple(places))


def _synchrony(result: MeasuredRecording) -> Iterable[Part]:
    if not result.synchrony:
        yield "not tested"
        return
    rows = [
        (
            name,
            fixed(o.offset_ms, 2),
            fixed(o.sigma_ms, 2),
            fixed(o.offset_ms / o.sigma_ms, 1),
            o.message or "synchronous",
        )
        for name, o in result.synchrony.items()
    ]
    yield "how much later than the others each camera shows the jumper, from the jumper himself:"
    yield Table(("camera", "offset (ms)", "sigma (ms)", "offset / sigma", "finding"), tuple(rows))


def _jump(jump: Jump, measured: JumpMeasurements | None, rate_hz: float) -> list[Section]:
    return [
        Section(f"Jump {jump.number}: verdict", tuple(_verdict(jump, rate_hz))),
        Section(f"Jump {jump.number}: what was measured", tuple(_coverage(jump, measured))),
        Section(f"Jump {jump.number}: tests of rays, the worst first", tuple(_tests(jump))),
        Section(f"Jump {jump.number}: what is missing, and why", tuple(_refused(jump))),
    ]


def _verdict(jump: Jump, rate_hz: float) -> Iterable[Part]:
    yield f"{'reliable' if jump.verdict.ok else 'not reliable'}: {jump.verdict.message}"
    takeoff = jump.takeoff
    if takeoff is None:
        yield "the take-off was not in sight"
    else:
        sigma_ms = takeoff.sigma_pulses / rate_hz * 1000
        yield f"take-off at pulse {takeoff.pulse:.3f} ± {takeoff.sigma_pulses:.3f} (± {sigma_ms:.2f} ms)"
    figures = jump.verdict.phases
    names = list(dict.fromkeys(name for phase in figures.values() for name in phase))
    if names:
        rows = [
            (phase.value, *(_cell(figures[phase].get(name)) for name in names)) for phase in Phase if phase in figures
        ]
        yield Table(("phase", *names), tuple(rows))


def _cell(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_cell(part)}" for key, part in value.items())
    return f"{value:.4g}" if isinstance(value, float) else "-" if value is None else str(value)


def _coverage(jump: Jump, measured: JumpMeasurements | None) -> Iterable[Part]:
    """Per phase: how many pulses have each point, by how many rays, and how sure they are."""
    yield "raw: solution of each pulse alone; columns count pulses by status of the point or ski"
    rows = []
    for phase in Phase:
        pulses = [pulse for pulse in jump.pulses if pulse.phase is phase]
        rows += [
            (phase.value, name, *_counts([_member(pulse.raw, name) for pulse in pulses])) for name in (*POINTS, *SIDES)
        ]
    yield Table(("phase", "what", *(status.value for status in Status), "missing"), tuple(rows))
    yield "mean sigma of points, mm, from each pulse alone and from the model over time:"
    sigmas = []
    for phase in Phase:
        pulses = [pulse for pulse in jump.pulses if pulse.phase is phase]
        raw = _mean_sigma([pulse.raw for pulse in pulses])
        smoothed = _mean_sigma([pulse.smoothed for pulse in pulses if pulse.smoothed is not None])
        sigmas.append((phase.value, str(len(pulses)), *raw, *smoothed))
    yield Table(("phase", "pulses", "raw X", "raw Y", "raw Z", "smoothed X", "smoothed Y", "smoothed Z"), tuple(sigmas))
    if measured is not None:
        yield "measured in the images, by camera:"
        yield _measured(measured)


def _member(state: JumperState, name: str) -> Status | None:
    found = state.points.get(name) if name in POINTS else state.skis.get(name)
    return None if found is None else found.status


def _counts(statuses: list[Status | None]) -> tuple[str, ...]:
    counts = Counter(statuses)
    return tuple(str(counts[status]) for status in (*Status, None))


def _mean_sigma(states: Iterable[JumperState]) -> tuple[str, ...]:
    variances = [
        np.diagonal(point.covariance) for state in states for point in state.points.values() if point is not None
    ]
    if not variances:
        return ("-",) * 3
    return tuple(fixed(float(v), 1) for v in np.sqrt(np.mean(variances, axis=0)) * _MM)


def _measured(measured: JumpMeasurements) -> Table:
    counts: dict[str, Counter[str]] = {}
    for pulse in measured.pulses:
        for camera, image in pulse.images.items():
            count = counts.setdefault(camera, Counter())
            count.update([*image.points, *image.skis])
            sources = [*(p.source for p in image.points.values()), *(s.source for s in image.skis.values())]
            count["by hand"] += sources.count(Source.BY_HAND)
    names = (*POINTS, *SIDES, "by hand")
    rows = tuple((camera, *(str(count[name]) for name in names)) for camera, count in counts.items())
    return Table(("camera", *names), rows)


def _tests(jump: Jump) -> Iterable[Part]:
    tested = [test for test in jump.tests if math.isfinite(test.w)]
    free = len(jump.tests) - len(tested)
    if not tested:
        yield "no ray is controlled by others"
        return
    worst = sorted(tested, key=lambda test: -abs(test.w))[:WORST_RAYS]
    above = sum(abs(test.w) > 2 for test in tested)
    yield (
        f"{len(tested)} rays and image lines tested, {above} of them with |w| > 2 ({above / len(tested):.1%}; "
        f"4.6 % are expected); {free} are controlled by nothing"
    )
    yield Table(("pulse", "camera", "what", "residual (px)", "w", ""), tuple(_row(test) for test in worst))


def _row(test: RayTest) -> tuple[str, ...]:
    removed = "removed" if test.removed else ""
    return str(test.pulse), test.camera, test.what, fixed(test.residual_px, 2), fixed(test.w, 1), removed


def _refused(jump: Jump) -> Iterable[Part]:
    """What was left out as a gross error, what could not be controlled, and what was not solved."""
    drawing = fates_drawing(jump)
    if drawing is not None:
        yield drawing
    removed = [test for test in jump.tests if test.removed]
    if removed:
        yield f"{len(removed)} rays or image lines were left out as gross errors:"
        yield Table(("pulse", "camera", "what", "residual (px)", "w", ""), tuple(_row(test) for test in removed))
    for what, fate, pulses in why_missing(jump):
        yield f"{what}: no raw solution at {_ranges(pulses)}: {WHY[fate]}"
    for name in (*POINTS, *SIDES):
        two = [pulse for pulse in jump.pulses if _member(pulse.raw, name) is Status.TWO_RAYS]
        if two:
            yield f"{name}: two rays, not controllable, at {_ranges(two)}"
    unsmoothed = [pulse for pulse in jump.pulses if pulse.smoothed is None]
    if unsmoothed:
        yield f"no values from the model over time at {_ranges(unsmoothed)}"


def _ranges(pulses: Sequence[PulseState]) -> str:
    """`pulses 12, 14-17`."""
    numbers = [int(pulse.pulse) for pulse in pulses]
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][1] + 1:
            runs[-1][1] = number
        else:
            runs.append([number, number])
    return "pulses " + ", ".join(str(a) if a == b else f"{a}-{b}" for a, b in runs)
