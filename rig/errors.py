"""Errors that a person can act on, as a tree split by what the caller does next.

Every message is one line that names the fault and ends in what to do about it. The command line prints the message
without a traceback and exits with `exit_code`. Errors that the panel shows are raised with a `Phrase` instead of a
text, so that it can translate them.
"""

from rig.phrase import Phrase, escaped, plain


class SvevError(Exception):
    """Base of all errors that a person can act on."""

    exit_code = 1

    def __init__(self, *said: object) -> None:
        super().__init__(*(escaped(each) if isinstance(each, str) else each for each in said))

    @property
    def said(self) -> Phrase:
        """The message with its code and values, where it has them."""
        first = self.args[0] if self.args else ""
        return first if isinstance(first, Phrase) else plain(str(self))


class BadInputError(SvevError):
    """A file, key, option or address given by the caller is wrong: correct it and call again."""

    exit_code = 2


class NameTakenError(BadInputError):
    """A file cannot be made because there is something of its name: choose another one."""


class NoFitError(BadInputError):
    """Nothing of the kind is to be seen at the place of an image that was pointed at: point elsewhere."""


class CameraNotFoundError(BadInputError):
    """A camera that the rig file names does not answer."""


class CameraError(SvevError):
    """A camera that answered refuses or fails. The grabber tears it down and connects again."""

    exit_code = 5


class TriggerError(SvevError):
    """The device that makes the trigger pulses is missing or fails. It is tried again."""

    exit_code = 5


class PulsesPausedError(SvevError):
    """A recording is whole, but for a while no pulses came in it."""

    exit_code = 5


class PairingAlarmError(SvevError):
    """A recording is whole, but something was wrong with clocks, trigger or rate while it was made."""

    exit_code = 5


class StorageError(SvevError):
    """The log cannot be written any further (disk full, device gone). What is written stays readable."""

    exit_code = 4


class FileVanishedError(StorageError):
    """The log that is being written was deleted or moved away."""


class ProcessDiedError(SvevError):
    """One of our own processes ended without being asked to."""

    exit_code = 6


class LogDamagedError(SvevError):
    """A log was not closed, is damaged or not its whole recording; what could be read has been reported."""

    exit_code = 3


class LedgerDiffersError(SvevError):
    """The tags of a log say other things of its pulses than frame numbers, clocks and counts in the same log."""

    exit_code = 7


class NoJumpError(SvevError):
    """Nobody jumps in a log."""

    exit_code = 3


class LogTruncatedError(BadInputError):
    """A log ends in the middle of a record: an incomplete copy, since a recorder never leaves a log like that."""


class UnknownRecordingError(SvevError):
    """The recording does not exist, or has no such pulse."""


class UnknownLineError(SvevError):
    """The start list has no such line."""


class UnknownExportError(SvevError):
    """The service has no such export, or has removed it."""


class UnknownAlarmError(SvevError):
    """There is no alarm of this number any more."""


class UnknownCameraError(SvevError):
    """The rig has no such camera."""


class StateForbidsError(SvevError):
    """The service refuses the call in its present state; the message says what to do instead."""


class RehearsingError(StateForbidsError):
    """A rehearsal has the cameras; arming ends it."""


class NoAnalysisError(StateForbidsError):
    """Nothing can be measured: the rig file does not say where the balls are."""


class StillRecordingError(StateForbidsError):
    """The caller asked for the log of a recording in progress."""


class ChangedMeanwhileError(StateForbidsError):
    """The caller saw another state, or another next jumper, than there is by now. Nothing was done."""


class TooSoonError(StateForbidsError):
    """The state has only just changed, so that the call may be the second half of a double tap. Nothing was done."""


class ConfirmFirstError(StateForbidsError):
    """The recording has only just begun, so that stopping it has to be confirmed. It goes on."""
