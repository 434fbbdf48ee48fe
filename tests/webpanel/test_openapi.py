"""The description of the API is complete, and its page shows nothing from elsewhere."""

import json
import re
from collections.abc import Iterator
from typing import Any

import httpx
import pytest

from tests.support.loopback import Loopback
from tests.webpanel.memory_service import MemoryService, write_recording
from tests.webpanel.serving import Panel, serving
from webpanel.door.access import Access

#: The calls of the contract, and those that the page needs beyond it.
CALLS = {
    "GET /api/trigger", "PATCH /api/trigger", "POST /api/trigger/burst",
    "GET /api/parts", "PATCH /api/parts",
    "POST /api/mark", "PUT /api/automatic",
    "GET /api/cameras/{camera}", "PATCH /api/cameras/{camera}",
    "GET /api/cameras/{camera}/aids", "GET /api/cameras/{camera}/balls",
    "GET /api/cameras/{camera}/picture.jpg",
    "GET /api/calibration", "POST /api/calibration", "DELETE /api/calibration",
    "DELETE /api/calibration/pictures/last", "POST /api/calibration/compute", "POST /api/calibration/save",
    "GET /api/calibration/protocol.html",
    "GET /api/rehearsal", "POST /api/rehearsal", "DELETE /api/rehearsal",
    "POST /api/alarms/{number}/acknowledge",
    "GET /api/status", "POST /api/arm", "POST /api/disarm", "GET /api/rig", "GET /api/doctor", "GET /api/events",
    "GET /api/preview.jpg", "GET /api/preview.mjpg", "GET /api/recordings", "POST /api/recordings",
    "GET /api/recordings/{recording_id}", "PATCH /api/recordings/{recording_id}",
    "DELETE /api/recordings/{recording_id}", "POST /api/recordings/{recording_id}/stop",
    "POST /api/recordings/{recording_id}/restore", "GET /api/recordings/{recording_id}/file",
    "GET /api/recordings/{recording_id}/pulses", "GET /api/recordings/{recording_id}/pulses/{pulse}.jpg",
    "GET /api/recordings/{recording_id}/thumbnail.jpg", "POST /api/login", "POST /api/logout", "GET /metrics",
    "GET /api/access", "GET /healthz", "GET /api/trash", "DELETE /api/trash", "DELETE /api/trash/{recording_id}",
    "GET /api/recordings/{recording_id}/file.sha256", "GET /api/recordings.zip",
    "GET /api/next-jumper", "PATCH /api/next-jumper", "POST /api/next-jumper/skip",
    "GET /api/start-list", "PUT /api/start-list", "PATCH /api/start-list", "POST /api/start-list/undo",
    "POST /api/start-list/preview",
    "POST /api/start-list/round", "POST /api/start-list/lines", "PATCH /api/start-list/lines/{line}",
    "GET /api/recordings/{recording_id}/pulses/{pulse}.png", "GET /api/recordings/{recording_id}/moment",
    "GET /api/recordings/{recording_id}/notes", "PUT /api/recordings/{recording_id}/notes/{pulse}",
    "DELETE /api/recordings/{recording_id}/notes/{pulse}",
    "GET /api/recordings/{recording_id}/voice-notes",
    "POST /api/recordings/{recording_id}/voice-notes",
    "GET /api/recordings/{recording_id}/voice-notes/{number}/sound.webm",
    "DELETE /api/recordings/{recording_id}/voice-notes/{number}",
    "POST /api/recordings/{recording_id}/exports", "GET /api/exports", "GET /api/exports/{export_id}",
    "DELETE /api/exports/{export_id}", "GET /api/exports/{export_id}/file",
    "GET /api/recordings/{recording_id}/measurement", "POST /api/recordings/{recording_id}/measurement",
    "DELETE /api/recordings/{recording_id}/measurement",
    "GET /api/recordings/{recording_id}/measurement/files/{name}",
    "GET /api/recordings/{recording_id}/link", "POST /api/login/link",
    "GET /api/recordings/{recording_id}/links", "DELETE /api/recordings/{recording_id}/links/{number}",
    "GET /api/athletes", "GET /api/jumps", "GET /api/jumps/comparison",
    "GET /api/comparison.html",
    "GET /api/recordings/{recording_id}/digitizing", "POST /api/recordings/{recording_id}/digitizing/orientation",
    "GET /api/recordings/{recording_id}/digitizing/frames/{pulse}/{camera}.png",
    "GET /api/recordings/{recording_id}/digitizing/geometry",
    "GET /api/recordings/{recording_id}/digitizing/repeatability",
    "POST /api/recordings/{recording_id}/digitizing/tape",
    "GET /api/recordings/{recording_id}/digitizing/sessions/{operator}",
    "GET /api/recordings/{recording_id}/digitizing/sessions/{operator}/pulses/{pulse}",
    "POST /api/recordings/{recording_id}/digitizing/sessions/{operator}/actions",
    "GET /api/recordings/{recording_id}/digitizing/sessions/{operator}/changes",
    "POST /api/recordings/{recording_id}/digitizing/sessions/{operator}/import",
    "POST /api/recordings/{recording_id}/digitizing/refine",
    "GET /api/recordings/{recording_id}/digitizing/sessions/{operator}/next",
    "POST /api/recordings/{recording_id}/digitizing/sessions/{operator}/track",
    "DELETE /api/recordings/{recording_id}/digitizing/sessions/{operator}/track",
    "GET /api/recordings/{recording_id}/digitizing/sessions/{operator}/track",
    "GET /api/recordings/{recording_id}/digitizing/sessions/{operator}/export/{name}",
    "POST /api/recordings/{recording_id}/digitizing/sessions/{operator}/compute",
    "DELETE /api/recordings/{recording_id}/digitizing/sessions/{operator}/compute",
    "GET /api/recordings/{recording_id}/digitizing/sessions/{operator}/result",
    "GET /api/recordings/{recording_id}/digitizing/sessions/{operator}/curves",
    "GET /api/recordings/{recording_id}/digitizing/sessions/{operator}/result/files/{name}",
    "DELETE /api/start-list/lines/{line}", "POST /api/start-list/lines/{line}/choose",
}  # fmt: skip


