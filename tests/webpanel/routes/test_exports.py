"""Exports over the API, made by the real program: asked for, looked at, fetched, given up; never beside a recording."""

import io
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import av
import httpx
import numpy as np
import pytest

from recorder.reading.triplets import triplets
from rig.api.export import ExportOrder, ExportState
from rig.api.status import State
from service.exports.jobs import FOLDER, Exports
from tests.recorder.logs import ALL_OK, LOST, OK
from tests.support.waiting import wait_until
from tests.webpanel.memory_service import MemoryService, write_recording
from tests.webpanel.serving import refused

PULSES = 12
ASK = "/api/recordings/jump/exports"


@pytest.fixture(autouse=True)
def log(service: MemoryService) -> Iterator[Path]:
    """A recording with the id `jump`; at the end nothing goes on."""
    folder = service.catalogue.directory
    yield write_recording(folder, "jump", ((OK, LOST, OK), *(ALL_OK,) * (PULSES - 1)), {"bib": "17", "athlete": "Åse"})
    service.exports.close()


def _until(client: httpx.Client, job: dict[str, Any], *states: str) -> dict[str, Any]:
    """The export as soon as it is in one of these states."""
    found: dict[str, Any] = {}

    def there() -> bool:
        found.update(client.get(f"/api/exports/{job['id']}").json())
        return found["state"] in states

    wait_until(there, f"the export is {' or '.join(states)}", 60)
    return found


def _asked(client: httpx.Client, **order: Any) -> dict[str, Any]:
    answer = client.post(ASK, json=order)
    assert answer.status_code == 202, answer.text
    job: dict[str, Any] = answer.json()
    return job


def test_a_video_without_loss_is_made_and_fetched(client: httpx.Client, log: Path, tmp_path: Path) -> None:
    job = _until(client, _asked(client, kind="ffv1"), "done", "failed")
    assert (job["problem"], job["done"], job["pulses"]) == (None, PULSES, PULSES)
    answer = client.get(f"/api/exports/{job['id']}/file")
    assert len(answer.content) == job["bytes"]
    assert answer.headers["content-disposition"].startswith('attachment; filename="17_Ase_jump.mkv"')
    (tmp_path / "jump.mkv").write_bytes(answer.content)
    with av.open(str(tmp_path / "jump.mkv")) as video:
        pictures = [frame.to_ndarray(format="gray") for frame in video.decode(video=0)]
    np.testing.assert_array_equal(pictures, [image.copy() for _, image in triplets(log)])
    part = client.get(f"/api/exports/{job['id']}/file", headers={"Range": "bytes=10-19"})
    assert (part.status_code, part.content) == (206, answer.content[10:20])


def test_pictures_come_as_an_archive_and_leave_nothing_else(client: httpx.Client, service: MemoryService) -> None:
    job = _until(client, _asked(client, kind="png", cameras=["K2"], last=3), "done", "failed")
    content = client.get(f"/api/exports/{job['id']}/file").content
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        assert archive.testzip() is None
        assert sorted(Path(name).name for name in archive.namelist()) == ["K2_000002.png", "K2_000003.png", "tags.csv"]
    folder = service.catalogue.directory / FOLDER / job["id"]
    assert [file.name for file in folder.rglob("*") if file.is_file()] == [job["name"]]
    assert client.delete(f"/api/exports/{job['id']}").status_code == 200
    assert not folder.exists()
    assert refused(client.get(f"/api/exports/{job['id']}"), 404).code == "unknown_export"


def test_exports_wait_while_a_recording_runs(client: httpx.Client, service: MemoryService) -> None:
    service.arm()
    client.post("/api/recordings", json={})
    assert service.state is State.RECORDING
    first, second = _asked(client, kind="csv"), _asked(client, kind="h264")
    assert refused(client.get(f"/api/exports/{first['id']}/file"), 409).code == "state_forbids"
    assert {job["state"] for job in client.get("/api/exports").json()} == {"waiting"}
    assert client.delete(f"/api/exports/{second['id']}").status_code == 200
    service.state = State.ARMED
    assert _until(client, first, "done", "failed")["state"] == "done"
    assert [job["id"] for job in client.get("/api/exports").json()] == [first["id"]]


def test_a_running_export_stands_still_for_a_recording_and_can_be_given_up(tmp_path: Path) -> None:
    log = write_recording(tmp_path, "long", (ALL_OK,) * 600)
    busy = [False]
    exports = Exports(tmp_path, lambda: busy[0], lambda: 1e12)
    job = exports.start("long", log, "long", ExportOrder(burn_in=True))
    wait_until(lambda: exports.job(job.id).done > 0, "the export is under way", 60)
    busy[0] = True
    wait_until(lambda: exports.job(job.id).state is ExportState.PAUSED, "it stands still")
    exports.remove(job.id)
    wait_until(lambda: not (tmp_path / FOLDER / job.id).exists(), "it is given up")
    exports.close()


def test_what_fails_says_why_and_the_next_goes_on(client: httpx.Client) -> None:
    bad, good = _asked(client, cameras=["K9"]), _asked(client, kind="csv")
    assert "has no camera K9; choose among K1, K2, K3" in _until(client, bad, "done", "failed")["problem"]["text"]
    assert _until(client, good, "done", "failed")["state"] == "done"
    turned = _until(client, _asked(client, first=5, last=4), "done", "failed")
    assert turned["problem"]["text"].endswith("jump.mcap: first pulse 5, last pulse 4: that is none; exchange them")
    assert refused(client.post(ASK, json={"slow": 11}), 422).code == "invalid_request"
    assert refused(client.post("/api/recordings/nobody/exports", json={}), 404).code == "unknown_recording"


def test_room_is_kept_for_recordings(tmp_path: Path) -> None:
    log = write_recording(tmp_path, "small", (ALL_OK,) * 4)
    room = [1e12]
    exports = Exports(tmp_path, lambda: False, lambda: room[0])
    job = exports.start("small", log, "small", ExportOrder.model_validate({"kind": "csv"}))
    wait_until(lambda: exports.job(job.id).state is ExportState.DONE, "the export is done", 60)
    room[0] = -1.0
    exports.tidy()
    assert exports.jobs() == []
    assert list((tmp_path / FOLDER).iterdir()) == []
    exports.close()
