"""An emulated GPIO chip: answers programs, notes each edge of an output with its time, drives inputs.

A program that was started with `build.environment()` sees it as a device file of the kernel. Simulated cameras are
triggered by its lines through cables (`simrig.world.cable`). As with many chips of the
kernel, a line that is given back keeps its level: whoever wants it inactive has to make it so.
"""

import errno
import os
import selectors
import socket
import struct
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Final, Self

from rig.clocks import NS_PER_S, NS_PER_US, HostNs, host_now
from simrig.gpio.abi import Ioctl, LineFlag, LineRequest, asked_line, chip_info, edge_event, line_info, set_value
from simrig.world.cable import encode_edge

_HEAD: Final = struct.Struct("=II")
_BYTES: Final = 1 << 12
#: The program that a test waits for may start on a crowded machine.
_WAIT_S: Final = 60.0


@dataclass(frozen=True, slots=True)
class Edge:
    """A change of a line's level.

    Attributes:
        line: number of the line.
        high: its level from then on.
        time: when.
    """

    line: int
    high: bool
    time: HostNs


@dataclass(slots=True)
class _Line:
    """A line and the program that has it.

    Attributes:
        name: of the line.
        holder: name of a program or driver that has taken it for ever.
        high: its level.
        request: how it was requested; None: it is free.
        events: connection to the program that has it.
        reported: level that was last reported by an edge event.
        due: when a change of level has lasted for the debounce period; None: there is none.
        number: of the edge event that was sent last.
        cables: to simulated cameras.
    """

    name: str
    holder: str
    high: bool = False
    request: LineRequest | None = None
    events: socket.socket | None = None
    reported: bool = False
    due: HostNs | None = None
    number: int = 0
    cables: list[socket.socket] = field(default_factory=list)

    @property
    def consumer(self) -> str:
        return self.holder if self.request is None else self.request.consumer


