"""The file of a recording, whole and in parts; its pulses and images."""

import base64
import contextlib
import hashlib
import io
import zipfile
from pathlib import Path
from urllib.parse import quote

import cv2
import httpx
import numpy as np
import pytest

from recorder.checking.verify import Verdict, verify
from recorder.reading.info import info
from recorder.reading.parts import parts_of
from recorder.reading.triplets import tags
from rig.frame import FrameStatus
from tests.recorder.logs import ALL_OK, make_image, make_tag
from tests.recorder.split import split_log
from tests.webpanel.memory_service import SHAPE, MemoryService, write_recording
from tests.webpanel.serving import Panel, refused

K2_LOST = (FrameStatus.OK, FrameStatus.LOST, FrameStatus.OK)
NOTHING = (FrameStatus.MISSED,) * 3
FILE = "/api/recordings/jump/file"


@pytest.fixture(autouse=True)
def log(service: MemoryService) -> bytes:
    """A recording with the id `jump`: six pulses."""
    return write_recording(
        service.catalogue.directory, "jump", (ALL_OK, ALL_OK, K2_LOST, NOTHING, ALL_OK, ALL_OK)
    ).read_bytes()


def decoded(answer: httpx.Response) -> np.ndarray:
    """The picture."""
    assert answer.headers["content-type"] == "image/jpeg", answer.text
    image = cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_UNCHANGED)
    assert image is not None
    return np.asarray(image)


def test_the_whole_file(client: httpx.Client, log: bytes) -> None:
    answer = client.get(FILE)
    assert answer.status_code == 200
    assert answer.content == log
    assert answer.headers["content-disposition"] == 'attachment; filename="jump.mcap"'
    assert answer.headers["accept-ranges"] == "bytes"
    assert answer.headers["content-type"] == "application/octet-stream"


def test_the_head_of_the_file(client: httpx.Client, log: bytes) -> None:
    answer = client.head(FILE)
    assert answer.status_code == 200
    assert answer.content == b""
    assert answer.headers["content-length"] == str(len(log))
    assert client.head("/api/recordings/nobody/file").status_code == 404


PARTS = [
    ("0-99", 0, 99),
    ("100-", 100, -1),
    ("-50", -50, -1),
    ("0-0", 0, 0),
    ("10-99999999999", 10, -1),
    ("-99999999999", 0, -1),
]


def test_a_part_of_the_file(client: httpx.Client, log: bytes) -> None:
    for asked, first, last in PARTS:
        start, end = first % len(log), last % len(log) + 1
        answer = client.get(FILE, headers={"Range": f"bytes={asked}"})
        assert answer.status_code == 206, asked
        assert answer.headers["content-range"] == f"bytes {start}-{end - 1}/{len(log)}"
        assert answer.content == log[start:end], asked


def test_several_parts(client: httpx.Client, log: bytes) -> None:
    answer = client.get(FILE, headers={"Range": "bytes=0-9, 100-109"})
    assert answer.status_code == 206
    assert answer.headers["content-type"].startswith("multipart/byteranges")
    assert log[:10] in answer.content
    assert log[100:110] in answer.content


BEYOND = ["bytes=999999999-", "bytes=999999999-1000000000", "bytes=-0"]


def test_beyond_the_end(client: httpx.Client, log: bytes) -> None:
    for asked in BEYOND:
        answer = client.get(FILE, headers={"Range": asked})
        assert refused(answer, 416).code == "range_not_satisfiable"
        assert answer.headers["content-range"] == f"bytes */{len(log)}"


NO_RANGES = [
    "bytes=",
    "bytes=a-b",
    "lines=1-2",
    "bytes=5-2",
    "bytes",
    "bytes=--1",
    "bytes=" + "9" * 5000 + "-",
]


def test_what_is_no_range_gives_the_whole_file(client: httpx.Client, log: bytes) -> None:
    for asked in NO_RANGES:
        answer = client.get(FILE, headers={"Range": asked})
        assert (answer.status_code, answer.content) == (200, log), asked


def test_a_download_is_resumed_only_if_the_file_is_the_same(client: httpx.Client, log: bytes) -> None:
    tag = client.get(FILE).headers["etag"]
    same = client.get(FILE, headers={"Range": "bytes=10-19", "If-Range": tag})
    assert (same.status_code, same.content) == (206, log[10:20])
    other = client.get(FILE, headers={"Range": "bytes=10-19", "If-Range": '"other"'})
    assert (other.status_code, other.content) == (200, log)


