"""Live pictures: one encoding for all who look, an end when nobody does."""

import contextlib
import json
import socket
import threading
from concurrent.futures import ThreadPoolExecutor

import cv2
import httpx
import numpy as np

from tests.support.waiting import wait_until
from tests.webpanel.memory_service import SHAPE, MemoryService
from tests.webpanel.serving import Panel, refused


def pulses_of(panel: Panel, count: int) -> list[tuple[int, bytes]]:
    """The first parts of a stream: pulse and picture."""
    found: list[tuple[int, bytes]] = []
    with panel.client() as client, client.stream("GET", "/api/preview.mjpg") as answer:
        assert answer.headers["content-type"] == "multipart/x-mixed-replace; boundary=svev-triplet"
        received = b""
        for piece in answer.iter_raw():
            received += piece
            parts = received.split(b"--svev-triplet\r\n")
            received = parts[-1]
            for part in parts[1 if not found and not parts[0] else 0 : -1]:
                head, _, body = part.partition(b"\r\n\r\n")
                fields = dict(line.split(": ", 1) for line in head.decode().split("\r\n"))
                jpeg = body[: int(fields["Content-Length"])]
                found.append((int(fields["X-Svev-Pulse"]), jpeg))
            if len(found) >= count:
                return found[:count]
    raise AssertionError("the stream ended")


def decoded(jpeg: bytes) -> tuple[int, ...]:
    """Rows and columns of a picture."""
    image = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_UNCHANGED)
    assert image is not None
    return tuple(image.shape)


def test_no_picture_while_nothing_comes(client: httpx.Client) -> None:
    assert refused(client.get("/api/preview.jpg"), 404).code == "no_preview"


def test_one_picture(client: httpx.Client) -> None:
    client.post("/api/arm")
    answer = client.get("/api/preview.jpg")
    assert answer.headers["content-type"] == "image/jpeg"
    assert answer.headers["x-svev-statuses"] == "ok,ok,ok"
    assert int(answer.headers["x-svev-pulse"]) >= 1
    assert decoded(answer.content) == SHAPE


def test_a_stream_of_new_pictures(panel: Panel, service: MemoryService) -> None:
    service.arm()
    parts = pulses_of(panel, 4)
    pulses = [pulse for pulse, _ in parts]
    assert pulses == sorted(set(pulses))
    assert all(decoded(jpeg) == SHAPE for _, jpeg in parts)


def test_the_next_picture_is_waited_for(client: httpx.Client, service: MemoryService) -> None:
    assert client.get("/api/preview.jpg?after=0").status_code == 204, "no triplet has come"
    service.arm()
    seen = 0
    for _ in range(3):
        answer = client.get(f"/api/preview.jpg?after={seen}")
        assert answer.status_code == 200
        assert int(answer.headers["x-svev-pulse"]) > seen
        seen = int(answer.headers["x-svev-pulse"])
    refused(client.get("/api/preview.jpg?after=-1"), 422)


def test_forty_clients_watch_and_still_command(panel: Panel, service: MemoryService) -> None:
    """Each has a stream of events and asks for pictures; one more reads nothing of its own stream."""
    service.arm()
    watching = threading.Barrier(41)

    def watch(_: int) -> tuple[list[str], int]:
        states, pictures, seen = [], 0, "0"
        with panel.client() as client, client.stream("GET", "/api/events") as answer:
            lines = (json.loads(line[6:]) for line in answer.iter_lines() if line.startswith('data: {"state"'))
            states.append(next(lines)["state"])
            watching.wait(20)
            for _ in range(3):
                picture = client.get(f"/api/preview.jpg?after={seen}")
                pictures += picture.status_code == 200
                seen = picture.headers["x-svev-pulse"]
            states.append(next(state for line in lines if (state := line["state"]) != "armed"))
        return states, pictures

    with ThreadPoolExecutor(40) as pool, panel.connect() as slow, panel.client() as client:
        slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        slow.sendall(b"GET /api/events HTTP/1.1\r\nHost: localhost\r\n\r\n")
        watchers = pool.map(watch, range(40))
        watching.wait(20)
        started = client.post("/api/recordings", json={}).json()
        assert all(each == (["armed", "recording"], 3) for each in watchers)
        assert client.post(f"/api/recordings/{started['id']}/stop").status_code == 200
    wait_until(lambda: not panel.server.server_state.tasks, "nothing is left of them")


def test_many_viewers_share_one_encoding(panel: Panel, service: MemoryService) -> None:
    service.arm()
    with ThreadPoolExecutor(6) as pool:
        streams = list(pool.map(lambda _: pulses_of(panel, 8), range(6)))
    pictures: dict[int, set[bytes]] = {}
    for pulse, jpeg in (part for stream in streams for part in stream):
        pictures.setdefault(pulse, set()).add(jpeg)
    assert all(len(same) == 1 for same in pictures.values())
    assert service.preview_calls < 6 * 8


def test_nobody_asks_the_rig_when_nobody_looks(panel: Panel, service: MemoryService) -> None:
    service.arm()
    pulses_of(panel, 2)
    wait_until(lambda: not panel.server.server_state.tasks, "the stream has ended")
    wait_until(lambda: _settled(service), "nobody asks any more")


def _settled(service: MemoryService) -> bool:
    before = service.preview_calls
    threading.Event().wait(0.3)
    return service.preview_calls == before


def test_streams_are_limited(panel: Panel, service: MemoryService) -> None:
    service.arm()
    with contextlib.ExitStack() as viewers:
        client = viewers.enter_context(panel.client(limits=httpx.Limits(max_connections=100)))
        for _ in range(16):
            assert viewers.enter_context(client.stream("GET", "/api/preview.mjpg")).status_code == 200
        refused_one = client.get("/api/preview.mjpg")
        assert refused(refused_one, 503).code == "too_many_viewers"
        assert client.get("/api/status").status_code == 200
    wait_until(lambda: len(pulses_of(panel, 1)) == 1, "there is room again")
