"""A real `svev serve` for the tests, and a small REST client."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx

from rig.transport.launcher import Process
from tests.support.commands import launch_svev
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until

_COMMAND = (sys.executable, "-m", "svev", "serve")
#: The machine may be busy: what is waited for takes a second or two on a quiet one.
PATIENCE_S = 60.0
_ENDS_S = 20.0


class Serving:
    """A running service.

    Attributes:
        url: its address, without a slash at the end.
        data: folder of its recordings.
        log: what it writes to standard error.
    """

    def __init__(self, process: Process, url: str, data: Path, log: Path, token: str) -> None:
        self._process, self.url, self.data, self.log = process, url, data, log
        # A connection for each call: the service may be stopped, and another one be there, at any time.
        self._client = httpx.Client(
            base_url=url, timeout=PATIENCE_S, trust_env=False, verify=False,  # noqa: S501 - no TLS
            headers={"Authorization": f"Bearer {token}"} if token else {},
            limits=httpx.Limits(max_keepalive_connections=0),
        )  # fmt: skip

    @property
    def pid(self) -> int:
        """Process id of the service."""
        return self._process.pid

    def call(self, method: str, path: str, body: Mapping[str, Any] | None = None) -> tuple[int, Any]:
        """Call the API.

        Returns:
            Status code and the answer.
        """
        answer = self._client.request(method, path, json=body)
        return answer.status_code, answer.json()

    def get(self, path: str) -> Any:
        """A GET that works."""
        status, answer = self.call("GET", path)
        assert status == 200, answer
        return answer

    def post(self, path: str, body: Mapping[str, Any] | None = None) -> Any:
        """A POST that works."""
        status, answer = self.call("POST", path, body)
        assert status in {200, 201}, answer
        return answer

    def call_table(self, content: bytes) -> Any:
        """Load a start list."""
        headers = {"Content-Type": "text/csv"}
        return self._client.put("/api/start-list", content=content, headers=headers).raise_for_status().json()

    @contextmanager
    def watching(self, path: str) -> Iterator[None]:
        """Within, an endless answer is being read, or rather not: it has begun, and nobody takes it."""
        with self._client.stream("GET", path) as answer:
            assert answer.is_success
            assert next(answer.iter_raw())
            yield

    def text(self, path: str) -> str:
        """A GET whose answer is no JSON."""
        return self._client.get(path).raise_for_status().text

    def state(self) -> str:
        """The present state."""
        state: str = self.get("/api/status")["state"]
        return state

    def await_state(self, *states: str) -> dict[str, Any]:
        """Wait for one of these states.

        Returns:
            The status.
        """
        wait_until(lambda: self.state() in states, f"state {states}, log:\n{self.log.read_text()}", PATIENCE_S, 0.05)
        status: dict[str, Any] = self.get("/api/status")
        return status

    def await_statement(self, code: str) -> dict[str, Any]:
        """Wait for a statement: on a busy machine a camera may seem silent at first, which matters more.

        Returns:
            The statement.
        """
        seen: dict[str, Any] = {}

        def said() -> bool:
            seen.update(self.get("/api/status")["statement"])
            return bool(seen["code"] == code)

        wait_until(said, f"statement {code}", PATIENCE_S, 0.05)
        return seen

    def arm(self) -> dict[str, Any]:
        """Arm, and wait until that is done."""
        self.post("/api/arm")
        return self.await_state("armed")

    def await_cameras(self, *states: str) -> dict[str, Any]:
        """Wait until the cameras have these states: on a busy machine one may seem silent at first.

        Returns:
            The status.
        """

        def so() -> bool:
            return tuple(camera["state"] for camera in self.get("/api/status")["cameras"]) == states

        wait_until(so, f"cameras {states}, log:\n{self.log.read_text()}", PATIENCE_S, 0.05)
        status: dict[str, Any] = self.get("/api/status")
        return status

    def await_pulses(self, count: int) -> None:
        """Wait until the recording in progress holds so many pulses."""

        def enough() -> bool:
            recording = self.get("/api/status")["recording"]
            return recording is not None and recording["counts"]["pulses"] >= count

        begun = self.log.stat().st_size
        try:
            wait_until(enough, f"{count} pulses recorded", PATIENCE_S, 0.05)
        except AssertionError as error:
            error.add_note(f"status: {self.get('/api/status')}\nlog since:\n{self.log.read_text()[begun:]}")
            raise

    def pids(self) -> dict[str, int]:
        """Process ids by row of the process table."""
        return {process["name"]: process["pid"] for process in self.get("/api/status")["processes"]}

    def signal(self, number: signal.Signals) -> None:
        """Send a signal to the service."""
        self._process.send_signal(number)

    def exit_code(self, timeout_s: float = PATIENCE_S) -> int:
        """Wait for the end."""
        return self._process.wait(timeout_s)

    def close(self) -> None:
        """Close the client."""
        self._client.close()


@contextmanager
def serving(
    folder: Path,
    rig: Path,
    loopback: Loopback,
    *more: str,
    environment: Mapping[str, str] | None = None,
    prefix: tuple[str, ...] = (),
    command: Sequence[str] = _COMMAND,
    data: Path | None = None,
    token: str = "",
    ends_with: int = 0,
    port: int | None = None,
    host: str | None = None,
) -> Iterator[Serving]:
    """A service on a port of this test's own, or the one given; ended by SIGTERM, with the exit code `ends_with`.

    `host` is another address of this computer: names that a browser looks for here lead to 127.0.0.1.
    """
    host = loopback.host if host is None else host
    port = loopback.free_port() if port is None else port
    log, data = folder / "service.log", folder / "data" if data is None else data
    arguments = ["--rig", str(rig), "--host", host, "--port", str(port), "--data", str(data), *more]
    with log.open("w") as file:
        process: Process
        if (*prefix, *command) == _COMMAND:
            process = launch_svev("serve", *arguments, environment=environment, output=file.fileno())
        else:
            process = subprocess.Popen(
                [*prefix, *command, *arguments], stdout=file, stderr=file, env={**os.environ, **(environment or {})}
            )
    service = Serving(process, f"http://{host}:{port}", data, log, token)
    try:
        wait_until(lambda: _answers(service), "the API answers", PATIENCE_S)
        yield service
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE_S) == ends_with, log.read_text()
    except BaseException:
        _end(process)
        raise
    finally:
        service.close()


def _end(process: Process) -> None:
    """End a service after a failure; told to, it ends its cameras and grabbers before it is gone."""
    process.send_signal(signal.SIGTERM)
    try:
        process.wait(_ENDS_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait(_ENDS_S)


def _answers(service: Serving) -> bool:
    assert service._process.poll() is None, service.log.read_text()
    try:
        return service.call("GET", "/healthz")[0] == 200
    except httpx.TransportError:
        return False