@pytest.fixture
def schema(client: httpx.Client) -> dict[str, Any]:
    """The description."""
    found: dict[str, Any] = client.get("/openapi.json").json()
    return found


def operations(schema: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Method and path, description."""
    for path, methods in schema["paths"].items():
        for method, operation in methods.items():
            yield f"{method.upper()} {path}", operation


def test_every_call_is_there(schema: dict[str, Any]) -> None:
    assert {name for name, _ in operations(schema)} == CALLS


def test_every_call_is_explained(schema: dict[str, Any]) -> None:
    names = [operation["operationId"] for _, operation in operations(schema)]
    assert len(set(names)) == len(names)
    for name, operation in operations(schema):
        assert re.fullmatch(r"[a-z_]+", operation["operationId"]), name
        assert operation["description"], name
        assert operation["tags"], name
        for parameter in operation.get("parameters", ()):
            assert parameter.get("description") or parameter["schema"].get("description"), (name, parameter)


def test_every_refusal_is_declared_as_a_problem(schema: dict[str, Any]) -> None:
    for name, operation in operations(schema):
        if not name.partition(" ")[2].startswith("/api/"):
            continue
        statuses = set(operation["responses"])
        assert {"400", "401", "403", "422", "429", "500"} <= statuses, name
        if not name.startswith("GET") and "login" not in name and "logout" not in name:
            assert {"409", "413", "415"} <= statuses, name
        if "{recording_id}" in name or "{line}" in name:
            assert "404" in statuses, name
        for status, response in operation["responses"].items():
            if status >= "400":
                declared = response["content"]["application/problem+json"]
                assert declared["schema"] == {"$ref": "#/components/schemas/Problem"}
                assert declared["example"]["status"] == int(status)
                assert list(response["content"]) == ["application/problem+json"], (name, status)


def test_every_reference_leads_somewhere(schema: dict[str, Any]) -> None:
    for name in re.findall(r'"#/components/schemas/(\w+)"', json.dumps(schema)):
        assert name in schema["components"]["schemas"]
    assert {"Problem", "FieldError", "Status", "Event"} <= set(schema["components"]["schemas"])
    assert "HTTPValidationError" not in schema["components"]["schemas"]


def test_bodies_have_examples(schema: dict[str, Any]) -> None:
    schemas = schema["components"]["schemas"]
    for name in (
        "RecordingOrder",
        "RehearsalOrder",
        "StopOrder",
        "SessionFields",
        "SessionChange",
        "JumperChange",
        "NewLine",
        "LineChange",
        "Rules",
        "Login",
    ):
        assert all(field.get("examples") for field in schemas[name]["properties"].values()), name
        assert schemas[name]["additionalProperties"] is False
    content = schema["paths"]["/api/recordings"]["post"]["requestBody"]["content"]["application/json"]
    assert len(content["examples"]) == 2


def test_the_token_is_described_where_one_is_needed(service: MemoryService, loopback: Loopback) -> None:
    token = "a-token-for-the-tests-only"  # noqa: S105
    access = Access.for_address(loopback.host, environment={"SVEV_TOKEN": token})
    with serving(service, access) as panel, panel.client(headers={"Authorization": f"Bearer {token}"}) as client:
        schema = client.get("/openapi.json").json()
    assert schema["security"] == [{"token": []}, {"session": []}]
    assert set(schema["components"]["securitySchemes"]) == {"token", "session"}
    needed = {name: operation["security"] for name, operation in operations(schema)}
    assert needed["POST /api/login"] == needed["GET /healthz"] == []
    assert needed["GET /api/status"] == [{"token": ["watch"]}, {"session": ["watch"]}]
    assert needed["POST /api/arm"][0] == {"token": ["operate"]}
    assert needed["DELETE /api/recordings/{recording_id}"][0] == {"token": ["administer"]}


def test_chapters_and_server_are_described(schema: dict[str, Any]) -> None:
    used = {tag for _, operation in operations(schema) for tag in operation["tags"]}
    assert {tag["name"] for tag in schema["tags"] if tag["description"]} == used
    assert [server["url"] for server in schema["servers"]] == ["/"]


def test_head_answers_wherever_get_does(panel: Panel, service: MemoryService) -> None:
    service.arm()
    write_recording(service.catalogue.directory, "jump")
    values = {"recording_id": "jump", "pulse": "1", "export_id": "1", "line": "1", "number": "1", "camera": "K1"}
    values |= {"operator": "Anna", "name": "report.html"}
    with panel.client() as client:
        for name, _ in operations(client.get("/openapi.json").json()):
            path = name.partition(" ")[2].format(**values)
            if not name.startswith("GET"):
                continue
            path += "?ids=jump" if path.endswith(".zip") else ""
            head = client.head(path)
            assert head.content == b"", path
            with client.stream("GET", path) as got:
                assert head.status_code == got.status_code, path
                assert head.headers["content-type"] == got.headers["content-type"], path
        wrong = client.head("/api/arm")
        assert (wrong.status_code, wrong.headers["allow"]) == (405, "POST")


def test_the_version_may_be_named(client: httpx.Client) -> None:
    assert client.get("/api/v1/status").json()["state"] == client.get("/api/status").json()["state"]
    assert client.post("/api/v1/arm").json()["state"] == "armed"
    assert client.get("/api/v2/status").status_code == client.get("/api/v1").status_code == 404


def test_the_page_of_the_description_needs_nothing_from_elsewhere(client: httpx.Client) -> None:
    page = client.get("/docs")
    assert page.headers["content-type"].startswith("text/html")
    wanted = re.findall(r'(?:src|href)="([^"]+)"', page.text)
    assert len(wanted) == 4
    for address in wanted:
        assert address.startswith("/docs/")
        answer = client.get(address)
        assert answer.status_code == 200
        assert answer.headers["content-type"].split(";")[0] in {"text/css", "text/javascript", "image/svg+xml"}
    assert "https:" not in page.text + page.headers["content-security-policy"]
