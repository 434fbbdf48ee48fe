"""What was measured in a recording, over the API: figures, files, the order to measure it, and its refusals."""

import io
import json
import zipfile
from datetime import UTC, datetime
from pathlib import Path

import httpx
import pytest

from recorder.log.beside import jumper_path
from rig.api.jump import LastJump
from rig.api.statement import Statement
from rig.settings.model import AnalysisSettings
from service.measuring.keeping import keep_problem, keep_result
from service.measuring.results import measurement_of
from service.recordings.download import digitized_downloads
from tests.webpanel.memory_service import MemoryService, write_recording
from tests.webpanel.serving import refused

PATH = "/api/recordings/jump/measurement"
JUMPS = [{"number": 1, "pulses": [{"pulse": 94, "points": {"P1": None}, "height": {"value": 1.25, "sigma": 0.006}}]}]
JUMPER = json.dumps({"format": "svev-jumper/1", "jumps": JUMPS})
PAGE = "<!doctype html><script>1</script>"


@pytest.fixture(autouse=True)
def log(service: MemoryService) -> Path:
    """A recording with the id `jump`."""
    return write_recording(service.catalogue.directory, "jump")


def _jump(verdict: str) -> LastJump:
    return LastJump(recording="jump", jump=1, time=datetime(2026, 2, 14, tzinfo=UTC), ok=True, verdict=verdict)


def _measured(log: Path) -> None:
    made = log.parent / "made"
    made.mkdir()
    for name, text in {
        "report.html": PAGE,
        "jumper.csv": "a,b\n",
        "jumper.c3d": "C3D",
        "overlay.mp4": "film",
        "jumper.json": JUMPER,
    }.items():
        (made / name).write_text(text)
    keep_result(made, log, (_jump("measured well"),))


def test_live_figures_are_given_until_the_log_is_measured(client: httpx.Client, log: Path) -> None:
    before = client.get(PATH).json()
    assert (before["state"], before["jumps"], before["figures"], before["live"]) == ("none", [], [], False)
    jumper_path(log).write_text(f'{{"summaries": [{_jump("seen live").model_dump_json()}]}}')
    live = client.get(PATH).json()
    assert (live["state"], live["live"], live["figures"][0]["verdict"]) == ("none", True, "seen live")
    _measured(log)
    done = client.get(PATH).json()
    assert (done["state"], done["live"], done["figures"][0]["verdict"]) == ("done", False, "measured well")
    assert done["files"] == ["jumper.c3d", "jumper.csv", "jumper.json", "overlay.mp4", "report.html"]


def test_jumps_stand_in_the_answer_as_in_the_file_of_the_result(client: httpx.Client, log: Path) -> None:
    _measured(log)
    assert client.get(PATH).json()["jumps"] == JUMPS
    assert client.get(f"{PATH}?jumps=false").json()["jumps"] is None
    keep_problem(log, Statement(code="", text="no balls"))
    failed = client.get(PATH).json()
    assert (failed["state"], failed["jumps"]) == ("failed", JUMPS)
    (log.with_suffix(".measured") / "jumper.json").write_text("[]")
    assert "measure it again" in refused(client.get(PATH), 409).detail


def test_a_page_among_the_files_reaches_nothing_of_the_panel(client: httpx.Client, log: Path) -> None:
    _measured(log)
    assert client.get(f"{PATH}/files/overlay.mp4").headers["content-type"] == "video/mp4"
    page = client.get(f"{PATH}/files/report.html")
    assert page.text == PAGE
    assert page.headers["content-type"].startswith("text/html")
    assert page.headers["content-security-policy"].startswith("sandbox allow-scripts")
    assert "allow-same-origin" not in page.headers["content-security-policy"]
    table = client.get(f"{PATH}/files/jumper.csv")
    assert "attachment" in table.headers["content-disposition"]
    assert "jump-jumper.csv" in table.headers["content-disposition"]
    (log.with_suffix(".measured") / "kinogram.jpg").write_bytes(b"\xff\xd8")
    picture = client.get(f"{PATH}/files/kinogram.jpg")
    assert picture.headers["content-type"] == "image/jpeg"
    assert "content-disposition" not in picture.headers


