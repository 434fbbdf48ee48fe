"""Drives one trigger box: waits until it answers, sets its rate, starts and stops its pulses, reads its count."""

import time
from collections.abc import Callable
from typing import Final

from rig.clocks import host_now
from rig.errors import TriggerError
from rig.phrase import phrase
from triggering.sources.triggerbox import protocol
from triggering.sources.triggerbox.clock import Reading
from triggering.sources.triggerbox.line import SerialLine
from triggering.sources.triggerbox.protocol import Answer, AnswerReader, Rate

#: An Arduino runs its boot loader for up to 2 s after its reset, and the box then waits up to 5 s for the question for
#: its name, which shortens the wait; so long it may take in all.
BOOT_S: Final = 12.0
_ASK_AGAIN_S: Final = 0.3
#: A box that did not begin anew when the port was opened answers in this time.
_RUNNING_S: Final = 0.5
#: So long is waited for the name.
_NAME_S: Final = 4.0
#: A question without an answer in this time is given up. A USB converter may keep bytes for 16 ms.
_ANSWER_S: Final = 0.2


class TriggerBox:
    """A box that answers.

    Args:
        line: to it.
        port: device file of the line, for messages.
        stopping: whether the caller wants no more.
    """

    def __init__(self, line: SerialLine, port: str, stopping: Callable[[], bool] = lambda: False) -> None:
        self._line, self._port, self._stopping = line, port, stopping
        self._reader = AnswerReader()
        self._query = 0
        self._rate: Rate | None = None
        self.name: str | None = None

    @property
    def garbage(self) -> int:
        """Bytes on the line so far that belong to no answer."""
        return self._reader.garbage

    def wake(self, boot_s: float = BOOT_S) -> None:
        """Wait until the box answers, and check its protocol.

        Raises:
            TriggerError: it does not answer in time, or speaks another protocol.
        """
        end = time.monotonic() + boot_s
        version = self._version(min(end, time.monotonic() + _RUNNING_S))
        if version is None:
            self.name = self._ask_name(min(end, time.monotonic() + _NAME_S))
            version = self._version(end)
        if version is None:
            text = "the trigger box at {port} does not answer: check that it is one, and trigger.port in the rig file"
            raise TriggerError(phrase("trigger_silent", text, port=self._port))
        if version != protocol.VERSION:
            text = "the trigger box at {port} speaks protocol {found}, not {wanted}: load the firmware of that protocol"
            wanted = protocol.VERSION
            raise TriggerError(phrase("trigger_protocol", text, port=self._port, found=version, wanted=wanted))

    def start(self, rate: Rate) -> None:
        """Stop the pulses, count from 0, and start them at a rate.

        Raises:
            TriggerError: the line is gone.
        """
        self._rate = rate
        self._line.write(protocol.STOP_AND_RESET + rate.command + protocol.START)

    def stop(self) -> None:
        """Stop the pulses.

        Raises:
            TriggerError: the line is gone.
        """
        self._line.write(protocol.STOP)

    def read(self) -> tuple[Reading, int] | None:
        """Ask how far the box has counted.

        Returns:
            The reading, and the number of the last pulse that fired; None: no answer came in time, or its count is not
            certain.

        Raises:
            TriggerError: the line is gone.
        """
        if self._rate is None:
            return None
        self._query = (self._query + 1) % 256
        asked = host_now()
        self._line.write(protocol.ask_time(self._query))
        answer = self._await("P", time.monotonic() + _ANSWER_S, self._query)
        answered = host_now()
        if answer is None or not answer.sure or answer.ticks >= self._rate.ticks:
            return None
        return Reading(asked, answered, answer.fired + answer.ticks / self._rate.ticks), answer.fired

    def _version(self, end: float) -> int | None:
        """The protocol of the box; None: it does not answer.

        The box reads bytes in pairs: what it heard at another speed may have left it with half of one, so every other
        question has a byte before it.
        """
        odd = False
        while time.monotonic() < end and not self._stopping():
            self._line.write((b"?" if odd else b"") + protocol.ASK_VERSION)
            odd = not odd
            answer = self._await("V", min(end, time.monotonic() + _ASK_AGAIN_S))
            if answer is not None:
                return answer.value
        return None

    def _ask_name(self, end: float) -> str | None:
        """Ask a box that has just begun for its name, which ends its wait; None: it does not answer."""
        self._line.set_speed(protocol.NAME_BAUD)
        came, name = b"", None
        while name is None and time.monotonic() < end and not self._stopping():
            self._line.write(protocol.ASK_NAME)
            again = min(end, time.monotonic() + _ASK_AGAIN_S)
            while name is None and (left := again - time.monotonic()) > 0:
                came = (came + self._line.read(left))[-64:]
                name = protocol.name_in(came)
        self._line.set_speed(protocol.BAUD)
        return name

    def _await(self, header: str, end: float, value: int | None = None) -> Answer | None:
        """The answer to the last question of a kind; others are of questions that were given up."""
        while (left := end - time.monotonic()) > 0:
            for answer in self._reader.feed(self._line.read(left)):
                if answer.header == header and value in {None, answer.value}:
                    return answer
        return None
