"""The next jumper and the start list over HTTP."""

import json
from typing import Any

import httpx

from tests.service.jumpers.test_workbook import book
from tests.webpanel.memory_service import MemoryService
from tests.webpanel.serving import refused

TABLE = "bib;athlete;gate\n17;Åse Bjørk;12\n18;Berit;\n"
CSV = {"Content-Type": "text/csv"}
XLSX = "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet"


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
    assert refused(client.put("/api/start-list", json={}), 415).detail.startswith(
        "the body must be a table: send Content-Type: text/csv"
    )
    assert refused(client.post("/api/recordings", content=b"x", headers=CSV), 415).code == "unsupported_media_type"
    assert refused(load(client, b"bib\n" + b"x" * 2_000_000), 413).code == "request_entity_too_large"
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


def test_a_list_is_looked_at_before_it_replaces_another(client: httpx.Client) -> None:
    load(client, b"bib;athlete;gate;class\n1;Old;12;J18\n")
    before = client.get("/api/start-list").json()

    def look(content: bytes, **choice: str) -> Any:
        answer = client.post("/api/start-list/preview", content=content, headers=CSV, params=choice)
        assert answer.status_code == 200, answer.text
        return answer.json()

    seen = look(b"Startliste\nStartnr;Navn;Klubb\n" + b"".join(b"%d;A;B\n" % n for n in range(1, 31)))
    assert (seen["jumpers"], len(seen["lines"]), seen["heading"], seen["encoding"]) == (30, 5, 2, "utf-8")
    assert (seen["added"], seen["removed"]) == (["club"], ["gate", "class"])
    letters = "bib;athlete\n1;Anže Lanišek\n".encode("cp1252")
    seen = look(letters)
    choices = {each["encoding"]: each["words"] for each in seen["readings"]}
    assert (seen["encoding"], choices["windows-1252"], choices["mac-roman"]) == (
        None,
        ["Anže Lanišek"],
        ["Anûe Laniöek"],
    )
    assert refused(load(client, letters), 422).detail.startswith("its letters can be read in several ways")
    assert look(letters, encoding="windows-1252")["lines"][0]["athlete"] == "Anže Lanišek"
    workbook = book(("Gutter", [["bib", "athlete"], [1, "Åse"]]), ("Jenter", [["bib", "athlete"], [2, "Eva"]]))
    seen = look(workbook)
    assert (seen["sheets"], seen["lines"]) == (["Gutter", "Jenter"], [])
    assert refused(load(client, b"bib;athlete\n"), 422).detail.startswith("the table is a heading alone")
    assert look(b"bib;athlete\n")["jumpers"] == 0
    assert client.get("/api/start-list").json() == before
    answer = client.put("/api/start-list", content=workbook, headers={"Content-Type": XLSX}, params={"sheet": "Jenter"})
    assert bibs(answer) == ["2"]
    assert client.put("/api/start-list", content=workbook, headers=CSV, params={"encoding": "x"}).status_code == 422


def test_two_thousand_jumpers_are_loaded_and_go_on(client: httpx.Client) -> None:
    table = "bib;athlete;club\n" + "".join(f"{n};Åse Bjørk {n};Lyn\n" for n in range(1, 2001))
    assert len(bibs(load(client, table.encode()))) == 2000
    assert client.post("/api/next-jumper/skip").json()["next"]["session"]["bib"] == "2"
