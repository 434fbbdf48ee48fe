"""The box: its firmware in a thread, behind a pseudo-terminal that programs open like a serial port."""

import os
import pty
import random
import select
import struct
import termios
import threading
import time
import tty
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Final, Self

from rig.clocks import host_now
from simrig.triggerbox.timer import Timer

_POLL_MS: Final = 50
_CLOSED_S: Final = 0.01
_PRESCALERS: Final = {b"1": 8, b"2": 64}
#: Bytes that follow the first two of a command.
_MORE: Final = {b"T=": 3, b"O=": 5}


@dataclass(frozen=True, slots=True)
class BoxSettings:
    """What the box is like.

    Attributes:
        version: protocol that it says it speaks.
        name: 8 characters at most.
        loader_s: the boot loader runs for so long after a reset, and answers nothing.
        name_s: then the firmware waits so long for the question for its name.
        opens_anew: opening the port resets it, by the line DTR.
        jitter_s: an answer comes so much later at most, half of it before the timer is read.
        garbage: share of answers that have a few odd bytes before them.
        mute: share of questions that get no answer.
        seed: of all that is random.
    """

    version: int = 14
    name: str = "svev"
    loader_s: float = 0.1
    name_s: float = 1.0
    opens_anew: bool = True
    jitter_s: float = 0.0
    garbage: float = 0.0
    mute: float = 0.0
    seed: int = 1


class EmulatedBox:
    """A context manager that plugs the box in and pulls it out.

    Args:
        port: path of the symbolic link to the pseudo-terminal, as udev makes one for a real port.
        timer: makes the pulses.
        settings: of the box.

    Attributes:
        silent: the box answers nothing.
    """

    def __init__(self, port: Path, timer: Timer, settings: BoxSettings | None = None) -> None:
        self._port, self.timer = port, timer
        self._settings = settings or BoxSettings()
        self._random = random.Random(self._settings.seed)  # noqa: S311  (no secret)
        self._thread: threading.Thread | None = None
        self._pulled = threading.Event()
        self._anew = threading.Event()
        self.silent = False

    def __enter__(self) -> Self:
        self.plug_in()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.pull_out()

    def plug_in(self) -> None:
        """Connect it; its port appears."""
        ours, theirs = pty.openpty()
        tty.setraw(theirs)
        self._port.symlink_to(os.ttyname(theirs))
        os.close(theirs)  # from now on the pseudo-terminal hangs up whenever no program has it open
        self._pulled.clear()
        self._thread = threading.Thread(target=self._run, args=(ours,), name="trigger box")
        self._thread.start()

    def pull_out(self) -> None:
        """Disconnect it; its port is gone."""
        if self._thread is not None:
            self._pulled.set()
            self._thread.join()
            self._thread = None
            self._port.unlink()

    def reset(self) -> None:
        """Let the box begin anew, as by its button or a moment without power."""
        self._anew.set()

    def _run(self, line: int) -> None:
        try:
            poll = select.poll()
            poll.register(line, select.POLLIN)
            closed = True
            while not self._pulled.is_set():
                events = poll.poll(_POLL_MS)
                if events and events[0][1] & (select.POLLHUP | select.POLLIN) == select.POLLHUP:
                    closed = True
                    self._pulled.wait(_CLOSED_S)
                    continue
                if (closed and self._settings.opens_anew) or self._anew.is_set():
                    self._anew.clear()
                    self._boot(line)
                closed = False
                if events and len(command := self._speaks(line, 2, termios.B115200)) == 2:
                    self._obey(line, command)
        finally:
            os.close(line)

    def _boot(self, line: int) -> None:
        """Begin anew: the boot loader, then the wait for the question for the name."""
        self.timer.begin_anew(host_now())
        self._pulled.wait(self._settings.loader_s)
        end, heard = time.monotonic() + self._settings.name_s, b""
        while time.monotonic() < end and not self._pulled.is_set():
            heard = (heard + self._speaks(line, 1, termios.B9600))[-2:]
            if heard == b"N?":
                name = self._settings.name.encode().ljust(8, b"\0")
                self._send(line, name + b"%X" % _crc8(name))
                return

    def _speaks(self, line: int, size: int, speed: int) -> bytes:
        """What the box hears: so many bytes, or fewer where no more come; anything at another speed than its own."""
        heard = b""
        poll = select.poll()
        poll.register(line, select.POLLIN)
        while len(heard) < size and poll.poll(_POLL_MS):
            try:
                data = os.read(line, size - len(heard))
            except OSError:  # hung up meanwhile
                return b""
            heard += data if termios.tcgetattr(line)[5] == speed else self._random.randbytes(1)
        return heard

    def _obey(self, line: int, command: bytes) -> None:
        more = self._speaks(line, _MORE.get(command, 0), termios.B115200)
        now = host_now()
        match command[:1], command[1:]:
            case b"S", b"0":
                self.timer.reset(now)
            case b"S", b"1":
                self.timer.start(now)
            case b"S", b"2":
                self.timer.stop(now)
            case b"T", b"=":
                self.timer.set_rate(int.from_bytes(more[:2], "little"), _PRESCALERS[more[2:]], now)
            case b"V", b"?":
                self._answer(line, b"V", self._settings.version)
            case b"P", value:
                self._answer(line, b"P", value[0])

    def _answer(self, line: int, header: bytes, value: int) -> None:
        if self.silent or self._random.random() < self._settings.mute:
            return
        self._pulled.wait(self._random.random() * self._settings.jitter_s / 2)
        count, ticks = self.timer.read(host_now())
        self._pulled.wait(self._random.random() * self._settings.jitter_s / 2)
        body = struct.pack("<BIH", value, count, ticks)
        answer = header + bytes([len(body)]) + body + bytes([sum(body) & 0xFF])
        if self._random.random() < self._settings.garbage:
            answer = self._random.randbytes(self._random.randrange(1, 12)) + answer
        self._send(line, answer)

    @staticmethod
    def _send(line: int, data: bytes) -> None:
        try:
            os.write(line, data)
        except OSError:  # hung up meanwhile: nobody listens
            return


def _crc8(data: bytes) -> int:
    """CRC-8/MAXIM, as the firmware computes it bit by bit."""
    crc = 0
    for byte in data:
        for bit in range(8):
            odd = (crc ^ byte >> bit) & 1
            crc = crc >> 1 ^ (0x8C if odd else 0)
    return crc
