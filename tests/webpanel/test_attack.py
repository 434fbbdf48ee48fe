"""The whole service records at 30 Hz on the simulated hill while clients misbehave: nothing is lost."""

import socket
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from recorder.checking.verify import Verdict, VerifyReport, verify
from tests.service.serving import Serving, serving
from tests.support.loopback import Loopback
from tests.support.rigs import write_rig
from tests.support.waiting import wait_until

pytestmark = pytest.mark.long

PULSES = 180
#: Simulated cameras may fail where other programs keep the computer busy; three times in a row would be our fault.
ATTEMPTS = 3
IDLE_CONNECTIONS = 200
_HEAD = b"POST /api/recordings HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"


def test_a_recording_loses_nothing_under_attack(tmp_path: Path, loopback: Loopback) -> None:
    with serving(tmp_path, write_rig(tmp_path, loopback, backend="sim"), loopback) as service:
        service.arm()
        first = service.post("/api/recordings", {"duration_s": 0})["id"]
        service.await_state("armed")
        for _ in range(ATTEMPTS):
            report = _record(service, lambda: _attacks(service, first))
            if report.verdict is Verdict.CLEAN:
                break
        else:
            if _record(service, lambda: nullcontext([])).verdict is not Verdict.CLEAN:
                pytest.skip("the computer is so busy that simulated cameras fail without any attack")
    assert report.verdict is Verdict.CLEAN, (report.ledger.summary_line(), report.findings)
    assert report.ledger.pulses >= PULSES


def _record(service: Serving, meanwhile: Callable[[], AbstractContextManager[Sequence["Attack"]]]) -> VerifyReport:
    recording = service.post("/api/recordings", {"bib": "17", "preroll_s": 0})["id"]
    with meanwhile() as attacks:
        service.await_pulses(PULSES)
        wait_until(lambda: all(attack.rounds for attack in attacks), "every attack was carried out", 60)
        assert service.get("/api/status")["state"] == "recording"
    assert service.post(f"/api/recordings/{recording}/stop")["state"] == "finished"
    return verify(service.data / f"{recording}.mcap")


class Attack(threading.Thread):
    """One misbehaving client, again and again until it is told to stop.

    Attributes:
        rounds: how often it has done its worst.
    """

    def __init__(self, address: tuple[str, int], misbehave: Callable[[socket.socket, threading.Event], None]) -> None:
        super().__init__(name=misbehave.__name__)
        self.rounds = 0
        self.stop = threading.Event()
        self._address, self._misbehave = address, misbehave

    def run(self) -> None:
        """Misbehave."""
        while not self.stop.is_set():
            with suppress(OSError), socket.create_connection(self._address, timeout=2) as raw:
                self._misbehave(raw, self.stop)
            self.rounds += 1
            self.stop.wait(0.2)


@contextmanager
def _attacks(service: Serving, some_recording: str) -> Iterator[list[Attack]]:
    """All at once, for as long as this lasts."""
    parts = urlsplit(service.url)
    address = (str(parts.hostname), int(parts.port or 0))
    attacks = [
        Attack(address, misbehave)
        for misbehave in (
            _huge_body,
            _endless_body,
            _drip,
            _drip,
            _nonsense,
            _leave_at_once,
            _never_read(some_recording),
        )
    ]
    with ExitStack() as idle:
        for _ in range(IDLE_CONNECTIONS):
            idle.enter_context(socket.create_connection(address, timeout=20))
        try:
            for attack in attacks:
                attack.start()
            yield attacks
        finally:
            for attack in attacks:
                attack.stop.set()
            for attack in attacks:
                attack.join(20)


def _huge_body(raw: socket.socket, stop: threading.Event) -> None:
    raw.sendall(_HEAD + b"Content-Length: 3000000\r\n\r\n")
    for _ in range(30):
        if not stop.is_set():
            raw.sendall(b" " * 100_000)


def _endless_body(raw: socket.socket, stop: threading.Event) -> None:
    raw.sendall(_HEAD + b"Transfer-Encoding: chunked\r\n\r\n")
    for _ in range(30):
        if not stop.is_set():
            raw.sendall(b"186a0\r\n" + b" " * 100_000 + b"\r\n")


def _drip(raw: socket.socket, stop: threading.Event) -> None:
    raw.sendall(_HEAD)
    for _ in range(20):
        if not stop.wait(0.05):
            raw.sendall(b"X: 1\r\n")


def _nonsense(raw: socket.socket, _: threading.Event) -> None:
    raw.sendall(b"\x16\x03\x01" + b"\xff" * 1000 + b"\r\n\r\n")
    raw.recv(1000)


def _leave_at_once(raw: socket.socket, _: threading.Event) -> None:
    raw.sendall(b"GET /api/preview.mjpg HTTP/1.1\r\nHost: localhost\r\n\r\n")
    raw.recv(100)


def _never_read(recording: str) -> Callable[[socket.socket, threading.Event], None]:
    def never_read(raw: socket.socket, stop: threading.Event) -> None:
        raw.sendall(f"GET /api/recordings/{recording}/file HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
        stop.wait(1)

    return never_read
