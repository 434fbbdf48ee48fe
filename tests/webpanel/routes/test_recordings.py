"""Start, stop, list, change, delete and restore recordings, over a real socket."""

from concurrent.futures import ThreadPoolExecutor

import httpx
import pytest
from mcap.writer import Writer

from rig.errors import StorageError, SvevError
from rig.frame import FrameStatus
from tests.recorder.catalogue.bad_files import GOOD, write_bad_files
from tests.recorder.logs import ALL_OK
from tests.webpanel.memory_service import MemoryService, write_recording
from tests.webpanel.serving import Panel, refused

SESSION = {
    "athlete": "Anna Bjørge",
    "bib": "17",
    "gate": "12",
    "wind": "0.8 m/s",
    "notes": "new\nboots",
    "operator": "",
}


def test_a_recording_is_started_and_stopped(client: httpx.Client) -> None:
    assert client.post("/api/arm").json()["state"] == "armed"
    started = client.post("/api/recordings", json=SESSION)
    assert started.status_code == 201
    recording = started.json()
    assert started.headers["location"] == f"/api/recordings/{recording['id']}"
    assert client.get(started.headers["location"]).json() == recording
    assert recording["session"] == SESSION
    assert client.get("/api/status").json()["state"] == "recording"
    stopped = client.post(f"/api/recordings/{recording['id']}/stop")
    assert stopped.status_code == 200
    assert stopped.json()["state"] == "finished"
    assert stopped.json()["verdict"]["code"] == "verdict_complete"
    assert client.post(f"/api/recordings/{recording['id']}/stop").json() == stopped.json()
    assert client.get("/api/recordings").json() == [stopped.json()]


def test_what_has_just_happened_is_saved(client: httpx.Client) -> None:
    client.post("/api/arm", json={})
    saved = client.post("/api/recordings", json={"preroll_s": 5, "duration_s": 0})
    assert saved.status_code == 201
    assert saved.json()["state"] == "finished"


def test_a_recording_needs_no_fields(client: httpx.Client) -> None:
    client.post("/api/arm")
    assert client.post("/api/recordings").status_code == 201


def test_the_recording_in_progress_is_listed_as_such(client: httpx.Client, service: MemoryService) -> None:
    client.post("/api/arm")
    recording = client.post("/api/recordings").json()
    write_recording(service.catalogue.directory, recording["id"])
    assert [each["state"] for each in client.get("/api/recordings").json()] == ["recording"]


def test_the_state_forbids_with_what_to_do(client: httpx.Client) -> None:
    assert "arm" in refused(client.post("/api/recordings", json={}), 409).detail
    client.post("/api/arm")
    recording = client.post("/api/recordings", json={}).json()
    assert "stop it first" in refused(client.post("/api/recordings", json={}), 409).detail
    assert "stop it first" in refused(client.post("/api/disarm"), 409).detail
    assert "stop it first" in refused(client.delete(f"/api/recordings/{recording['id']}"), 409).detail


def test_of_many_operators_one_starts(panel: Panel, client: httpx.Client) -> None:
    client.post("/api/arm")
    with ThreadPoolExecutor(8) as pool:
        answers = list(pool.map(lambda _: httpx.post(f"{panel.url}/api/recordings", json={}, timeout=20), range(8)))
    assert sorted(answer.status_code for answer in answers) == [201, *[409] * 7]


def test_an_unknown_recording(client: httpx.Client) -> None:
    for path in ("", "/file", "/pulses", "/pulses/1.jpg", "/thumbnail.jpg"):
        assert refused(client.get(f"/api/recordings/nobody{path}"), 404).code == "unknown_recording"
    refused(client.post("/api/recordings/nobody/stop"), 404)
    refused(client.post("/api/recordings/nobody/restore"), 404)
    refused(client.patch("/api/recordings/nobody", json={"bib": "1"}), 404)
    refused(client.delete("/api/recordings/nobody"), 404)


BAD_FIELDS = [
    {"speed": 1},
    {"preroll_s": -1},
    {"preroll_s": "five"},
    {"duration_s": 1e9},
    {"bib": "x" * 201},
    {"athlete": "a\r\nSet-Cookie: x=1"},
    {"athlete": ["a"]},
    [],
    "text",
]


