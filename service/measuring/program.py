"""The program that measures one log, or writes a corrected name into its result; started by `after_steps`."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from analysis.procedure.steps import STEPS
from rig.api.jump import LastJump
from rig.api.measuring import MeasuringStep
from rig.background.messages import End, Failed, Order, Progress
from rig.background.program import Teller, serve
from rig.errors import BadInputError, LogDamagedError, SvevError
from rig.phrase import Phrase
from rig.transport.message import Message

if TYPE_CHECKING:
    from analysis.report.kinogram.earlier import EarlierJump


class Measure(Order):
    """Measure a log by survey or calibration into the folder `out`, then draw the video, unless it is None.

    Attributes:
        earlier: the `kinogram.json` of other measured logs of the athlete; `service.recordings.measured_jumps` says
            which.
    """

    log: Path
    out: Path
    survey: Path | None
    calibration: Path | None
    video: Path | None
    earlier: tuple[Path, ...]


class Figures(Message):
    """The main figures of the jumps; nothing is written yet."""

    jumps: tuple[LastJump, ...]


class Whole(Message):
    """The folder is whole."""


class Measured(End):
    """The log is measured; why there is no video, if one was to be drawn and could not be."""

    no_video: Phrase | None = None


class NotMeasured(Failed):
    """The log cannot be measured; `by_source`: survey or poses cannot be read, or do not fit its balls."""

    by_source: bool


class Rename(Order):
    """Write those files of the result of a log into the folder `out` that say whose jump it is; `earlier` as above."""

    log: Path
    result: Path
    out: Path
    earlier: tuple[Path, ...]


def _measure(asked: Measure, tell: Teller) -> End:
    from analysis.cameras.source import read_source  # noqa: PLC0415 - its libraries start their threads with our low priority
    from analysis.procedure.analyze import analyze  # noqa: PLC0415
    from analysis.procedure.result_folder import write_folder  # noqa: PLC0415
    from analysis.worker.findings import summary  # noqa: PLC0415

    orienting = False

    def progress(step: str, share: float) -> None:
        nonlocal orienting
        orienting = STEPS[step] is MeasuringStep.BALLS and share < 1.0
        tell(Progress(step=STEPS[step], share=share), last=share in {0.0, 1.0})

    try:
        source = read_source(asked.survey, asked.calibration)
    except BadInputError as error:
        return NotMeasured(said=error.said, by_source=True)
    try:
        found = analyze(asked.log, source, progress=progress)
    except LogDamagedError:
        raise
    except SvevError as error:
        return NotMeasured(said=error.said, by_source=orienting)
    result = found.result
    jumps = tuple(
        summary(result.recording, result.rate_hz, jump, found.perpendicular.get(jump.number)) for jump in result.jumps
    )
    tell(Figures(jumps=jumps), last=True)
    write_folder(found, asked.log, asked.out, earlier=_earlier(asked.earlier), progress=progress)
    tell(Whole(), last=True)
    if asked.video is None:
        return Measured()
    from analysis.report.video import write_video  # noqa: PLC0415 - its libraries, when the figures are told

    def drawn(done: int, of: int) -> None:
        tell(Progress(step=MeasuringStep.VIDEO, share=done / max(1, of)))

    try:
        write_video(result, found.measurements, found.system, asked.log, asked.video, progress=drawn)
    except SvevError as error:
        return Measured(no_video=error.said)
    return Measured()


def _rename(asked: Rename, _: Teller) -> End:
    from analysis.procedure.renaming import write_renamed  # noqa: PLC0415 - as above
    from recorder.log.session_changes import session_changes  # noqa: PLC0415

    changes = session_changes(asked.log)
    write_renamed(asked.result, asked.log, asked.out, changes, earlier=_earlier(asked.earlier))
    return End()


def _earlier(files: Iterable[Path]) -> "list[EarlierJump]":
    """The jumps of `kinogram.json` files; what is broken beside another log does not hinder the measuring of this."""
    from analysis.report.kinogram.earlier import read_earlier  # noqa: PLC0415

    found: list[EarlierJump] = []
    for file in files:
        try:
            found += read_earlier(file)
        except BadInputError:
            continue
    return found


def main() -> None:
    """Measure one log, or rename its jumper."""
    serve({Measure: _measure, Rename: _rename})


if __name__ == "__main__":
    main()
