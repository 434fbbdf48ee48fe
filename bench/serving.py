"""A real `svev serve` for measurements, on the simulated hill over GigE Vision."""

import http.client
import json
import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from rig.errors import ProcessDiedError
from rig.rigfile import CONFIG
from svev.subscriber import free_address

_START_S: Final = 60.0
_STOP_S: Final = 30.0


class ServedRig:
    """A running service, and one connection to it that is kept open.

    Attributes:
        pid: of the service.
        data: folder of its recordings.
    """

    def __init__(self, pid: int, port: int, data: Path) -> None:
        self.pid, self.data = pid, data
        self._connection = http.client.HTTPConnection("127.0.0.1", port, timeout=_START_S)

    def call(self, method: str, path: str, body: dict[str, Any] | None = None) -> bytes:
        """One request.

        Raises:
            ProcessDiedError: the service refuses.
        """
        headers = {} if body is None else {"Content-Type": "application/json"}
        self._connection.request(method, path, None if body is None else json.dumps(body), headers)
        answer = self._connection.getresponse()
        content = answer.read()
        if answer.status >= http.client.BAD_REQUEST:
            raise ProcessDiedError(f"{method} {path}: {answer.status} {content.decode(errors='replace')}")
        return content

    def json(self, method: str, path: str, body: dict[str, Any] | None = None) -> Any:
        """One request with a JSON answer."""
        return json.loads(self.call(method, path, body))

    def await_state(self, state: str) -> None:
        """Wait for a state.

        Raises:
            ProcessDiedError: it does not come.
        """
        deadline = time.monotonic() + _START_S
        while (status := self.json("GET", "/api/status"))["state"] != state:
            if time.monotonic() > deadline:
                raise ProcessDiedError(f"not {state} within {_START_S:g} s: {status['statement']['text']}")
            time.sleep(0.1)

    def close(self) -> None:
        """Close the connection; the next call opens another."""
        self._connection.close()


@contextmanager
def served_rig(folder: Path) -> Iterator[ServedRig]:
    """Start a service and stop it again; its recordings are left to the caller.

    Raises:
        ProcessDiedError: it does not come up.
    """
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
    folder.mkdir(parents=True, exist_ok=True)
    rig = folder / "rig.toml"
    text = (CONFIG / "rigs" / "sim-gige.toml").read_text(encoding="utf-8")
    text = text.replace("../scenarios", str(CONFIG / "scenarios"))
    text = text.replace("127.0.0.", f"127.77.{os.getpid() % 250}.")  # beside other simulated cameras
    rig.write_text(text.replace("[simulation]", f'[network]\npublish = "{free_address()}"\n\n[simulation]'))
    command = [sys.executable, "-m", "svev", "serve", "--rig", str(rig), "--port", str(port), "--data", str(folder)]
    with (folder / "service.log").open("w") as log, subprocess.Popen(command, stdout=log, stderr=log) as process:
        service = ServedRig(process.pid, port, folder)
        try:
            _await_answer(service, process)
            yield service
        finally:
            service.close()
            process.terminate()
            process.wait(_STOP_S)


def _await_answer(service: ServedRig, process: "subprocess.Popen[bytes]") -> None:
    deadline = time.monotonic() + _START_S
    while time.monotonic() < deadline:
        if process.poll() is not None:
            raise ProcessDiedError(f"svev serve ended with {process.returncode}: see {service.data}/service.log")
        try:
            service.call("GET", "/healthz")
        except OSError:
            service.close()
            time.sleep(0.05)
        else:
            return
    raise ProcessDiedError(f"svev serve does not answer within {_START_S:g} s: see {service.data}/service.log")