def test_unknown_and_malformed_fields_are_refused(client: httpx.Client) -> None:
    for fields in BAD_FIELDS:
        client.post("/api/arm")
        problem = refused(client.post("/api/recordings", json=fields), 422)
        assert problem.errors[0].where.startswith("body")
        assert client.get("/api/status").json()["state"] == "armed"


NO_JSON = [b"{", b"nan", b'{"duration_s": NaN}', b"\xff", b'{"bib": "1"', b"[" * 10_000]


def test_what_is_no_json_is_refused(client: httpx.Client) -> None:
    for body in NO_JSON:
        client.post("/api/arm")
        refused(client.post("/api/recordings", content=body, headers={"Content-Type": "application/json"}), 422)


def test_calls_without_fields_take_none(client: httpx.Client) -> None:
    for path in ("/api/arm", "/api/disarm", "/api/recordings/x/stop", "/api/recordings/x/restore", "/api/logout"):
        refused(client.post(path, json={"force": True}), 422)


BAD_QUERIES = [
    "deleted=perhaps",
    "deleted=",
    "limit=0",
    "limit=1001",
    "offset=-1",
    "sort=fastest",
    "verdict=excellent",
    "since=yesterday",
    "since=2026-11-20T10:00:00",
    "until=0.5",
    "favourite=perhaps",
    "page=3",
    "deleted=1&deleted=0",
    "=",
    "deleted=1&%00=1",
]


def test_unknown_and_malformed_parameters_are_refused(client: httpx.Client) -> None:
    for query in BAD_QUERIES:
        refused(client.get(f"/api/recordings?{query}"), 422)


def test_session_fields_are_changed_later(client: httpx.Client, service: MemoryService) -> None:
    log = write_recording(service.catalogue.directory, "jump", session={"athlete": "Anna", "bib": "17"})
    before = log.read_bytes()
    changed = client.patch("/api/recordings/jump", json={"bib": "18", "notes": "fell"}).json()
    assert (changed["session"]["athlete"], changed["session"]["bib"], changed["session"]["notes"]) == (
        "Anna",
        "18",
        "fell",
    )
    assert client.get("/api/recordings/jump").json() == changed
    assert log.read_bytes() == before
    refused(client.patch("/api/recordings/jump", json={"id": "other"}), 422)


def _ids(client: httpx.Client, query: str) -> list[str]:
    return [each["id"] for each in client.get(f"/api/recordings?{query}").raise_for_status().json()]


@pytest.fixture
def found(service: MemoryService, client: httpx.Client) -> None:
    """Five recordings, the last of them the newest."""
    lost = (FrameStatus.LOST, *ALL_OK[1:])
    for ago_s, (name, athlete, bib, pulses) in enumerate([
        ("e", "ole berg", "9", 2), ("d", "Anna Lie", "A1", 2), ("c", "", "", 3), ("b", "Bjørn Ødegård", "9", 5),
        ("a", "Anna Berg", "10", 2),
    ]):  # fmt: skip
        statuses = (lost, *(ALL_OK,) * pulses) if name == "b" else (ALL_OK,) * pulses
        write_recording(service.catalogue.directory, name, statuses, {"athlete": athlete, "bib": bib}, ago_s)
    client.patch("/api/recordings/c", json={"tags": ["fall", "new boots"], "favourite": True}).raise_for_status()
    client.patch("/api/recordings/d", json={"tags": ["Fall"], "notes": "long one"}).raise_for_status()


@pytest.mark.usefixtures("found")
def test_recordings_are_found_and_sorted(client: httpx.Client) -> None:
    since = client.get("/api/recordings/c").json()["started"]
    for query, ids in {
        "": "edcba", "search=berg": "ea", "search=anna%20LIE": "d", "search=ødegård%209": "b", "search=boots": "c",
        "search=long": "d", "search=nobody": "", "athlete=berg": "ea", "bib=9": "eb", "bib=1": "", "bib=a1": "d",
        "tag=fall": "dc", "tag=boots": "", "favourite=true": "c", "favourite=false": "edba", "verdict=warning": "b",
        "verdict=good&athlete=anna": "da", f"since={since}": "edc", f"until={since}": "ba",
        "sort=oldest": "abcde", "sort=bib": "ebadc", "sort=athlete": "adbec", "sort=longest": "bceda",
        "deleted=true": "",
    }.items():  # fmt: skip
        assert "".join(_ids(client, query)) == ids, query


