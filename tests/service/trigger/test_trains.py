"""The train of pulses while the rig is armed: another rate, stopped and started, a number of pulses on request."""

import time
import tomllib
from contextlib import closing
from itertools import pairwise
from pathlib import Path

import pytest

from recorder.reading.log_reader import LogReader
from rig.api.trigger import TriggerChange
from rig.errors import BadInputError, StateForbidsError, SvevError
from rig.settings.file import load_rig
from rig.settings.model import RigSettings
from rig.tag import TripletTag
from rig.topics import RIG_ATTACHMENT, TAG
from rig.transport.recorder_commands import RecorderOptions
from service.status.event_hub import EventHub
from service.supervision.supervisor import Supervisor
from service.trains import Trains
from tests.capture.rigs import write_rig
from tests.service.serving import PATIENCE_S, Serving, serving
from tests.support.loopback import Loopback
from tests.support.stamps import hill_pulses
from tests.support.waiting import wait_until

pytestmark = pytest.mark.long

TRIGGER, BURST = "/api/trigger", "/api/trigger/burst"
#: Counts that have not grown for so long do not any more; they are reported twice a second.
_RESTS_S = 2.0


def test_the_rate_is_changed_while_armed(tmp_path: Path, loopback: Loopback) -> None:
    path = write_rig(tmp_path, "sim", loopback, source="triggerbox", rate_hz=20, names=["K1", "K2"])
    first = path.read_text()
    with serving(tmp_path, path, loopback) as service:
        service.arm()
        now = {"source": "triggerbox", "rate_hz": 20, "controls": ["rate", "running"], "running": True, "saved": True}
        assert service.get(TRIGGER) == now
        status, answer = service.call("PATCH", TRIGGER, {"rate_hz": 600})
        assert (status, "camera K1 exposes for 2 ms" in answer["detail"]) == (422, True)
        recording = service.post("/api/recordings")["id"]
        status, answer = service.call("PATCH", TRIGGER, {"rate_hz": 40})
        assert (status, "stop it, then change the rate" in answer["detail"]) == (409, True)
        service.await_pulses(10)
        service.post(f"/api/recordings/{recording}/stop", {"confirm": True})
        assert service.call("PATCH", TRIGGER, {"rate_hz": 40})[1] == now | {"rate_hz": 40, "saved": False}
        assert service.state() == "arming"
        service.await_state("armed")
        other = service.post("/api/recordings")["id"]
        service.await_pulses(40)
        service.post(f"/api/recordings/{other}/stop", {"confirm": True})
        assert path.read_text() == first
        assert service.call("PATCH", TRIGGER, {"save": True})[1] == now | {"rate_hz": 40}
        assert service.state() == "armed"
        disk = service.get("/api/status")["disk"]["seconds_left"]
        service.post("/api/disarm")
        service.await_state("idle")
        assert service.call("PATCH", TRIGGER, {"rate_hz": 20})[0] == 200
        wait_until(
            lambda: service.get("/api/status")["disk"]["seconds_left"] > 1.5 * disk, "room by the new rate", PATIENCE_S
        )
    _evenly(service.data / f"{recording}.mcap", load_rig(path), 20)
    _evenly(service.data / f"{other}.mcap", load_rig(path), 40)
    assert tomllib.loads(path.read_text()) == tomllib.loads(first) | {
        "trigger": {"source": "triggerbox", "rate_hz": 40}
    }


def _evenly(log: Path, rig: RigSettings, rate_hz: float) -> None:
    """No triplet of a log is mixed, its pulses lie whole periods apart, and its rig file says the rate."""
    with LogReader(log) as reader:
        tags = [TripletTag.decode(message.data or b"") for message in reader.messages(TAG.name)]
        attached = tomllib.loads(reader.attachments[RIG_ATTACHMENT].decode())
    assert attached["trigger"]["rate_hz"] == rate_hz
    whole = [tag for tag in tags if tag.complete]  # frames come too late on a busy machine
    assert len(whole) > len(tags) / 2
    periods = [(after.time - before.time) * rate_hz / 1e9 for before, after in pairwise(whole)]
    assert periods == pytest.approx([after.pulse - before.pulse for before, after in pairwise(whole)], abs=0.05)
    assert max(len(pulses) for pulses in hill_pulses(log, rig).values()) == 1


