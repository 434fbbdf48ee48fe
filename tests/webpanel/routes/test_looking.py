"""What people look for in a recording: where it begins to matter, notes at single pulses, pictures without loss."""

import json
from pathlib import Path

import cv2
import httpx
import numpy as np
import pytest

from recorder.reading.info import info
from tests.recorder.logs import ALL_OK, make_image, make_tag
from tests.webpanel.memory_service import SHAPE, MemoryService, write_recording
from tests.webpanel.serving import refused

NOTES = "/api/recordings/jump/notes"


@pytest.fixture(autouse=True)
def log(service: MemoryService) -> Path:
    """A recording with the id `jump`, in which nothing moves but noise."""
    return write_recording(service.catalogue.directory, "jump", (ALL_OK,) * 40)


def test_a_recording_opens_at_the_take_off_if_it_was_measured(client: httpx.Client, log: Path) -> None:
    assert client.get("/api/recordings/jump/moment").json() == {"pulse": None, "kind": "none"}
    beside = log.with_suffix(".jumper.json")
    beside.write_text(json.dumps({"jumps": [{"takeoff": {"pulse": 16.8}}]}))
    assert client.get("/api/recordings/jump/moment").json() == {"pulse": 17, "kind": "takeoff"}
    for broken in ("", "[]", '{"jumps": [{"takeoff": null}]}', '{"jumps": [{"takeoff": {"pulse": 1e999}}]}'):
        beside.write_text(broken)
        assert client.get("/api/recordings/jump/moment").json()["kind"] == "none"
    refused(client.get("/api/recordings/nobody/moment"), 404)


def test_a_picture_without_loss_is_that_of_the_log(client: httpx.Client) -> None:
    answer = client.get("/api/recordings/jump/pulses/3.png?camera=K2&download=true")
    assert answer.headers["content-disposition"] == 'attachment; filename="jump_3_K2.png"'
    picture = cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(picture, make_image(make_tag(3, ALL_OK, SHAPE))[:, 160:320])
    refused(client.get("/api/recordings/jump/pulses/3.png?camera=K9"), 404)


def test_notes_stand_beside_the_log_and_go_where_the_recording_goes(client: httpx.Client, log: Path) -> None:
    content = log.read_bytes()
    assert client.get(NOTES).json() == []
    client.put(f"{NOTES}/30", json={"text": "ski tips open"})
    client.put(f"{NOTES}/7", json={"text": "sats for tidlig, Åse"})
    notes = client.put(f"{NOTES}/30", json={"text": "left ski"}).json()
    assert notes == [{"pulse": 7, "text": "sats for tidlig, Åse"}, {"pulse": 30, "text": "left ski"}]
    assert log.read_bytes() == content
    assert info(log).session["note.7"] == "sats for tidlig, Åse"
    client.delete("/api/recordings/jump").raise_for_status()
    assert client.get(NOTES).json() == notes
    client.post("/api/recordings/jump/restore").raise_for_status()
    assert client.delete(f"{NOTES}/7").json() == notes[1:]
    assert client.delete(f"{NOTES}/8").json() == notes[1:]
    assert client.get(NOTES).json() == notes[1:]


def test_notes_never_outgrow_their_file(client: httpx.Client) -> None:
    for pulse in range(1, 61):
        client.put(f"{NOTES}/{pulse}", json={"text": "😀" * 120}).raise_for_status()
    assert "at most 60 notes" in refused(client.put(f"{NOTES}/61", json={"text": "one more"}), 409).detail
    client.put(f"{NOTES}/60", json={"text": "another"}).raise_for_status()
    client.patch("/api/recordings/jump", json={"notes": "😀" * 4000}).raise_for_status()
    assert len(client.get(NOTES).json()) == 60
    refused(client.put(f"{NOTES}/1", json={"text": "x" * 121}), 422)
    refused(client.put(f"{NOTES}/1", json={"text": ""}), 422)
