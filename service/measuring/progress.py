"""How far the measuring of a log is that waits, or is at work."""

from collections.abc import Sequence
from typing import Final

from rig.api.jump import LastJump
from rig.api.measuring import AfterStep, Measurement, MeasuringQueue, MeasuringState, MeasuringStep, StepState
from rig.settings.model import AnalysisSettings

#: What is at work in these steps; in all others the log is measured.
_AT_WORK: Final = {MeasuringStep.VIDEO: AfterStep.VIDEO}


def in_queue(
    known: Measurement,
    ids: Sequence[str],
    running: MeasuringQueue | None,
    figures: tuple[LastJump, ...],
    analysis: AnalysisSettings | None,
) -> Measurement:
    """What is known of a log, with its place among those that wait to be measured, or how far it is.

    Args:
        known: of the log, as it is kept.
        ids: of those that wait, in order; those that are at work are among them.
        running: what is at work; None: nothing.
        figures: of that one, before its files are there.
        analysis: how logs are measured, None if the rig file does not say that.
    """
    if running is not None and running.step is MeasuringStep.COPYING:
        running = None
    if known.recording not in ids:
        return known
    if running is None or running.recording != known.recording:
        others = [other for other in ids if running is None or other != running.recording]
        before = others.index(known.recording) + (running is not None)
        update: dict[str, object] = {"state": MeasuringState.WAITING, "before": before}
        running = None
    else:
        update = {name: getattr(running, name) for name in ("state", "paused", "step", "share")}
        if running.step in _AT_WORK:  # what was measured is there
            update["state"] = known.state
        elif figures and not known.files:
            update |= {"figures": figures, "live": False}
    return known.model_copy(update=update | {"steps": _steps(known, running, analysis)})


def _steps(
    known: Measurement, running: MeasuringQueue | None, analysis: AnalysisSettings | None
) -> tuple[StepState, ...]:
    """How far the steps are of a log that waits, or is at work."""
    before = {each.step: each for each in known.steps}
    wanted = (AfterStep.MEASURE, *(() if analysis is None else analysis.after_recording))
    steps = [step for step in AfterStep if step in wanted]
    now = -1
    if running is not None:
        now = steps.index(AfterStep.MEASURE if running.step is None else _AT_WORK.get(running.step, steps[0]))
    found = []
    for place, step in enumerate(steps):
        if place < now and step in before:
            found.append(before[step])
        else:
            state = MeasuringState.MEASURING if place == now else MeasuringState.WAITING
            found.append(StepState(step=step, state=state))
    return tuple(found)