@pytest.mark.parametrize(
    ("backend", "source", "rate_hz", "error", "said"),
    [
        (
            "sim",
            "external",
            40,
            StateForbidsError,
            r'svev does not drive makes the pulses \(trigger.source = "external"',
        ),
        ("iidc", "software", 60, BadInputError, "exposure and readout of camera K1 take 16.8 ms: choose a lower rate"),
        ("sim", "triggerbox", 3.5, BadInputError, 'key "rate_hz" = 3.5'),
    ],
)
def test_what_cannot_be_is_refused_before_anything_ends(
    tmp_path: Path, loopback: Loopback, backend: str, source: str, rate_hz: float, error: type[SvevError], said: str
) -> None:
    path = write_rig(tmp_path, backend, loopback, source=source, rate_hz=20, names=["K1"])
    path.write_text(path.read_text() + "exposure_us = 16300\n")
    hub = EventHub(lambda _: None)
    supervisor = Supervisor(load_rig(path), path.read_text(), hub, RecorderOptions(directory=tmp_path))
    with closing(supervisor._commands), pytest.raises(error, match=said):
        Trains(supervisor, path, 5.0).change(TriggerChange(rate_hz=rate_hz, save=True))
    assert supervisor.rig.trigger.rate_hz == tomllib.loads(path.read_text())["trigger"]["rate_hz"] == 20
    assert hub.after(0) == []


def test_pulses_are_stopped_made_on_request_and_started_by_a_recording(tmp_path: Path, loopback: Loopback) -> None:
    """Real Aravis and simulated cameras, which expose at each command and at nothing else."""
    path = write_rig(tmp_path, "aravis", loopback, source="action", rate_hz=20, names=["K1", "K2"])
    path.write_text(path.read_text() + "[recorder]\npreroll_s = 60\n")  # a busy machine is slow to say that none come
    with serving(tmp_path, path, loopback) as service:
        assert service.call("PATCH", TRIGGER, {"running": False})[0] == 409
        service.arm()
        wait_until(lambda: min(_commands(service), default=0) >= 20, "both cameras answer", PATIENCE_S, 0.05)
        status, answer = service.call("POST", BURST, {"pulses": 5})
        assert (status, "the pulses run: stop them" in answer["detail"]) == (409, True)
        assert service.call("PATCH", TRIGGER, {"running": False})[1]["running"] is False
        service.await_statement("state_still")
        before, seen = _at_rest(service)
        assert service.call("POST", BURST, {"pulses": 5})[0] == 202
        wait_until(lambda: _at_rest(service)[0] >= before + 5, "five pulses", PATIENCE_S, 0.05)
        assert _at_rest(service)[0] == before + 5
        wait_until(lambda: _frames(service) > seen, "their frames", PATIENCE_S, 0.05)
        past = service.post("/api/recordings", {"duration_s": 0})["id"]
        service.await_state("armed")
        assert service.get(TRIGGER)["running"] is False
        recording = service.post("/api/recordings", {"preroll_s": 0})["id"]
        assert service.get(TRIGGER)["running"] is True
        service.await_pulses(10)
        status, answer = service.call("PATCH", TRIGGER, {"running": False})
        assert (status, "a recording is running: stop it" in answer["detail"]) == (409, True)
        service.post(f"/api/recordings/{recording}/stop", {"confirm": True})
        assert service.get(f"/api/recordings/{past}")["counts"]["pulses"] >= 5
    with LogReader(service.data / f"{recording}.mcap") as reader:
        tags = [TripletTag.decode(message.data or b"") for message in reader.messages(TAG.name)]
    assert any(tag.complete for tag in tags)  # a busy machine holds commands and cameras up: not all are


def _commands(service: Serving) -> list[int]:
    """To how many commands each camera has answered, or has had the time to."""
    return [sum(camera["actions"].values()) for camera in service.get("/api/status")["cameras"] if camera["actions"]]


def _frames(service: Serving) -> int:
    """How many frames have come of both cameras."""
    return sum(camera["frames"] for camera in service.get("/api/status")["cameras"])


def _at_rest(service: Serving) -> tuple[int, int]:
    """How many commands a camera has had, when no pulses come any more, and how many frames have come.

    The commands are what the service makes of a request; on a busy machine a simulated camera may miss one.
    """
    seen = [(0, 0, time.monotonic())]

    def unchanged() -> bool:
        now = max(_commands(service)), _frames(service)
        if now != seen[-1][:2]:
            seen.append((*now, time.monotonic()))
        return time.monotonic() - seen[-1][2] > _RESTS_S

    wait_until(unchanged, "no pulses come", PATIENCE_S, 0.05)
    return seen[-1][:2]