def test_what_was_downloaded_is_whole(client: httpx.Client, service: MemoryService) -> None:
    copy = service.catalogue.directory / "copy.mcap"
    copy.write_bytes(client.get(FILE).content)
    assert verify(copy).verdict is Verdict.PARTIAL


def test_the_file_carries_the_corrected_session(client: httpx.Client, service: MemoryService, log: bytes) -> None:
    folder = service.catalogue.directory
    first = client.get(FILE)
    assert first.headers["x-svev-session"] == "as-recorded"
    client.patch("/api/recordings/jump", json={"bib": "17", "athlete": "Bjørn  Ødegård/æ", "notes": "x" * 4000})
    head, answer = client.head(FILE), client.get(FILE)
    assert (answer.status_code, answer.headers["x-svev-session"]) == (200, "corrected")
    assert {**head.headers, "date": ""} == {**answer.headers, "date": ""}
    assert len(answer.content) == int(head.headers["content-length"]) > len(log)
    assert answer.headers["content-disposition"] == (
        'attachment; filename="17_Bjorn-Odegard-ae_jump.mcap"; '
        "filename*=UTF-8''17_Bj%C3%B8rn-%C3%98deg%C3%A5rd-%C3%A6_jump.mcap"
    )
    copy = folder.parent / "copy.mcap"
    copy.write_bytes(answer.content)
    assert verify(copy).verdict is Verdict.PARTIAL
    assert info(copy).session["athlete"] == "Bjørn  Ødegård/æ"
    assert (folder / "jump.mcap").read_bytes() == log

    tag = answer.headers["etag"]
    assert tag != first.headers["etag"]
    parts = b"".join(
        client.get(FILE, headers={"Range": f"bytes={begin}-{begin + 9999}", "If-Range": tag}).content
        for begin in range(0, len(answer.content), 10_000)
    )
    assert parts == answer.content
    client.patch("/api/recordings/jump", json={"bib": "18"})
    again = client.get(FILE, headers={"Range": "bytes=10-19", "If-Range": tag})
    assert again.status_code == 200
    assert 'filename="18_Bjorn' in again.headers["content-disposition"]


def test_the_checksum_is_that_of_the_file_as_it_comes(client: httpx.Client) -> None:
    for change in ({}, {"bib": "5"}):
        client.patch("/api/recordings/jump", json=change)
        assert "repr-digest" not in client.head(FILE).headers
        said = client.get(f"{FILE}.sha256")
        assert said.headers["content-type"].startswith("text/plain")
        content = client.get(FILE)
        digest = hashlib.sha256(content.content)
        assert said.text == f"{digest.hexdigest()}  {'5_' if change else ''}jump.mcap\n"
        assert content.headers["repr-digest"] == f"sha-256=:{base64.b64encode(digest.digest()).decode()}:"


def test_a_split_recording_comes_with_all_its_parts(
    client: httpx.Client, service: MemoryService, tmp_path: Path
) -> None:
    """Each under the corrected name, so that programs find them beside each other."""
    whole = write_recording(tmp_path, "whole", (ALL_OK,) * 9)
    split_log(whole, service.catalogue.directory / "long.mcap", (4, 3))
    client.patch("/api/recordings/long", json={"bib": "17", "athlete": "Åse Lie"})
    answer = client.get("/api/recordings.zip?ids=long")
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        assert len(answer.content) == int(answer.headers["content-length"])
        archive.extractall(tmp_path / "taken")
    logs = [tmp_path / "taken" / f"17_Åse-Lie_long{part}.mcap" for part in ("", "-part2", "-part3")]
    assert [*tags(logs[1])] == [*tags(whole)]
    for log, name in zip(logs, ("long", "long-part2", "long-part3"), strict=True):
        assert parts_of(log) == tuple(logs)
        assert info(log).session["athlete"] == "Åse Lie"
        assert client.get(f"/api/recordings/{name}/file").content == log.read_bytes()