@pytest.mark.usefixtures("found")
def test_a_list_comes_page_by_page_and_compressed(client: httpx.Client) -> None:
    whole = client.get("/api/recordings", headers={"Accept-Encoding": "identity"})
    assert "content-encoding" not in whole.headers
    assert (whole.headers["x-total-count"], whole.links) == ("5", {})
    pages, address = [], "/api/recordings?sort=oldest&limit=2"
    while address:
        answer = client.get(address)
        assert answer.headers["content-encoding"] == "gzip"
        assert answer.headers["x-total-count"] == "5"
        pages.append([each["id"] for each in answer.json()])
        address = answer.links.get("next", {}).get("url", "")
    assert pages == [["a", "b"], ["c", "d"], ["e"]]
    assert client.get("/api/recordings?limit=5").links == {}
    assert client.get("/api/recordings?offset=9").json() == []
    assert client.get("/api/recordings?offset=2").json() == whole.json()[2:]


def test_marks_are_kept_beside_the_log(client: httpx.Client, service: MemoryService) -> None:
    write_recording(service.catalogue.directory, "jump")
    marked = client.patch("/api/recordings/jump", json={"tags": ["fall", "fall", "K2"], "favourite": True}).json()
    assert (marked["tags"], marked["favourite"]) == (["fall", "K2"], True)
    assert marked["session"].keys() == SESSION.keys()
    plain = client.patch("/api/recordings/jump", json={"tags": [], "favourite": False}).json()
    assert (plain["tags"], plain["favourite"]) == ([], False)
    for wrong in (["a,b"], [""], ["x" * 41], ["x"] * 21, "fall"):
        refused(client.patch("/api/recordings/jump", json={"tags": wrong}), 422)


def test_a_recording_is_deleted_and_restored(client: httpx.Client, service: MemoryService) -> None:
    write_recording(service.catalogue.directory, "jump")
    deleted = client.delete("/api/recordings/jump")
    assert deleted.status_code == 200
    assert deleted.json()["deleted"]
    assert client.get("/api/recordings").json() == []
    assert client.get("/api/recordings?deleted=true").json() == [deleted.json()]
    assert client.delete("/api/recordings/jump").json() == deleted.json()
    assert not client.post("/api/recordings/jump/restore").json()["deleted"]
    assert [each["id"] for each in client.get("/api/recordings").json()] == ["jump"]


