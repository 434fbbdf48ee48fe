"""The wire format of the strawlab trigger box, protocol 14 (github.com/strawlab/triggerbox): commands, answers, rates.

Timer 1 of the box's AVR runs at 16 MHz / prescaler from 0 to ICR1 and begins again. Its output rises at 0, and falls at
the compare match at 1000 ticks, where the box counts the pulse ("fast PWM", ATmega328P data sheet, section 15.9.3: the
period is ICR1 + 1 ticks).
"""

import struct
from dataclasses import dataclass
from typing import Final

from rig.errors import BadInputError

#: The protocol that is spoken here.
VERSION: Final = 14
BAUD: Final = 115_200
#: While it starts, the box waits some seconds for a question for its name at this speed.
NAME_BAUD: Final = 9600

ASK_VERSION: Final = b"V?"
ASK_NAME: Final = b"N?"
STOP_AND_RESET: Final = b"S0"
START: Final = b"S1"
STOP: Final = b"S2"

#: The output falls, and the pulse is counted, so many ticks after it rose.
WIDTH_TICKS: Final = 1000
#: So many ticks from the compare match on, the interrupt that counts the pulse may not have run yet.
_UNSURE_TICKS: Final = 32
_CLOCK_HZ: Final = 16_000_000
_PRESCALERS: Final = {8: b"1", 64: b"2"}
_ICR1_MOST: Final = 0xFFFF
_ANSWER: Final = struct.Struct("<BIH")
_NAME_BYTES: Final = 8
#: CRC-8/MAXIM: polynomial x^8 + x^5 + x^4 + 1, bits reversed.
_CRC_POLYNOMIAL: Final = 0x8C


@dataclass(frozen=True, slots=True)
class Rate:
    """A rate that the timer can make.

    Attributes:
        icr1: the last tick of a period.
        prescaler: of the timer's clock, 8 or 64.
    """

    icr1: int
    prescaler: int

    @property
    def ticks(self) -> int:
        """Ticks of a period."""
        return self.icr1 + 1

    @property
    def period_ns(self) -> float:
        """Time between two pulses, ns, by a clock without error."""
        return self.ticks * self.prescaler * 1e9 / _CLOCK_HZ

    @property
    def hz(self) -> float:
        """Pulses per second, likewise."""
        return 1e9 / self.period_ns

    @property
    def command(self) -> bytes:
        """What sets it."""
        return b"T=" + struct.pack("<H", self.icr1) + _PRESCALERS[self.prescaler]


def nearest_rate(hz: float) -> Rate:
    """The rate nearest to a wanted one.

    Raises:
        BadInputError: the timer cannot make it.
    """
    possible = [
        Rate(ticks - 1, prescaler)
        for prescaler in _PRESCALERS
        if 2 * WIDTH_TICKS <= (ticks := round(_CLOCK_HZ / prescaler / hz)) <= _ICR1_MOST + 1
    ]
    if not possible:
        least = _CLOCK_HZ / max(_PRESCALERS) / (_ICR1_MOST + 1)
        most = _CLOCK_HZ / min(_PRESCALERS) / (2 * WIDTH_TICKS)
        raise BadInputError(
            f"a trigger box cannot make {hz:g} pulses per second: set trigger.rate_hz to {least:.2f} to {most:g}"
        )
    return min(possible, key=lambda rate: abs(rate.hz - hz))


@dataclass(frozen=True, slots=True)
class Answer:
    """What the box answers.

    Attributes:
        header: kind of the question: "P" time, "V" version.
        value: that of the time query, or the version.
        count: pulses that were counted since the reset; 32 bits last for more than a year.
        ticks: of the timer.
    """

    header: str
    value: int
    count: int
    ticks: int

    @property
    def fired(self) -> int:
        """Number of the pulse whose edge rose last: the box counts a pulse only when it has fallen."""
        return self.count + (self.ticks < WIDTH_TICKS)

    @property
    def sure(self) -> bool:
        """Whether `fired` is certain: the compare match is not so recent that it may not be counted yet."""
        return not WIDTH_TICKS <= self.ticks < WIDTH_TICKS + _UNSURE_TICKS


def ask_time(value: int) -> bytes:
    """A time query; the answer repeats `value`, 0 to 255."""
    return b"P" + bytes([value])


def encode(answer: Answer) -> bytes:
    """An answer as it stands on the line."""
    body = _ANSWER.pack(answer.value, answer.count, answer.ticks)
    return answer.header.encode() + bytes([len(body)]) + body + bytes([sum(body) & 0xFF])


class AnswerReader:
    """Finds the answers in what comes from the line, whatever else is on it.

    Attributes:
        garbage: bytes so far that belong to no answer.
    """

    _LENGTH: Final = 2 + _ANSWER.size + 1

    def __init__(self) -> None:
        self._bytes = bytearray()
        self.garbage = 0

    def feed(self, data: bytes) -> list[Answer]:
        """Enter received bytes; returns the answers that are whole now."""
        self._bytes += data
        found = []
        while len(self._bytes) >= self._LENGTH:
            answer = self._first()
            if answer is None:
                del self._bytes[0]
                self.garbage += 1
            else:
                del self._bytes[: self._LENGTH]
                found.append(answer)
        return found

    def _first(self) -> Answer | None:
        header, length, body, total = (
            self._bytes[0], self._bytes[1], self._bytes[2 : self._LENGTH - 1], self._bytes[self._LENGTH - 1],
        )  # fmt: skip
        if header not in b"PV" or length != _ANSWER.size or sum(body) & 0xFF != total:
            return None
        return Answer(chr(header), *_ANSWER.unpack(body))


def crc8(data: bytes) -> int:
    """CRC-8/MAXIM."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (_CRC_POLYNOMIAL if crc & 1 else 0)
    return crc


def name_in(data: bytes) -> str | None:
    """The name of the box in its answer at 9600 Bd: 8 bytes and their CRC as one or two hexadecimal digits.

    Returns:
        None if there is no whole answer in the data.
    """
    for start in range(len(data) - _NAME_BYTES):
        name, digits = data[start : start + _NAME_BYTES], data[start + _NAME_BYTES : start + _NAME_BYTES + 2]
        for text in (digits, digits[:1]):
            if text.isalnum() and text in (b"%X" % crc8(name), b"%02X" % crc8(name)):
                return name.rstrip(b"\0").decode("ascii", "replace")
    return None
