"""The next jumper and the start list over HTTP."""

import json
from typing import Any

import httpx

from tests.webpanel.memory_service import MemoryService
from tests.webpanel.serving import refused

TABLE = "bib;athlete;gate\n17;Åse Bjørk;12\n18;Berit;\n"
CSV = {"Content-Type": "text/csv"}


def load(client: httpx.Client, content: bytes) -> httpx.Response:
    """Load a start list."""
    return client.put("/api/start-list", content=content, headers=CSV)


def bibs(answer: httpx.Response) -> list[str]:
    """The bibs of a list."""
    answer.raise_for_status()
    return [line["bib"] for line in answer.json()["lines"]]


def test_a_list_is_loaded_changed_and_jumped(client: httpx.Client, service: MemoryService) -> None:
    assert bibs(load(client, TABLE.encode("latin-1"))) == ["17", "18"]
    added = client.post("/api/start-list/lines", json={"bib": "19", "athlete": "Eva"})
    assert (added.status_code, bibs(added)) == (201, ["17", "18", "19"])
    assert bibs(client.patch("/api/start-list/lines/3", json={"place": 1})) == ["19", "17", "18"]
    assert client.post("/api/start-list/lines/2/choose").json()["next"]["session"]["bib"] == "18"
    assert bibs(client.delete("/api/start-list/lines/2")) == ["19", "17"]
    assert client.get("/api/next-jumper").json()["session"]["bib"] == "19"
    assert bibs(client.post("/api/start-list/undo")) == ["19", "17", "18"]
    jumper = client.get("/api/next-jumper").json()
    assert (jumper["session"]["bib"], client.get("/api/status").json()["next_jumper"]) == ("18", jumper)
    for _ in range(2):
        skipped = client.post("/api/next-jumper/skip", json={"number": jumper["number"]}).json()
    assert skipped["next"]["session"]["athlete"] == "Eva"
    changed = client.patch("/api/next-jumper", json={"wind": "calm", "number": skipped["next"]["number"]}).json()
    assert changed["session"]["wind"] == "calm"
    service.arm()
    recording = client.post("/api/recordings", json={"duration_s": 0}).json()
    assert (recording["session"]["athlete"], recording["session"]["wind"]) == ("Eva", "calm")
    client.patch("/api/start-list", json={"auto_advance": False, "carry": ["gate"]}).raise_for_status()
    again = client.post("/api/start-list/round").json()
    assert (again["round"], again["next"]["session"]["wind"], again["carry"]) == (2, "", ["gate"])
    assert bibs(load(client, b"")) == []


def test_what_cannot_be_is_refused_with_what_to_do(client: httpx.Client) -> None:
    load(client, TABLE.encode())
    said = refused(load(client, b"bib;athlete;bib\n1;A;2\n"), 422)
    assert (said.code, 'column "bib" is there twice' in said.detail) == ("bad_input", True)
    assert bibs(client.get("/api/start-list")) == ["17", "18"]
    assert refused(client.patch("/api/next-jumper", json={"number": -1, "bib": "3"}), 409).code == "changed_meanwhile"
    assert refused(client.post("/api/start-list/undo", json={"version": 0}), 409).code == "changed_meanwhile"
    assert refused(client.post("/api/start-list/lines", json={"bib": "17"}), 409).code == "state_forbids"
    assert refused(client.post("/api/start-list/lines/9/choose"), 404).code == "unknown_line"
    assert refused(client.put("/api/start-list", json={}), 415).detail.endswith("Content-Type: text/csv")
    assert refused(client.post("/api/recordings", content=b"x", headers=CSV), 415).code == "unsupported_media_type"
    assert refused(load(client, b"bib\n" + b"x" * 70_000), 413).code == "request_entity_too_large"
    for wrong in ({"line": 1}, {"carry": ["club"]}, {"bib": "a\nb"}):
        refused(client.patch("/api/next-jumper", json=wrong), 422)


def test_everybody_who_watches_sees_the_next_jumper_at_once(client: httpx.Client) -> None:
    with client.stream("GET", "/api/events") as stream:
        lines = (line.removeprefix("data: ") for line in stream.iter_lines() if line.startswith('data: {"state"'))
        seen: list[Any] = [json.loads(next(lines))["next_jumper"]["session"]["bib"]]
        client.patch("/api/next-jumper", json={"bib": "42"}).raise_for_status()
        while seen[-1] != "42" and len(seen) < 10:
            seen.append(json.loads(next(lines))["next_jumper"]["session"]["bib"])
    assert seen[0] == ""
    assert seen[-1] == "42"
