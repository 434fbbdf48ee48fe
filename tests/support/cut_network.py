"""A way to a server on loopback that can be cut: its connections are reset, and those that come, until it is healed."""

import asyncio
import socket
import struct
import threading
from asyncio import StreamReader, StreamWriter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Final

#: Linger for no time: what waits is thrown away, and the other side sees a reset.
_RESET: Final = struct.pack("ii", 1, 0)
_PIECE: Final = 1 << 18


class Way:
    """The way, and the thread that carries what goes over it: a connection that stands still holds up no other one.

    Attributes:
        port: where it begins, on the server's host.
    """

    def __init__(self, host: str, port: int) -> None:
        self._to = host, port
        self._listener = socket.create_server((host, 0))
        self.port: int = self._listener.getsockname()[1]
        self._is_cut, self._closed = False, asyncio.Event()
        self._writers: set[StreamWriter] = set()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, name="way", daemon=True)
        self._thread.start()

    def cut(self) -> None:
        """Reset all connections, and those to come."""
        self._is_cut = True
        self._loop.call_soon_threadsafe(self._reset)

    def heal(self) -> None:
        """Let connections come again."""
        self._is_cut = False

    def close(self) -> None:
        """End it, and the thread."""
        self._loop.call_soon_threadsafe(self._closed.set)
        self._thread.join()

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(self._serve())

    async def _serve(self) -> None:
        server = await asyncio.start_server(self._begin, sock=self._listener)
        await self._closed.wait()
        server.close()
        self._is_cut = True
        self._reset()

    async def _begin(self, reader: StreamReader, writer: StreamWriter) -> None:
        there, to = await asyncio.open_connection(*self._to)
        both = {writer, to}
        self._writers |= both
        if self._is_cut:
            self._reset()
        with suppress(ConnectionError):
            await asyncio.gather(_pass_on(reader, to), _pass_on(there, writer))
        self._writers -= both
        for each in both:
            each.close()

    def _reset(self) -> None:
        for writer in self._writers:
            if not writer.is_closing():
                writer.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET)
                writer.transport.abort()


async def _pass_on(reader: StreamReader, writer: StreamWriter) -> None:
    """Carry one direction until its end, which the other side is told once it has all that came before."""
    while piece := await reader.read(_PIECE):
        writer.write(piece)
        await writer.drain()
    writer.write_eof()


@contextmanager
def cut_network(host: str, port: int) -> Iterator[Way]:
    """A way to a server."""
    way = Way(host, port)
    try:
        yield way
    finally:
        way.close()