def test_several_recordings_come_as_one_archive(client: httpx.Client, service: MemoryService) -> None:
    write_recording(service.catalogue.directory, "other", session={"bib": "4", "athlete": "Åse Lie"})
    client.patch("/api/recordings/jump", json={"bib": "17"})
    answer = client.get("/api/recordings.zip?ids=jump,other,jump")
    assert (answer.status_code, answer.headers["content-type"]) == (200, "application/zip")
    assert answer.headers["content-disposition"] == 'attachment; filename="svev_2-jumps.zip"'
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        assert archive.testzip() is None
        names = ["17_jump.mcap", "4_Åse-Lie_other.mcap"]
        assert archive.namelist() == [*names, "SHA256SUMS"]
        assert archive.read(names[0]) == client.get(FILE).content
        assert archive.read(names[1]) == (service.catalogue.directory / "other.mcap").read_bytes()
        sums = [f"{hashlib.sha256(archive.read(name)).hexdigest()}  {name}" for name in names]
        assert archive.read("SHA256SUMS").decode().splitlines() == sums
    assert int(answer.headers["content-length"]) == len(answer.content)
    head = client.head("/api/recordings.zip?ids=jump,other").headers
    assert (head["content-type"], head["content-length"]) == ("application/zip", answer.headers["content-length"])
    for missing in ("nobody", "a/b", "%252e%252e", "a%252fb"):
        refused(client.get(f"/api/recordings.zip?ids=jump,{missing}"), 404)
    for wrong in ("", "?ids=", "?ids=jump,", "?ids=jump&ids=other"):
        refused(client.get(f"/api/recordings.zip{wrong}"), 422)


def test_the_recording_in_progress_is_not_handed_out(client: httpx.Client) -> None:
    client.post("/api/arm")
    recording = client.post("/api/recordings").json()["id"]
    for path in (f"/{recording}/file", f"/{recording}/file.sha256", f".zip?ids={recording}"):
        assert "stop it first" in refused(client.get(f"/api/recordings{path}"), 409).detail


def test_downloads_are_limited(panel: Panel, service: MemoryService) -> None:
    write_recording(service.catalogue.directory, "long", (ALL_OK,) * 200)
    with contextlib.ExitStack() as downloads, panel.client(limits=httpx.Limits(max_connections=20)) as client:
        for _ in range(8):
            answer = downloads.enter_context(client.stream("GET", "/api/recordings/long/file"))
            assert answer.status_code == 200
        assert refused(client.get(FILE), 503).code == "too_many_viewers"
        assert client.head(FILE).status_code == 200


def test_deleted_recordings_can_still_be_read(client: httpx.Client, log: bytes) -> None:
    client.delete("/api/recordings/jump")
    assert client.get(FILE).content == log


def test_the_pulses(client: httpx.Client) -> None:
    pulses = client.get("/api/recordings/jump/pulses").json()
    assert pulses["cameras"] == ["K1", "K2", "K3"]
    assert pulses["columns"] == [[0, 160], [160, 320], [320, 480]]
    assert pulses["shape"] == list(SHAPE)
    assert [pulse["pulse"] for pulse in pulses["pulses"]] == [1, 2, 3, 4, 5, 6]
    assert pulses["pulses"][2]["statuses"] == ["ok", "lost", "ok"]
    assert pulses["pulses"][5]["time_s"] == pytest.approx(5 / 30, abs=1e-3)


def test_an_image_is_the_recorded_one(client: httpx.Client) -> None:
    answer = client.get("/api/recordings/jump/pulses/3.jpg")
    image, recorded = decoded(answer).astype(int), make_image(make_tag(3, K2_LOST, SHAPE)).astype(int)
    assert image.shape == SHAPE
    assert np.corrcoef(image.ravel(), recorded.ravel())[0, 1] > 0.9
    assert "immutable" in answer.headers["cache-control"]


def test_one_camera_and_smaller(client: httpx.Client) -> None:
    whole = decoded(client.get("/api/recordings/jump/pulses/2.jpg")).astype(int)
    one = decoded(client.get("/api/recordings/jump/pulses/2.jpg?camera=K2")).astype(int)
    assert one.shape == (120, 160)
    assert np.corrcoef(one.ravel(), whole[:, 160:320].ravel())[0, 1] > 0.9
    assert decoded(client.get("/api/recordings/jump/pulses/2.jpg?width=240")).shape == (60, 240)
    assert decoded(client.get("/api/recordings/jump/pulses/2.jpg?camera=K3&width=80")).shape == (60, 80)
    assert decoded(client.get("/api/recordings/jump/pulses/2.jpg?width=8000")).shape == SHAPE


