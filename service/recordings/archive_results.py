"""What was measured in the recordings: how far that is, whose jumps they are, how they compare, where one begins."""

from abc import ABC, abstractmethod
from pathlib import Path

from analysis.images.activity import busiest_pulse
from analysis.result.naming import bears_names
from recorder.catalogue.folder import Catalogue
from rig.api.athletes import Athlete, AthleteJump, JumpQuery, folded
from rig.api.comparison import Comparison, Span
from rig.api.looking import Moment, MomentKind
from rig.api.measuring import Measurement
from rig.api.status import Status
from rig.errors import BadInputError, StateForbidsError, UnknownRecordingError
from rig.phrase import phrase
from service.comparing.asking import Comparisons
from service.measuring.queue import Measurings
from service.measuring.results import is_outdated, jumps_in_full, result_file
from service.recordings import live_results
from service.recordings.measured_jumps import MeasuredJumps, athletes


class ArchiveResults(ABC):
    """The part of the archive that tells of measured jumps.

    Args:
        catalogue: of the folder.
        measurings: of the same recordings.
        jumps: that were measured in them.
    """

    def __init__(self, catalogue: Catalogue, measurings: Measurings, jumps: MeasuredJumps) -> None:
        self._catalogue, self._measurings, self._jumps = catalogue, measurings, jumps
        self._comparisons = Comparisons(catalogue.directory, lambda: self.status().recording is not None)

    @abstractmethod
    def status(self) -> Status:
        """The present status, which has the recording in progress."""

    def measurement(self, recording_id: str, *, jumps: bool) -> Measurement:
        """The jumps of a recording: from the whole log if it was measured, otherwise from live measurement.

        Args:
            recording_id: its id.
            jumps: with the jumps in full, pulse by pulse; they are of the whole log, never live.
        """
        log = self._catalogue.file(recording_id)
        known = self._measurings.measurement(recording_id, log)
        if jumps:
            known = known.model_copy(update={"jumps": jumps_in_full(log)})
        if known.figures or not (live := live_results.summaries(log)):
            return known
        return known.model_copy(update={"figures": tuple(live), "live": True})

    def athletes(self) -> list[Athlete]:
        """Whose jumps were measured, by name."""
        return athletes(self._jumps.find(JumpQuery()))

    def measured_jumps(self, query: JumpQuery) -> list[AthleteJump]:
        """The measured jumps that a query finds, newest first; none that lies in the trash."""
        return self._jumps.find(query)

    def compare_spans(self, athlete: str, first: Span, second: Span) -> Comparison:
        """Whether an athlete's jumps of two spans of time differ by more than chance.

        Raises:
            StateForbidsError: a recording runs.
            BadInputError: the spans overlap, one has no jump that was measured well, or they cannot be compared.
        """
        return self._comparisons.spans(self.measured_jumps(JumpQuery.model_construct(athlete=athlete)), first, second)

    def comparison_page(self, first: tuple[str, int], second: tuple[str, int], language: str) -> str:
        """The page that compares two measured jumps, each given by recording and number.

        Raises:
            UnknownRecordingError: there is no such measured jump.
            StateForbidsError: a recording runs.
            BadInputError: it is one and the same, or they cannot be compared.
        """
        if first == second:
            raise BadInputError(phrase("comparing_one", "this is one jump: choose another one to compare it with"))
        known = self.measured_jumps(JumpQuery())
        by_id = {(each.jump.recording, each.jump.jump): each for each in known}
        if missing := [jump for jump in (first, second) if jump not in by_id]:
            raise UnknownRecordingError(f"recording {missing[0][0][:100]!r} has no measured jump {missing[0][1]}")
        shown = [by_id[first], by_id[second]]
        names = {folded(each.athlete) for each in shown}
        others = [each for each in known if {folded(each.athlete)} == names and each not in shown] if all(names) else []
        return self._comparisons.page(shown, others, language)

    def measure(self, recording_id: str) -> Measurement:
        """Have the log of a recording measured, again if it was measured before.

        Raises:
            StateForbidsError: it lies in the trash, or the rig file does not say where the balls are.
        """
        if self._catalogue.entry(recording_id).deleted:
            raise StateForbidsError(
                phrase(
                    "recording_in_trash",
                    "recording {recording} is in the trash: restore it, then measure it",
                    recording=recording_id,
                )
            )
        return self._measurings.want(recording_id, self._catalogue.file(recording_id))

    def give_up_measuring(self, recording_id: str) -> Measurement:
        """Do not measure a recording that waits for it, or is being measured; an earlier result stays."""
        self._measurings.give_up(recording_id, self._catalogue.file(recording_id))
        return self.measurement(recording_id, jumps=False)

    def measured_file(self, recording_id: str, name: str) -> Path:
        """A file of the result.

        Raises:
            UnknownRecordingError: there is none of this name.
            StateForbidsError: it says a name that was corrected since.
        """
        log = self._catalogue.file(recording_id)
        file = result_file(log, name)
        if file is None:
            raise UnknownRecordingError(f"recording {recording_id} has no result {name[:100]!r}: measure it")
        if bears_names(name) and is_outdated(log):
            raise StateForbidsError(
                phrase(
                    "result_renaming",
                    "{file} of {recording} gets the corrected name: try again in a moment",
                    file=name,
                    recording=recording_id,
                )
            )
        return file

    def moment(self, recording_id: str, *, jump: int = 1, by_motion: bool = False) -> Moment:
        """The pulse at which to open a recording: the take-off if the jump was measured, otherwise where most moves.

        Args:
            recording_id: id of the recording.
            jump: number of its jump.
            by_motion: where most moves, in any case: to be compared with a recording that was not measured. Of several
                measured jumps it is the middle of the pulses that show this one.
        """
        log = self._catalogue.file(recording_id)
        if not by_motion and (exact := live_results.takeoff_pulse(log, jump)) is not None:
            whole = result_file(log, "jumper.json") is not None
            return Moment(pulse=round(exact), kind=MomentKind.TAKEOFF, exact=exact, from_log=whole)
        pulse = live_results.middle_pulse(log, jump)
        pulse = busiest_pulse(log) if pulse is None else pulse
        return Moment(pulse=pulse, kind=MomentKind.NONE if pulse is None else MomentKind.ACTIVITY)