@pytest.mark.parametrize("name", ["measurement.json", "nothing.html", "..%2F..%2Fjump.mcap", "link.html"])
def test_nothing_but_the_files_of_the_result_is_given(client: httpx.Client, log: Path, name: str) -> None:
    _measured(log)
    (log.with_suffix(".measured") / "link.html").symlink_to("/etc/passwd")
    answer = client.get(f"{PATH}/files/{name}")
    assert answer.status_code in {404, 422}, answer.text


def test_who_asks_waits_his_turn_and_may_give_up(client: httpx.Client, service: MemoryService) -> None:
    problem = refused(client.post(PATH), 409)
    assert (problem.code, "give the rig file an [analysis]" in problem.detail) == ("no_analysis", True)
    assert client.get(PATH).json()["refused"]["code"] == "no_analysis"
    service.settings = service.settings.model_copy(update={"analysis": AnalysisSettings(survey=Path("balls.json"))})
    write_recording(service.catalogue.directory, "other")
    first, second = client.post(PATH), client.post(PATH.replace("jump", "other"))
    assert (first.status_code, first.json()["state"]) == (202, "waiting")
    assert second.json()["before"] == 1
    assert client.get("/api/status").json()["measuring"]["waiting"] == 2
    assert client.delete(PATH).json()["state"] == "none"
    assert client.get(PATH.replace("jump", "other")).json()["before"] == 0
    assert client.delete("/api/recordings/jump").status_code == 200
    assert "restore it" in refused(client.post(PATH), 409).detail
    assert refused(client.get(PATH.replace("jump", "nobody")), 404).code == "unknown_recording"


def test_the_archive_has_what_was_measured_by_hand_also_while_somebody_goes_on_with_it(
    client: httpx.Client, log: Path
) -> None:
    base = "/api/recordings/jump/digitizing"
    pulse = client.get(base).json()["pulses"][0]
    action = {"do": "place", "pulse": pulse, "camera": "K1", "thing": "P1", "xy": [1.5, 2.5]}
    assert client.post(f"{base}/sessions/Anna/actions", json=action).status_code == 200
    folder = log.with_suffix(".digitized")
    (folder / "Anna.result").mkdir()
    (folder / "Anna.result" / "report.html").write_text(PAGE)
    (folder / ".Anna.result.1").mkdir()
    (folder / ".Anna.result.1" / "report.html").write_text("half made")
    size = len((folder / "Anna.jsonl").read_bytes())
    taken = digitized_downloads(log, "jump.mcap")
    assert [each.name for each in taken] == ["jump.digitized/Anna.jsonl", "jump.digitized/Anna.result/report.html"]
    assert client.post(f"{base}/sessions/Anna/actions", json=action | {"thing": "P2"}).status_code == 200
    with taken[0].open() as file:
        assert len(file.read()) == size
    answer = client.get("/api/recordings.zip?ids=jump")
    assert int(answer.headers["content-length"]) == len(answer.content)
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        assert b'"P2"' in archive.read("jump.digitized/Anna.jsonl")
        assert archive.read("jump.digitized/Anna.result/report.html").decode() == PAGE


def test_the_archive_has_the_result_where_a_folder_of_recordings_has_it(client: httpx.Client, log: Path) -> None:
    _measured(log)
    answer = client.get("/api/recordings.zip?ids=jump")
    assert int(answer.headers["content-length"]) == len(answer.content)
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        assert archive.read("jump.measured/report.html").decode() == PAGE
        archive.extractall(log.parent / "elsewhere")
    elsewhere = log.parent / "elsewhere" / "jump.mcap"
    assert measurement_of("jump", elsewhere).figures == (_jump("measured well"),)
