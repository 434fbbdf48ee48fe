"""Runs a real `svev serve` for measurements, with simulated GigE Vision cameras."""

import os
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import httpx

from recorder.publishing.subscriber import free_address
from rig.errors import ProcessDiedError
from rig.settings.file import CONFIG
from rig.transport.launcher import program_command

_START_S: Final = 60.0
_STOP_S: Final = 30.0


class ServedRig:
    """A running service, and a client of its REST API that keeps its connection open from call to call.

    Attributes:
        pid: of the service's process.
        url: its address.
        data: folder of its recordings.
    """

    def __init__(self, pid: int, port: int, data: Path) -> None:
        self.pid, self.url, self.data = pid, f"http://127.0.0.1:{port}", data
        # The service closes a connection that has been idle for 5 s: the client must not use it when that is near.
        self._client = httpx.Client(
            base_url=self.url, timeout=_START_S, trust_env=False, verify=False,  # noqa: S501 - no TLS
            limits=httpx.Limits(keepalive_expiry=2.0),
        )  # fmt: skip

    def call(self, method: str, path: str, body: dict[str, Any] | None = None) -> httpx.Response:
        """Call the API.

        Raises:
            ProcessDiedError: the service refuses.
        """
        answer = self._client.request(method, path, json=body)
        if answer.is_error:
            raise ProcessDiedError(f"{method} {path}: {answer.status_code} {answer.text}")
        return answer

    def json(self, method: str, path: str, body: dict[str, Any] | None = None) -> Any:
        """Call the API, and return the JSON of the answer."""
        return self.call(method, path, body).json()

    def put_table(self, path: str, content: bytes) -> None:
        """Send a table, CSV.

        Raises:
            ProcessDiedError: the service refuses.
        """
        answer = self._client.put(path, content=content, headers={"Content-Type": "text/csv"})
        if answer.is_error:
            raise ProcessDiedError(f"PUT {path}: {answer.status_code} {answer.text}")

    def await_state(self, state: str) -> None:
        """Wait until the rig is in a state.

        Raises:
            ProcessDiedError: it is not within 60 s.
        """
        deadline = time.monotonic() + _START_S
        while (status := self.json("GET", "/api/status"))["state"] != state:
            if time.monotonic() > deadline:
                raise ProcessDiedError(f"not {state} within {_START_S:g} s: {status['statement']['text']}")
            time.sleep(0.1)

    def close(self) -> None:
        """Close the connection."""
        self._client.close()


@contextmanager
def served_rig(folder: Path, tables: str = "") -> Iterator[ServedRig]:
    """Start a service, and stop it when the context ends. The caller removes the recordings.

    Args:
        folder: of rig file and recordings.
        tables: of the rig file, with `[simulation]` among them; left out: those of the rig that comes with Svev.

    Raises:
        ProcessDiedError: the service ends, or does not answer within 60 s.
    """
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
    folder.mkdir(parents=True, exist_ok=True)
    rig = folder / "rig.toml"
    text = (CONFIG / "rigs" / "sim-gige.toml").read_text(encoding="utf-8")
    text = text.replace("../scenarios", str(CONFIG / "scenarios"))
    text = text.replace("127.0.0.", f"127.77.{os.getpid() % 250}.")  # other runs use other addresses
    head, _, rest = text.partition("[simulation]\n")
    scenario, _, cameras = rest.partition("\n\n")
    tables = tables or f"[simulation]\n{scenario}\n"
    rig.write_text(f'{head}[network]\npublish = "{free_address()}"\n\n{tables}\n{cameras}')
    command = [*program_command("svev"), "serve", "--rig", str(rig), "--port", str(port), "--data", str(folder)]
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
        except httpx.TransportError:
            time.sleep(0.05)
        else:
            return
    raise ProcessDiedError(f"svev serve does not answer within {_START_S:g} s: see {service.data}/service.log")
