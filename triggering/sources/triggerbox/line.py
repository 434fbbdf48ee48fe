"""The serial line to a trigger box: no wait without an end, and every fault says what to do."""

import errno
from types import TracebackType
from typing import Final, Self

import serial

from rig.errors import TriggerError
from rig.phrase import Phrase, phrase
from triggering.sources.triggerbox.protocol import BAUD

_WRITE_S: Final = 1.0
_MOST_BYTES: Final = 4096


class SerialLine:
    """An open serial port. Opening it raises the line DTR, by which an Arduino begins anew.

    Args:
        port: its device file.

    Raises:
        TriggerError: it cannot be opened.
    """

    def __init__(self, port: str) -> None:
        self._port = port
        try:
            self._serial = serial.Serial(port, BAUD, timeout=0, write_timeout=_WRITE_S, exclusive=True)
        except serial.SerialException as error:
            raise TriggerError(why_not_open(port, error.errno, str(error))) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._serial.close()

    def set_speed(self, baud: int) -> None:
        """Change the speed, and forget what has come at the old one.

        Raises:
            TriggerError: the line is gone.
        """
        try:
            self._serial.baudrate = baud
            self._serial.reset_input_buffer()
        except (serial.SerialException, OSError) as error:
            raise self._gone() from error

    def write(self, data: bytes) -> None:
        """Send.

        Raises:
            TriggerError: the line is gone, or takes nothing.
        """
        try:
            self._serial.write(data)
        except (serial.SerialException, OSError) as error:
            raise self._gone() from error

    def read(self, timeout_s: float) -> bytes:
        """What has come, waiting at most so long for the first byte; empty: nothing.

        Raises:
            TriggerError: the line is gone.
        """
        try:
            self._serial.timeout = timeout_s
            first: bytes = self._serial.read(1)
            if not first:
                return b""
            self._serial.timeout = 0
            return first + self._serial.read(_MOST_BYTES)
        except (serial.SerialException, OSError) as error:
            raise self._gone() from error

    def _gone(self) -> TriggerError:
        text = "the trigger box at {port} is gone: check its USB cable; it is started again when it is back"
        return TriggerError(phrase("trigger_gone", text, port=self._port))


def why_not_open(port: str, number: int | None, reason: str) -> Phrase:
    """Why a serial port cannot be opened, with what to do.

    Args:
        port: its device file.
        number: of the error.
        reason: the error in words, for those that are not expected.
    """
    if number in {errno.ENOENT, errno.ENXIO, errno.ENODEV}:
        text = "there is no trigger box at {port}: plug it in, or correct trigger.port in the rig file"
        return phrase("trigger_no_port", text, port=port)
    if number in {errno.EACCES, errno.EPERM}:
        text = "the trigger box at {port} may not be opened: add the user to the group dialout, and log in again"
        return phrase("trigger_not_allowed", text, port=port)
    if number in {errno.EBUSY, errno.EAGAIN}:
        text = "another program uses the trigger box at {port}: end it (fuser {port} names it)"
        return phrase("trigger_busy", text, port=port)
    text = "the trigger box at {port} cannot be opened ({why}): correct trigger.port in the rig file"
    return phrase("trigger_not_opened", text, port=port, why=reason)