def test_what_there_is_no_image_of(client: httpx.Client) -> None:
    refused(client.get("/api/recordings/jump/pulses/7.jpg"), 404)
    refused(client.get("/api/recordings/jump/pulses/4.jpg"), 404)
    assert refused(client.get("/api/recordings/jump/pulses/1.jpg?camera=K9"), 404).code == "unknown_camera"
    for wrong in (
        "0.jpg",
        "-1.jpg",
        "x.jpg",
        "1.jpg?width=1",
        "1.jpg?width=99999",
        "1.jpg?height=3",
        "99999999999999999999.jpg",
    ):
        refused(client.get(f"/api/recordings/jump/pulses/{wrong}"), 422)


def test_a_thumbnail(client: httpx.Client, service: MemoryService) -> None:
    assert decoded(client.get("/api/recordings/jump/thumbnail.jpg")).shape == SHAPE
    write_recording(service.catalogue.directory, "dark", (NOTHING, NOTHING))
    assert "no camera delivered" in refused(client.get("/api/recordings/dark/thumbnail.jpg"), 404).detail


def test_a_thumbnail_is_made_once(
    client: httpx.Client, service: MemoryService, monkeypatch: pytest.MonkeyPatch
) -> None:
    looked: list[str] = []
    look = service.liveliest_pulse

    def noted(recording_id: str) -> int:
        looked.append(recording_id)
        return look(recording_id)

    monkeypatch.setattr(service, "liveliest_pulse", noted)
    first = client.get("/api/recordings/jump/thumbnail.jpg")
    assert client.get("/api/recordings/jump/thumbnail.jpg").content == first.content
    write_recording(service.catalogue.directory, "new", (ALL_OK,) * 40)
    (service.catalogue.directory / "new.mcap").replace(service.catalogue.directory / "jump.mcap")
    assert client.get("/api/recordings/jump/thumbnail.jpg").content != first.content
    assert looked == ["jump", "jump"]


def test_a_broken_log_is_a_problem_not_a_crash(client: httpx.Client, service: MemoryService, log: bytes) -> None:
    (service.catalogue.directory / "torn.mcap").write_bytes(log[: len(log) // 2])
    (service.catalogue.directory / "holed.mcap").write_bytes(log[:5000] + bytes(len(log) - 10_000) + log[-5000:])
    states = {each["id"]: each["state"] for each in client.get("/api/recordings").json()}
    assert states["jump"] == "finished"
    assert states["torn"] != "finished"
    assert states["holed"] == "damaged"
    for name in ("torn", "holed"):
        for path in ("", "/pulses", "/pulses/1.jpg", "/thumbnail.jpg", "/file"):
            answer = client.get(f"/api/recordings/{name}{path}")
            assert answer.status_code in {200, 404, 422, 503}, answer.text


@pytest.mark.parametrize("name", ["Åre, 2. omgang", "a+b%2f", "飛躍", "\uff02x", "a#"])
def test_logs_with_any_letters_are_reached_by_their_percent_encoded_names(
    service: MemoryService, client: httpx.Client, log: bytes, name: str
) -> None:
    (service.catalogue.directory / f"{name}.mcap").write_bytes(log)
    assert {each["id"] for each in client.get("/api/recordings").json()} == {"jump", name}
    address = f"/api/recordings/{quote(name, safe='')}"
    assert client.get(address).json()["id"] == name
    answer = client.get(f"{address}/file")
    assert answer.content == log
    assert f"filename*=UTF-8''{quote(name + '.mcap')}" in answer.headers["content-disposition"] or name.isascii()
    assert answer.headers["content-disposition"].count('"') == 2
    together = client.get("/api/recordings.zip", params={"ids": f"jump,{quote(name, safe='')}"})
    with zipfile.ZipFile(io.BytesIO(together.content)) as archive:
        assert archive.namelist() == ["jump.mcap", f"{name}.mcap", "SHA256SUMS"]


def test_a_copy_as_browsers_name_it_is_handed_out(service: MemoryService, client: httpx.Client, log: bytes) -> None:
    (service.catalogue.directory / "jump (1).mcap").write_bytes(log)
    answer = client.get("/api/recordings/jump%20(1)/file")
    assert answer.content == log
    assert answer.headers["content-disposition"] == 'attachment; filename="jump (1).mcap"'
    with zipfile.ZipFile(io.BytesIO(client.get("/api/recordings.zip?ids=jump,jump%20(1)").content)) as archive:
        assert archive.namelist() == ["jump.mcap", "jump (1).mcap", "SHA256SUMS"]
