"""What others see of an armed service: metrics, the live log, the doctor, pictures."""

import json
from datetime import UTC, datetime
from pathlib import Path

import zmq

from recorder.reading.info import info
from recorder.reading.log_reader import LogReader
from rig.events import Event
from rig.settings.file import load_rig
from rig.topics import EVENTS
from tests.capture.rigs import write_rig
from tests.service.serving import PATIENCE_S, serving
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until


def _values(metrics: str) -> dict[str, float]:
    """Sample values by name and labels."""
    lines = [line.rsplit(" ", 1) for line in metrics.splitlines() if not line.startswith("#")]
    return {name: float(value) for name, value in lines}


def test_an_armed_service_can_be_watched(tmp_path: Path, loopback: Loopback) -> None:
    with serving(tmp_path, write_rig(tmp_path, "sim", loopback), loopback, "--preroll", "2") as service:
        idle = _values(service.text("/metrics"))
        assert (idle['svev_state{state="idle"}'], idle['svev_camera_present{camera="K1"}']) == (1, 0)
        service.arm()

        def held() -> bool:
            """Full, and armed for long enough: a recording reaches back no further than that."""
            status = service.get("/api/status")
            armed_s = (datetime.now(UTC) - datetime.fromisoformat(status["since"])).total_seconds()
            return bool(status["preroll"]["seconds"] > 1.9 and armed_s > 2.5)

        wait_until(held, "the pre-roll is full", PATIENCE_S, 0.1)
        service.await_cameras("ready", "ready", "ready")
        status, values = service.get("/api/status"), _values(service.text("/metrics"))
        assert status["preroll"]["limit_s"] == 2
        assert status["preroll"]["memory_mb"] > 50
        assert status["disk"]["jumps_left"] == status["disk"]["seconds_left"] // status["disk"]["jump_s"]
        assert status["pulses"]["arriving"]
        for camera in ("K1", "K2", "K3"):
            assert values[f'svev_frames_total{{camera="{camera}"}}'] > 30
            assert values[f'svev_camera_present{{camera="{camera}"}}'] == 1
            assert abs(values[f'svev_clock_offset_seconds{{camera="{camera}"}}']) < 1e-3
        assert values['svev_state{state="armed"}'] == 1
        assert values["svev_latency_seconds_count"] == values['svev_latency_seconds_bucket{le="+Inf"}'] > 30
        assert values["svev_latency_seconds_sum"] > 0
        assert values["svev_triplet_buffers_free"] > 0
        assert values['svev_process_restarts_total{process="recorder"}'] == 0
        examined = service.get("/api/doctor")
        assert {finding["topic"] for finding in examined["findings"]} >= {"software", "memory", "disk", "cameras"}
        assert any("disarm for that" in finding["what"] for finding in examined["findings"])
        saved = service.post("/api/recordings", {"duration_s": 0})
        service.post(f"/api/recordings/{saved['id']}/stop")
        # As the times of its pulses have it: a crowded machine makes fewer of them, and stops later.
        held_s = info(service.data / f"{saved['id']}.mcap").ledger.duration_s
        assert 55 <= 30 * held_s <= 66, "the two seconds that were held"


def test_arming_and_starting_stand_in_the_log_and_on_zeromq(tmp_path: Path, loopback: Loopback) -> None:
    rig = write_rig(tmp_path, "sim", loopback)
    published: list[str] = []
    with (
        zmq.Context() as context,
        context.socket(zmq.SUB) as subscriber,
        serving(tmp_path, rig, loopback, "--preroll", "5") as service,
    ):
        for topic in (b"event", b"health"):
            subscriber.subscribe(topic)
        subscriber.connect(load_rig(rig).network.publish)
        topics = set[bytes]()

        def heard(text: str) -> bool:
            while subscriber.poll(0):
                topic, body = subscriber.recv_multipart()[:2]
                topics.add(topic)
                if topic == b"event":
                    published.append(json.loads(body)["message"])
            return any(text in message for message in published)

        service.arm()
        # A subscriber that connects while events are told misses them: health comes every second.
        wait_until(lambda: heard("") or b"health" in topics, "the subscriber is connected", PATIENCE_S)
        recording = service.post("/api/recordings", {"duration_s": 0.5})
        wait_until(lambda: heard("recording -> armed"), "the end of the recording is published", PATIENCE_S)
        path = service.data / f"{recording['id']}.mcap"
    assert any("armed -> recording" in message for message in published)
    with LogReader(path) as reader:
        events = [Event.from_protobuf(m.data).message for m in reader.messages(EVENTS.name) if m.data is not None]
    assert any("arming -> armed" in text for text in events), "the pre-roll reaches back to the arming"
    assert any("armed -> recording" in text for text in events)
