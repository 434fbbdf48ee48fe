"""What systemd hears, on a real datagram socket, from a real service."""

import os
import signal
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from svev.service.notify import Notify
from tests.capture.rigs import write_rig
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until
from tests.svev.service.serving import PATIENCE_S, serving


@contextmanager
def _systemd(folder: Path) -> Iterator[tuple[str, list[str]]]:
    """A notification socket, and all that has come; call the list's `extend` through `_hear`."""
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
        """Take what has come."""
        while True:
            try:
                self.append(self._socket.recv(65536).decode())
            except BlockingIOError:
                return self


def test_what_systemd_hears_also_of_a_stuck_recorder(tmp_path: Path, short_path: Path, loopback: Loopback) -> None:
    rig = write_rig(tmp_path, "sim", loopback)
    with _systemd(short_path) as (path, heard):
        assert isinstance(heard, _Heard)
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


def test_silent_without_systemd() -> None:
    notify = Notify({})
    notify.ready()
    notify.status("all is well")
    notify.feed_watchdog()
    notify.close()
