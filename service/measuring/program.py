"""The program that measures one log, started by `service.measuring.after_steps`."""

from pathlib import Path
from typing import Any

from analysis.procedure.steps import STEPS
from rig.api.measuring import MeasuringStep
from rig.background.program import Teller, serve
from rig.errors import BadInputError, LogDamagedError, SvevError
from rig.phrase import as_plain


def _measure(asked: dict[str, Any], tell: Teller) -> dict[str, Any]:
    """Measure `log` by `survey` or `calibration` into the folder `out`, then draw the `video`, unless it is null.

    Tells the main figures of the jumps before it writes anything, and when the folder is whole; says at the end why
    there is no video, or why the log cannot be measured, and whether survey or poses are the reason: they cannot be
    read, or do not fit its balls.
    """
    from analysis.cameras.source import read_source  # noqa: PLC0415 - its libraries start their threads with our low priority
    from analysis.procedure.analyze import analyze  # noqa: PLC0415
    from analysis.procedure.result_folder import write_folder  # noqa: PLC0415
    from analysis.worker.findings import summary  # noqa: PLC0415
    from service.measuring.earlier import earlier_jumps  # noqa: PLC0415

    orienting = False

    def progress(step: str, share: float) -> None:
        nonlocal orienting
        orienting = STEPS[step] is MeasuringStep.BALLS and share < 1.0
        tell(last=share in {0.0, 1.0}, step=STEPS[step], share=share)

    log, out = Path(asked["log"]), Path(asked["out"])
    survey, calibration = (Path(asked[key]) if asked[key] else None for key in ("survey", "calibration"))
    try:
        source = read_source(survey, calibration)
    except BadInputError as error:
        return _failed(error, by_source=True)
    try:
        found = analyze(log, source, progress=progress)
    except LogDamagedError:
        raise
    except SvevError as error:
        return _failed(error, by_source=orienting)
    result = found.result
    jumps = [
        summary(result.recording, result.rate_hz, jump, found.perpendicular.get(jump.number)) for jump in result.jumps
    ]
    tell(last=True, jumps=[jump.model_dump(mode="json") for jump in jumps])
    write_folder(found, log, out, earlier=earlier_jumps(asked["earlier"]), progress=progress)
    tell(last=True, whole=True)
    if asked["video"] is None:
        return {}
    from analysis.report.video import write_video  # noqa: PLC0415 - its libraries, when the figures are told

    try:
        write_video(
            result, found.measurements, found.system, log, Path(asked["video"]),
            progress=lambda done, of: tell(step=MeasuringStep.VIDEO, share=done / max(1, of)),
        )  # fmt: skip
    except SvevError as error:
        return {"no_video": as_plain(error.said)}
    return {"no_video": None}


def _failed(error: SvevError, *, by_source: bool) -> dict[str, Any]:
    return {"problem": as_plain(error.said), "by_source": by_source}


if __name__ == "__main__":
    serve(_measure)