def test_the_trash_is_looked_at_and_emptied(client: httpx.Client, service: MemoryService) -> None:
    for name in ("one", "two", "three"):
        write_recording(service.catalogue.directory, name)
    assert client.get("/api/trash").json() == {"recordings": 0, "bytes": 0}
    assert refused(client.delete("/api/trash/one"), 409).code == "state_forbids"
    refused(client.delete("/api/trash/nobody"), 404)
    for name in ("one", "two"):
        client.delete(f"/api/recordings/{name}")
    full = client.get("/api/trash").json()
    assert full["recordings"] == 2
    one = client.delete("/api/trash/one").raise_for_status().json()
    assert one["recordings"] == 1
    assert abs(one["bytes"] - full["bytes"] // 2) <= 4096, "files of one size may take a block more"
    assert client.delete("/api/trash").json() == {"recordings": 1, "bytes": full["bytes"] - one["bytes"]}
    assert client.get("/api/recordings?deleted=true").json() == []
    assert [each["id"] for each in client.get("/api/recordings").json()] == ["three"]


def test_a_foreign_log_is_moved_and_answered_for(client: httpx.Client, service: MemoryService) -> None:
    folder = service.catalogue.directory
    with (folder / "foreign.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2")
        writer.finish()  # type: ignore[no-untyped-call]
    deleted = client.delete("/api/recordings/foreign")
    assert (deleted.status_code, deleted.json()["deleted"]) == (200, True)
    restored = client.post("/api/recordings/foreign/restore")
    assert (restored.status_code, restored.json()["deleted"]) == (200, False)
    assert "is no log of svev" in restored.json()["verdict"]["text"]
    assert (folder / "foreign.mcap").exists()


def test_a_bad_file_is_a_bad_row(client: httpx.Client, service: MemoryService) -> None:
    bad = write_bad_files(service.catalogue.directory)
    rows = {each["id"]: each for each in client.get("/api/recordings").raise_for_status().json()}
    assert set(rows) == bad | {GOOD}
    assert rows[GOOD]["verdict"]["code"] == "verdict_complete"
    for name in bad:
        assert client.get(f"/api/recordings/{name}").json() == rows[name]
        assert rows[name]["verdict"]["level"] in {"warning", "error"}, rows[name]
        for part in ("/pulses", "/pulses/1.jpg", "/thumbnail.jpg", "/file"):
            with client.stream("GET", f"/api/recordings/{name}{part}") as answer:
                assert answer.status_code in {200, 404, 422, 503}, (name, part)


def test_a_long_field_of_a_log_is_not_repeated_in_every_list(client: httpx.Client, service: MemoryService) -> None:
    write_recording(service.catalogue.directory, "jump", session={"notes": "x" * 100_000})
    assert len(client.get("/api/recordings", headers={"Accept-Encoding": "identity"}).content) < 5000


def test_the_verdict_names_camera_and_cause(client: httpx.Client, service: MemoryService) -> None:
    k2_lost = (FrameStatus.OK, FrameStatus.LOST, FrameStatus.OK)
    write_recording(service.catalogue.directory, "jump", (ALL_OK, k2_lost, ALL_OK, k2_lost))
    recording = client.get("/api/recordings/jump").json()
    assert recording["verdict"]["text"] == "2 of 4 pulses lack a frame: K2 2 lost"
    assert recording["counts"] == {
        "pulses": 4, "complete": 2, "partial": 2, "causes": {"lost": 2, "missed": 0, "damaged": 0, "absent": 0},
    }  # fmt: skip


@pytest.mark.parametrize(
    ("error", "status", "code"),
    [
        (StorageError("the disk is full: delete recordings"), 507, "storage"),
        (SvevError("the recorder does not answer: see the log"), 503, "svev"),
    ],
)
def test_failures_of_the_service_are_problems(
    client: httpx.Client, service: MemoryService, error: SvevError, status: int, code: str
) -> None:
    service.broken = error
    problem = refused(client.get("/api/status"), status)
    assert (problem.code, problem.detail) == (code, str(error))


def test_an_unforeseen_error_tells_nothing_private(client: httpx.Client, service: MemoryService) -> None:
    service.broken = RuntimeError("/home/secret")
    answer = client.get("/api/status")
    assert refused(answer, 500).code == "internal_error"
    assert "secret" not in answer.text
    assert answer.headers["x-content-type-options"] == "nosniff"
    service.broken = None
    assert client.get("/api/status").status_code == 200


WRONG_METHODS = [
    ("PUT", "/api/status", "GET, HEAD"),
    ("POST", "/api/status", "GET, HEAD"),
    ("GET", "/api/arm", "POST"),
    ("DELETE", "/healthz", "GET, HEAD"),
    ("TRACE", "/api/status", "GET, HEAD"),
    ("PUT", "/api/recordings", "GET, HEAD, POST"),
    ("OPTIONS", "/api/recordings/x", "DELETE, GET, HEAD, PATCH"),
    ("POST", "/index.html", "GET, HEAD"),
]


def test_a_wrong_method_says_which_is_right(client: httpx.Client) -> None:
    for method, path, allowed in WRONG_METHODS:
        answer = client.request(method, path)
        refused(answer, 405)
        assert answer.headers["allow"] == allowed, path


NOWHERE = ["/api", "/api/", "/api/nothing", "/api/status/", "/nothing.js", "/api/recordings/"]


def test_nothing_there(client: httpx.Client) -> None:
    for path in NOWHERE:
        refused(client.get(path), 404)
        refused(client.post(path), 404)
