"""Server-sent events: status, log, recordings; going on where one was."""

import contextlib
import json
from collections.abc import Iterator

import httpx

from tests.support.waiting import wait_until
from tests.webpanel.memory_service import MemoryService, write_recording
from tests.webpanel.serving import Panel, refused


class Stream:
    """Reads one event stream."""

    def __init__(self, answer: httpx.Response) -> None:
        self.answer = answer
        self._lines = answer.iter_lines()

    def message(self) -> dict[str, str]:
        """The next message: its fields by name."""
        fields: dict[str, str] = {}
        for line in self._lines:
            if not line and fields:
                return fields
            if line and not line.startswith(":"):
                name, _, text = line.partition(": ")
                fields[name] = text
        raise AssertionError("the stream ended")

    def next(self, kind: str) -> dict[str, str]:
        """The next message of this kind."""
        while (message := self.message())["event"] != kind:
            pass
        return message


@contextlib.contextmanager
def watch(panel: Panel, query: str = "", **headers: str) -> Iterator[Stream]:
    """An open stream."""
    with panel.client() as client, client.stream("GET", f"/api/events{query}", headers=headers) as answer:
        yield Stream(answer)


def test_status_comes_at_once_and_when_it_changes(panel: Panel, service: MemoryService) -> None:
    with watch(panel) as stream:
        assert stream.answer.headers["content-type"].startswith("text/event-stream")
        assert stream.answer.headers["cache-control"].startswith("no-")
        first = stream.message()
        assert first["event"] == "status"
        assert json.loads(first["data"])["state"] == "idle"
        service.arm()
        wait_until(lambda: json.loads(stream.next("status")["data"])["state"] == "armed", "the change is told")


def test_status_comes_without_a_change_too(panel: Panel) -> None:
    with watch(panel) as stream:
        for _ in range(3):
            assert stream.message()["event"] == "status"


def test_the_log_goes_on_where_it_was(panel: Panel, service: MemoryService) -> None:
    for number in range(5):
        service.say(f"before {number}")
    with watch(panel) as stream:
        messages = [stream.next("log") for _ in range(5)]
        assert [json.loads(message["data"])["message"] for message in messages] == [f"before {n}" for n in range(5)]
    service.say("meanwhile")
    with watch(panel, **{"Last-Event-ID": messages[3]["id"]}) as stream:
        texts = [json.loads(stream.next("log")["data"])["message"] for _ in range(2)]
    assert texts == ["before 4", "meanwhile"]
    with watch(panel, "?after=5") as stream:
        assert json.loads(stream.next("log")["data"])["message"] == "meanwhile"


FOREIGN_IDS = ["0badrun0-4", "nonsense", "-", "4", "x" * 90]


def test_numbers_of_another_run_mean_nothing(panel: Panel, service: MemoryService) -> None:
    for last in FOREIGN_IDS:
        service.say("first")
        with watch(panel, **{"Last-Event-ID": last}) as stream:
            assert json.loads(stream.next("log")["data"])["message"] == "first"


def test_recordings_are_told_to_have_changed(panel: Panel, service: MemoryService) -> None:
    write_recording(service.catalogue.directory, "jump")
    with watch(panel) as stream, panel.client() as client:
        stream.next("status")
        for method, path, body in (("PATCH", "", {"bib": "1"}), ("DELETE", "", None), ("POST", "/restore", None)):
            assert client.request(method, f"/api/recordings/jump{path}", json=body).status_code == 200
            assert json.loads(stream.next("recordings")["data"]) == {}
        client.post("/api/arm")
        client.post("/api/recordings", json={"duration_s": 0})
        stream.next("recordings")


def test_no_line_of_an_event_breaks_out(panel: Panel, service: MemoryService) -> None:
    service.say("one\ndata: two\r\n\r\nevent: status\u2028")
    with watch(panel) as stream:
        assert json.loads(stream.next("log")["data"])["message"] == "one\ndata: two\r\n\r\nevent: status\u2028"


def test_wrong_parameters(client: httpx.Client) -> None:
    refused(client.get("/api/events?after=-1"), 422)
    refused(client.get("/api/events?before=1"), 422)


def test_streams_are_limited_and_given_back(panel: Panel, service: MemoryService) -> None:
    with contextlib.ExitStack() as viewers:
        client = viewers.enter_context(panel.client(limits=httpx.Limits(max_connections=100)))
        for _ in range(64):
            assert viewers.enter_context(client.stream("GET", "/api/events")).status_code == 200
        assert refused(client.get("/api/events"), 503).code == "too_many_viewers"
    with panel.client() as client:
        wait_until(lambda: _answers(client), "there is room again")
    wait_until(lambda: not panel.server.server_state.tasks, "nothing is left of the streams")


def _answers(client: httpx.Client) -> bool:
    with client.stream("GET", "/api/events") as answer:
        return answer.status_code == 200
