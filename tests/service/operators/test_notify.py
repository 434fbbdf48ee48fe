"""What systemd hears, on a real datagram socket, from a real service."""

import os
import signal
import socket
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from svev.serving.systemd import Notify
from tests.capture.rigs import write_rig
from tests.service.serving import PATIENCE_S, serving
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until


@contextmanager
def _systemd(folder: Path) -> Iterator[tuple[str, "_Heard"]]:
    """A notification socket, and the messages that have come; `listen` receives more of them."""
    path = str(folder / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sock:
        sock.bind(path)
        sock.setblocking(False)
        heard = _Heard(sock)
        yield path, heard


class _Heard(list[str]):
    def __init__(self, sock: socket.socket) -> None:
        super().__init__()
        self._socket = sock

    def listen(self) -> "_Heard":
        """Receive the messages that have come."""
        while True:
            try:
                self.append(self._socket.recv(65536).decode())
            except BlockingIOError:
                return self


@pytest.mark.long
def test_what_systemd_hears_also_of_a_stuck_recorder(tmp_path: Path, short_path: Path, loopback: Loopback) -> None:
    rig = write_rig(tmp_path, "sim", loopback)
    with _systemd(short_path) as (path, heard):
        environment = {"NOTIFY_SOCKET": path, "WATCHDOG_USEC": "600000", "JOURNAL_STREAM": "8:1"}
        with serving(tmp_path, rig, loopback, environment=environment) as service:
            wait_until(lambda: "READY=1" in heard.listen(), "READY", PATIENCE_S)
            service.arm()
            wait_until(lambda: any(m.startswith("STATUS=armed: armed") for m in heard.listen()), "STATUS", PATIENCE_S)
            fed = heard.count("WATCHDOG=1")
            wait_until(lambda: heard.listen().count("WATCHDOG=1") > fed + 3, "the watchdog is fed", PATIENCE_S)
            os.kill(service.pids()["recorder"], signal.SIGSTOP)
            wait_until(lambda: service.call("GET", "/healthz")[0] == 503, "unwell", PATIENCE_S)
            heard.listen().clear()
            assert service.call("GET", "/healthz")[0] == 503
            assert "WATCHDOG=1" not in heard.listen(), "no food while the recorder is silent"
            wait_until(lambda: service.state() == "fault", "it is taken for stuck, and ended", PATIENCE_S)
            service.await_state("armed")
            wait_until(lambda: "WATCHDOG=1" in heard.listen(), "fed again", PATIENCE_S)
        assert "STOPPING=1" in heard.listen()
        log = service.log.read_text()
        assert "<6>service: arming -> armed" in log
        assert "<6>K1: connected" in log
        assert "<2>recorder: no sign of life" in log


def test_the_service_never_waits_for_a_systemd_that_does_not_read(
    tmp_path: Path, short_path: Path, loopback: Loopback
) -> None:
    rig = write_rig(tmp_path, "sim", loopback)
    with _systemd(short_path) as (path, heard):
        environment = {"NOTIFY_SOCKET": path, "WATCHDOG_USEC": "300000"}
        with serving(tmp_path, rig, loopback, environment=environment) as service:
            full = _fill(path)
            service.arm()
            service.await_state("armed")
            wait_until(lambda: "does not read its notification socket" in service.log.read_text(), "said", PATIENCE_S)
            assert service.call("GET", "/healthz")[0] == 200
            heard.listen()
            wait_until(lambda: "WATCHDOG=1" in heard.listen(), "fed again when there is room", PATIENCE_S)
            assert heard.count("filling") == full


def _fill(path: str) -> int:
    """Send until the socket takes no more; returns how many it took."""
    sent = 0
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sock:
        sock.setblocking(False)
        sock.connect(path)
        while True:
            try:
                sock.send(b"filling")
            except BlockingIOError:
                return sent
            sent += 1


def test_what_could_not_be_sent_is_counted_and_sent_later(short_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with _systemd(short_path) as (path, heard):
        monkeypatch.setenv("NOTIFY_SOCKET", path)
        with closing(Notify()) as notify:
            _fill(path)
            notify.ready()
            notify.status("one")
            notify.status("two")
            assert notify.unsent == 3
            heard.listen().clear()
            notify.status("two")
            assert heard.listen() == ["READY=1", "STATUS=two"]


def test_silent_without_systemd() -> None:
    notify = Notify({})
    notify.ready()
    notify.status("all is well")
    notify.feed_watchdog()
    notify.close()


def test_letters_of_all_languages_arrive_and_names_that_are_in_no_file_system_are_reached(short_path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as abstract:
        name = f"svev-{short_path.name}"
        abstract.bind(f"\0{name}")
        abstract.setblocking(False)
        with closing(Notify({"NOTIFY_SOCKET": f"@{name}"})) as notify:
            notify.status("armed in Trøndelag")
        assert _Heard(abstract).listen() == ["STATUS=armed in Trøndelag"]


def test_without_systemd_or_where_nobody_listens_nothing_is_sent(short_path: Path) -> None:
    for environment in ({}, {"NOTIFY_SOCKET": str(short_path / "nobody")}):
        with closing(Notify(environment)) as notify:
            notify.ready()
            assert notify.unsent == 0
