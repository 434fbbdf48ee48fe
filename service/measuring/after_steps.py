"""Takes the steps with a log after its end: programs of their own measure and copy it; keeps what came of it."""

import shutil
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, Final

from recorder.catalogue.trash import beside
from recorder.log.beside import measured_path
from rig.api.jump import LastJump
from rig.api.measuring import AfterStep, MeasuringStep
from rig.background.child import run_child
from rig.background.messages import End, Failed, Order, Progress
from rig.errors import StorageError
from rig.events import Event
from rig.events import Level as EventLevel
from rig.host.files import make_folder
from rig.phrase import Phrase, phrase, plain
from rig.settings.model import AnalysisSettings, OffloadSettings
from service.measuring.keeping import keep_file, keep_problem, keep_renamed, keep_result, keep_step
from service.measuring.program import Figures, Measure, Measured, NotMeasured, Rename, Whole
from service.measuring.results import VIDEO, names_of
from service.measuring.retries import source_mark
from service.offloading.notes import CopyNotes, as_warning, mark_of
from service.offloading.orders import PROGRAM, copying

#: Where results are made, before they are whole.
_WORKSHOP: Final = ".measuring"


class AfterSteps:
    """Every step ends early if nobody wants it any more.

    Args:
        folder: of the recordings.
        busy: whether a recording runs, so that the work has to stand still.
        earlier: gives the `kinogram.json` of the other measured logs of whoever jumps in a recording.
        wanted: whether the steps of a recording are still wanted.
        hear: takes how far the work is.
        hold: called with True when it stands still, with False when it goes on.
        tell: takes an event for the live log.
        found: takes the main figures of the jumps of a log, when it is measured, before the files are there.
        copies: what came of the copies on the other disk.
    """

    def __init__(
        self,
        folder: Path,
        busy: Callable[[], bool],
        earlier: Callable[[str], Sequence[Path]],
        wanted: Callable[[str], bool],
        hear: Callable[[Progress], None],
        hold: Callable[[bool], None],
        tell: Callable[[Event], None],
        found: Callable[[tuple[LastJump, ...]], None],
        copies: CopyNotes,
    ) -> None:
        self._folder, self._busy, self._earlier, self._wanted = folder, busy, earlier, wanted
        self._hear, self._hold, self._tell, self._found = hear, hold, tell, found
        self._copies = copies

    def tidy(self) -> None:
        """Remove what an earlier service left half made."""
        shutil.rmtree(self._folder / _WORKSHOP, ignore_errors=True)

    def measure(self, recording: str, log: Path, analysis: AnalysisSettings) -> None:
        """Measure a log, with a video if the rig file asks for one; a failure is noted, and an event tells of it.

        Args:
            recording: its id.
            log: it.
            analysis: how.
        """
        source, names = source_mark(analysis), names_of(log)
        made, video = (self._folder / _WORKSHOP / f"{recording}{ending}" for ending in ("", ".mp4"))
        wants_video = AfterStep.VIDEO in analysis.after_recording
        try:
            make_folder(made.parent)
            shutil.rmtree(made, ignore_errors=True)
            order = Measure(
                log=log, out=made, survey=analysis.survey, calibration=analysis.calibration,
                video=video if wants_video else None, earlier=tuple(self._earlier(recording)),
            )  # fmt: skip

            found: tuple[LastJump, ...] = ()

            def hear(news: Progress | Figures | Whole) -> None:
                nonlocal found
                match news:
                    case Figures():  # people wait for the figures, not for pages and pictures
                        found = tuple(each.model_copy(update={"recording": recording}) for each in news.jumps)
                        self._found(found)
                    case Whole():  # nor for the video
                        if log.exists():
                            keep_result(made, log, found, names)
                    case Progress():
                        self._hear(news)

            says = Progress | Figures | Whole | Measured | NotMeasured
            end = self._child(recording, "service.measuring.program", order, says, hear)
            if end is None or not log.exists():
                return
            if isinstance(end, Failed):
                by_source = isinstance(end, NotMeasured) and end.by_source
                self._fail(recording, log, end.said, source if by_source else None)
            elif wants_video and isinstance(end, Measured):
                if end.no_video is None:
                    keep_file(video, log, VIDEO)
                self._note(recording, log, AfterStep.VIDEO, end.no_video)
        except StorageError as error:
            self._fail(recording, log, error.said)
        except (OSError, ValueError) as error:
            self._fail(recording, log, plain(f"{log.name}: {error}"))
        finally:
            shutil.rmtree(made, ignore_errors=True)

    def rename(self, recording: str, log: Path) -> bool:
        """Write those files of a result anew that name the jumper; an event tells of a failure.

        Returns:
            Whether that is done.
        """
        self._hear(Progress(step=MeasuringStep.RENAMING, share=0.0))
        names, made = names_of(log), self._folder / _WORKSHOP / f"{recording}.renamed"
        try:
            make_folder(made.parent)
            shutil.rmtree(made, ignore_errors=True)
            earlier = tuple(self._earlier(recording))
            order = Rename(log=log, result=measured_path(log), out=made, earlier=earlier)
            end = self._child(recording, "service.measuring.program", order, End, self._hear)
            if end is None or not log.exists():
                return False
            if isinstance(end, Failed):
                self._warn(_not_renamed(recording, end.said))
                return False
            keep_renamed(made, log, names)
        except (StorageError, OSError, ValueError) as error:
            self._warn(_not_renamed(recording, plain(str(error))))
            return False
        finally:
            shutil.rmtree(made, ignore_errors=True)
        return True

    def copy(self, recording: str, log: Path, offload: OffloadSettings) -> None:
        """Copy a log, measured or not, with its files; a failure is noted, and an event tells of it."""
        self._hear(Progress(step=MeasuringStep.COPYING, share=0.0))
        mark, why = mark_of(log), None
        order = copying((log, *beside(log)), offload)
        try:
            end = self._child(recording, PROGRAM, order, Progress | End, self._hear)
            if end is None or not log.exists():
                return
            if isinstance(end, Failed):
                why = end.said
        except (OSError, ValueError) as error:
            why = plain(str(error))
        before = self._copies.of(recording)
        self._copies.note(log, mark, None if why is None else as_warning(why))
        if why is not None and (before is None or before.problem is None or before.problem.text != why.text):
            self._warn(_not_copied(recording, why))

    def _child(self, recording: str, module: str, order: Order, says: Any, tell: Callable[[Any], None]) -> End | None:
        wanted = partial(self._wanted, recording)
        return run_child(module, order, says, busy=self._busy, wanted=wanted, tell=tell, hold=self._hold)

    def _note(self, recording: str, log: Path, step: AfterStep, why: Phrase | None) -> None:
        """Note what came of a further step, and tell if it failed."""
        keep_step(log, step, None if why is None else as_warning(why))
        if why is not None:
            self._warn(phrase("event_no_video", "{recording} has no video: {why}", recording=recording, why=why))

    def _fail(self, recording: str, log: Path, why: Phrase, source: str | None = None) -> None:
        """Note that a log cannot be measured, and by which content of survey or poses, if they are the reason."""
        with suppress(FileNotFoundError):  # deleted meanwhile
            try:
                keep_problem(log, as_warning(why), source)
            except FileNotFoundError:
                raise
            except OSError as error:
                why = plain(f"{log}: {error.strerror}")
        text = "{recording} is not measured: {why}"
        self._warn(phrase("event_log_not_measured", text, recording=recording, why=why))

    def _warn(self, said: Phrase) -> None:
        self._tell(Event.now(EventLevel.WARNING, "analysis", said))


def _not_renamed(recording: str, why: Phrase) -> Phrase:
    text = "the corrected name does not stand on the pages of {recording}, measure it again: {why}"
    return phrase("event_not_renamed", text, recording=recording, why=why)


def _not_copied(recording: str, why: Phrase) -> Phrase:
    return phrase("event_log_not_copied", "{recording} is not copied: {why}", recording=recording, why=why)