@dataclass
class GpioChip:
    """A chip; a context manager, during which programs can open it.

    Attributes:
        path: where; its name is `gpiochip` and a number.
        lines: names of the lines, some may be empty.
        label: of the chip.
        taken: by number, lines that belong to somebody else, and the name of that.
        refusal: error number with which it refuses to be opened; 0: it does not.
        edges: of the outputs, in order.
        requests: of lines, in order.
    """

    path: Path
    lines: Sequence[str] = ("",) * 8
    label: str = "emulated"
    taken: Mapping[int, str] = field(default_factory=dict)
    refusal: int = 0
    edges: list[Edge] = field(default_factory=list, init=False)
    requests: list[LineRequest] = field(default_factory=list, init=False)

    def __enter__(self) -> Self:
        self._lines = [_Line(name, self.taken.get(offset, "")) for offset, name in enumerate(self.lines)]
        self._levels = os.memfd_create("levels", os.MFD_CLOEXEC)
        os.truncate(self._levels, len(self.lines))
        self._changed = threading.Condition()
        self._selector = selectors.DefaultSelector()
        self._wake, self._waker = socket.socketpair()
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._listener.bind(str(self.path))
        self._listener.listen()
        self._selector.register(self._listener, selectors.EVENT_READ)
        self._selector.register(self._wake, selectors.EVENT_READ)
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name=f"GPIO chip {self.path}")
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stopping = True
        self._waker.send(b"!")
        self._thread.join()
        for key in list(self._selector.get_map().values()):
            if isinstance(key.fileobj, socket.socket):
                key.fileobj.close()
        self._selector.close()
        self._waker.close()
        os.close(self._levels)
        self.path.unlink()

    def drive(self, line: int, *, high: bool) -> None:
        """Change the level of an input, from outside."""
        with self._changed:
            state, now = self._lines[line], host_now()
            self._level(line, high=high)
            wait_us = 0 if state.request is None else state.request.debounce_us
            state.due = None if high == state.reported else HostNs(now + wait_us * NS_PER_US)
        self._waker.send(b"!")

    def high(self, line: int) -> bool:
        """Level of a line."""
        with self._changed:
            return self._lines[line].high

    def wait_for_edges(self, count: int) -> list[Edge]:
        """Wait until there have been so many edges; a test that waits in vain fails.

        Raises:
            TimeoutError: they do not come.
        """
        return self._wait(lambda: len(self.edges) >= count, lambda: self.edges[:])

    def wait_for_use(self, line: int, *, used: bool) -> None:
        """Wait until a program has requested a line, or given it back.

        Raises:
            TimeoutError: it does not.
        """
        self._wait(lambda: (self._lines[line].request is not None) == used, list)

    def wait_until_settled(self, line: int) -> None:
        """Wait until the present level of an input has been reported, or is the one that was reported last.

        Raises:
            TimeoutError: it does not happen.
        """
        self._wait(lambda: self._lines[line].due is None, list)

    def _wait(self, met: Callable[[], bool], result: Callable[[], list[Edge]]) -> list[Edge]:
        with self._changed:
            if not self._changed.wait_for(met, _WAIT_S):
                raise TimeoutError(f"{self.path}: {len(self.edges)} edges after {_WAIT_S} s")
            return result()

    # -- the thread ----------------------------------------------------------------------------------------------

    def _run(self) -> None:
        while not self._stopping:
            ready = self._selector.select(self._patience_s())
            with self._changed:
                for key, _ in ready:
                    if isinstance(key.fileobj, socket.socket):
                        self._serve(key.fileobj, key.data)
                self._report_inputs()
                self._changed.notify_all()

    def _serve(self, sock: socket.socket, line: _Line | None) -> None:
        if sock is self._listener:
            self._selector.register(sock.accept()[0], selectors.EVENT_READ)
            return
        try:
            data = sock.recv(_BYTES)
        except ConnectionResetError:
            data = b""
        if sock is self._wake:
            return
        if not data:
            self._selector.unregister(sock)
            sock.close()
            if line is not None and sock in line.cables:
                line.cables.remove(sock)
            elif line is not None:
                line.request = line.events = line.due = None
        elif line is not None:
            self._set(line, data)
        else:
            self._answer(sock, data)

    def _set(self, line: _Line, data: bytes) -> None:
        told = set_value(data)
        if told is not None and line.request is not None and LineFlag.OUTPUT in line.request.flags:
            self._put(line, line.request, told[0], active=told[1])

    def _put(self, line: _Line, request: LineRequest, time: HostNs, *, active: bool) -> None:
        high = active != (LineFlag.ACTIVE_LOW in request.flags)
        if high != line.high:
            self._level(request.offset, high=high)
            self.edges.append(Edge(request.offset, high, time))
            for cable in line.cables:
                with suppress(
                    BlockingIOError, BrokenPipeError, ConnectionResetError
                ):  # a camera that hangs, or is gone
                    cable.send(encode_edge(time, high=high), socket.MSG_DONTWAIT)

    def _level(self, offset: int, *, high: bool) -> None:
        self._lines[offset].high = high
        os.pwrite(self._levels, bytes([high]), offset)

    def _answer(self, sock: socket.socket, data: bytes) -> None:
        code, _ = _HEAD.unpack_from(data)
        argument, error, given = data[_HEAD.size :], 0, b""
        theirs: socket.socket | None = None
        match code & 0xFF:
            case Ioctl.OPENED:
                error = self.refusal
            case Ioctl.CHIP_INFO:
                given = chip_info(self.path.name, self.label, len(self._lines))
            case Ioctl.LINE_INFO:
                error, given = self._describe(asked_line(argument))
            case Ioctl.REQUEST:
                error, theirs = self._request(LineRequest.parsed(argument))
                given = b"" if error else argument
            case Ioctl.CABLE:
                error = self._connect(sock, argument.decode())
            case _:
                error = errno.ENOTTY
        descriptors = [] if theirs is None else [theirs.fileno(), self._levels]
        try:
            socket.send_fds(sock, [_HEAD.pack(error, len(given)) + given], descriptors)
        except (BrokenPipeError, ConnectionResetError):
            return  # the next `recv` reports the end of the connection
        finally:
            if theirs is not None:
                theirs.close()

    def _connect(self, sock: socket.socket, name: str) -> int:
        """Let a cable begin at a line; an error number, or 0."""
        line = next((line for number, line in enumerate(self._lines) if name in {str(number), line.name or None}), None)
        if line is None:
            return errno.EINVAL
        line.cables.append(sock)
        self._selector.modify(sock, selectors.EVENT_READ, line)
        return 0

    def _describe(self, offset: int | None) -> tuple[int, bytes]:
        if offset is None or offset >= len(self._lines):
            return errno.EINVAL, b""
        line = self._lines[offset]
        flags = LineFlag.INPUT if line.request is None else line.request.flags
        if line.consumer:
            flags |= LineFlag.USED
        return 0, line_info(line.name, line.consumer, offset, flags)

    def _request(self, request: LineRequest | None) -> tuple[int, socket.socket | None]:
        if request is None or request.offset >= len(self._lines):
            return errno.EINVAL, None
        line = self._lines[request.offset]
        if line.consumer:
            return errno.EBUSY, None
        theirs, line.events = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        line.request, line.reported = request, line.high
        self.requests.append(request)
        if LineFlag.OUTPUT in request.flags:
            self._put(line, request, host_now(), active=request.active)
        self._selector.register(line.events, selectors.EVENT_READ, line)
        return 0, theirs

    def _patience_s(self) -> float | None:
        due = [line.due for line in self._lines if line.due is not None]
        return max(0, min(due) - host_now()) / NS_PER_S if due else None

    def _report_inputs(self) -> None:
        """Send the edge events of inputs that have kept their level for as long as their debounce period."""
        now = host_now()
        for offset, line in enumerate(self._lines):
            if line.due is None or line.due > now:
                continue
            line.due, line.reported = None, line.high
            if line.events is None or line.request is None:
                continue
            rising = line.high != (LineFlag.ACTIVE_LOW in line.request.flags)
            if (LineFlag.RISING if rising else LineFlag.FALLING) in line.request.flags:
                line.number += 1
                line.events.send(edge_event(now, rising=rising, offset=offset, number=line.number))
