"""Three operators at once: whatever they press, the status is consistent and no recording is lost."""

import random
import re
import threading
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from recorder.checking.verify import verify
from rig.api.status import State
from service.supervision.phases import FOLLOWS
from tests.capture.rigs import write_rig
from tests.service.serving import Serving, serving
from tests.support.loopback import Loopback

_MOVE = re.compile(r"service: (\w+) -> (\w+)")


class _Operator(threading.Thread):
    """Presses buttons at random.

    Attributes:
        started: ids of the recordings that this one was told to have started.
        wrong: what it saw that must not be.
    """

    def __init__(self, service: Serving, seed: int, presses: int) -> None:
        super().__init__()
        self._service, self._random, self._presses = service, random.Random(seed), presses
        self.started: list[str] = []
        self.wrong: list[Any] = []

    def run(self) -> None:
        """Press."""
        for _ in range(self._presses):
            what = self._random.choice(["start", "start", "stop", "stop", "arm", "disarm", "session", "status"])
            status, answer = self._press(what)
            if status not in {200, 201, 404, 409}:
                self.wrong.append((what, status, answer))
            if what == "start" and status == 201:
                self.started.append(answer["id"])
            if what == "status":
                self._look(answer)

    def _press(self, what: str) -> tuple[int, Any]:
        some = self.started[-1] if self.started else "none"
        match what:
            case "start":
                return self._service.call("POST", "/api/recordings", {"duration_s": self._random.choice([0.1, 60])})
            case "stop":
                current = self._service.get("/api/status")["recording"]
                return self._service.call("POST", f"/api/recordings/{current['id'] if current else some}/stop")
            case "session":
                return self._service.call("PATCH", f"/api/recordings/{some}", {"bib": str(self._presses)})
            case "status":
                return self._service.call("GET", "/api/status")
            case _:
                return self._service.call("POST", f"/api/{what}")

    def _look(self, status: dict[str, Any]) -> None:
        if (status["state"] == "recording") != (status["recording"] is not None):
            self.wrong.append(status)
        if status["state"] == "idle" and any(camera["state"] != "off" for camera in status["cameras"]):
            self.wrong.append(status)


@pytest.mark.long
def test_three_operators_do_not_tear_the_state(tmp_path: Path, loopback: Loopback) -> None:
    with serving(tmp_path, write_rig(tmp_path, "sim", loopback), loopback) as service:
        service.arm()
        operators = [_Operator(service, seed, 40) for seed in range(3)]
        for operator in operators:
            operator.start()
        for operator in operators:
            operator.join(150)
        assert not any(operator.is_alive() for operator in operators)
        assert [operator.wrong for operator in operators] == [[], [], []]
        current = service.get("/api/status")["recording"]
        if current is not None:
            service.post(f"/api/recordings/{current['id']}/stop")
        service.await_state("idle", "armed")
        service.post("/api/disarm")
        service.await_state("idle")
        listed = service.get("/api/recordings")
        started = [name for operator in operators for name in operator.started]
        assert sorted(found["id"] for found in listed) == sorted(started), "each order one recording"
        assert {found["state"] for found in listed} <= {"finished"}
        moves = [(State(before), State(to)) for before, to in _MOVE.findall(service.log.read_text())]
        assert all(to in FOLLOWS[before] for before, to in moves)
        assert all(first[1] is second[0] for first, second in pairwise(moves))
    for found in listed:
        assert verify(tmp_path / "data" / f"{found['id']}.mcap").closed
