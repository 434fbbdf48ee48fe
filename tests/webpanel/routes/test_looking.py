"""What people look for in a recording: where it begins to matter, notes at single pulses, pictures without loss."""

import hashlib
import io
import json
import zipfile
from pathlib import Path

import cv2
import httpx
import numpy as np
import pytest

from recorder.reading.info import info
from rig.api.looking import VOICE_BYTES_MAX, VOICES_MAX
from tests.recorder.logs import ALL_OK, make_image, make_tag
from tests.webpanel.memory_service import SHAPE, MemoryService, write_recording
from tests.webpanel.serving import refused

NOTES = "/api/recordings/jump/notes"
VOICES = "/api/recordings/jump/voice-notes"
#: The head of a WebM file, as a browser begins one.
WEBM = bytes.fromhex("1a45dfa39f4286810142f7810142f2810442f381084282847765626d42878104428581021853806701ffffffffffffff")
SOUND = {"Content-Type": "audio/webm"}


@pytest.fixture(autouse=True)
def log(service: MemoryService) -> Path:
    """A recording with the id `jump`, in which nothing moves but noise."""
    return write_recording(service.catalogue.directory, "jump", (ALL_OK,) * 40)


def test_a_recording_opens_at_the_take_off_if_it_was_measured(client: httpx.Client, log: Path) -> None:
    assert client.get("/api/recordings/jump/moment").json() == {
        "pulse": None,
        "kind": "none",
        "from_log": False,
        "exact": None,
    }
    beside = log.with_suffix(".jumper.json")
    beside.write_text(json.dumps({"jumps": [{"takeoff": {"pulse": 16.8}}]}))
    assert client.get("/api/recordings/jump/moment").json() == {
        "pulse": 17,
        "kind": "takeoff",
        "from_log": False,
        "exact": 16.8,
    }
    assert client.get("/api/recordings/jump/moment?by_motion=true").json()["kind"] == "none"
    pulses = [{"pulse": pulse} for pulse in (27, 28, 29)]
    two = [{"takeoff": {"pulse": 16.8}, "pulses": []}, {"number": 2, "takeoff": {"pulse": 30.1}, "pulses": pulses}]
    beside.write_text(json.dumps({"jumps": two}))
    assert client.get("/api/recordings/jump/moment?jump=2").json()["exact"] == 30.1
    by_motion = client.get("/api/recordings/jump/moment?jump=2&by_motion=true").json()
    assert (by_motion["pulse"], by_motion["kind"]) == (28, "activity")
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


def speak(client: httpx.Client, pulse: int, content: bytes) -> httpx.Response:
    """Send a spoken note."""
    return client.post(VOICES, params={"pulse": pulse}, content=content, headers=SOUND)


def test_spoken_notes_stand_beside_the_log_and_go_where_the_recording_goes(
    client: httpx.Client, service: MemoryService, log: Path
) -> None:
    content, first, second = log.read_bytes(), WEBM + b"first", WEBM + b"second" * 30_000
    client.patch("/api/recordings/jump", json={"bib": "17", "athlete": "Åse"}).raise_for_status()
    assert client.get(VOICES).json() == []
    assert speak(client, 30, first).status_code == 201
    notes = speak(client, 7, second).json()
    assert [(note["number"], note["pulse"], note["bytes"]) for note in notes] == [
        (1, 30, len(first)),
        (2, 7, len(second)),
    ]
    heard = client.get(f"{VOICES}/2/sound.webm?download=true")
    assert (heard.content, heard.headers["content-type"]) == (second, "audio/webm")
    assert "17_Ase_jump_note-2_pulse-7.webm" in heard.headers["content-disposition"]
    archive = client.get("/api/recordings.zip?ids=jump")
    assert int(archive.headers["content-length"]) == len(archive.content)
    with zipfile.ZipFile(io.BytesIO(archive.content)) as opened:
        assert opened.read("17_Åse_jump_note-2_pulse-7.webm") == second
        assert hashlib.sha256(first).hexdigest() in opened.read("SHA256SUMS").decode()
    assert log.read_bytes() == content
    client.delete("/api/recordings/jump").raise_for_status()
    assert client.get(VOICES).json() == notes
    assert client.get("/api/trash").json()["bytes"] > len(content) + len(second)
    client.post("/api/recordings/jump/restore").raise_for_status()
    assert [note["number"] for note in client.delete(f"{VOICES}/1").json()] == [2]
    refused(client.get(f"{VOICES}/1/sound.webm"), 404)
    client.delete("/api/recordings/jump").raise_for_status()
    client.delete("/api/trash").raise_for_status()
    assert list(log.parent.rglob("*voice*")) == []


def test_what_is_no_spoken_note_is_refused(client: httpx.Client, log: Path) -> None:
    refused(speak(client, 1, b"RIFF"), 422)
    refused(speak(client, 1, b""), 422)
    refused(speak(client, 1, WEBM + bytes(VOICE_BYTES_MAX)), 413)
    refused(speak(client, 0, WEBM), 422)
    refused(client.post(VOICES, params={"pulse": 1}, json={}), 415)
    refused(client.post("/api/recordings/nobody/voice-notes", params={"pulse": 1}, content=WEBM, headers=SOUND), 404)
    refused(client.post("/api/arm", content=WEBM, headers=SOUND), 415)
    for pulse in range(1, VOICES_MAX + 1):
        assert speak(client, pulse, WEBM).status_code == 201
    refused(speak(client, 1, WEBM), 409)
    elsewhere = log.with_name("elsewhere")
    log.with_suffix(".voice").rename(elsewhere)
    log.with_suffix(".voice").symlink_to(elsewhere)
    assert client.get(VOICES).json() == []
    refused(speak(client, 1, WEBM), 422)
