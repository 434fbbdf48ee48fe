"""All measured jumps by athlete, over the API."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from analysis.measurements.file import write_measurements
from analysis.measurements.model import (
    ImageMeasurements,
    JumpMeasurements,
    MeasuredCamera,
    Measurements,
    PointMeasurement,
    PulseMeasurements,
)
from analysis.result import file as result_file
from recorder.log.beside import jumper_path
from rig.api.jump import LastJump, MeasuredValue
from rig.api.recordings import RecordingOrder
from service.measuring.keeping import keep_result
from tests.analysis.result.recordings import recording
from tests.recorder.logs import ALL_OK
from tests.webpanel.memory_service import MemoryService, write_recording
from tests.webpanel.serving import refused

#: A comparison has the processor time that nobody else wants.
PATIENCE_S = 90.0
NOON = datetime(2026, 2, 14, 12, tzinfo=UTC)


def jump(recording: str, number: int, time: datetime, speed: float, *, ok: bool = True) -> LastJump:
    """Main figures of a jump."""
    return LastJump(
        recording=recording, jump=number, time=time, ok=ok, verdict="measured well" if ok else "not well",
        takeoff_speed=MeasuredValue(value=speed, sigma=0.05),
    )  # fmt: skip


def measure(log: Path, *jumps: LastJump) -> None:
    """Keep a result beside a log."""
    made = log.parent / "made"
    made.mkdir()
    keep_result(made, log, jumps)


@pytest.fixture
def logs(service: MemoryService) -> dict[str, Path]:
    """Recordings with measured jumps: of Ola in three spellings on two days, of Åse, of nobody; one only live."""
    folder = service.catalogue.directory
    names = {
        "a": "Ola Nordmann",
        "b": "OLA  nordmann ",
        "c": "Ola Nordmann",
        "d": "Åse / Ødegård?",
        "e": "",
        "f": "Kari",
    }
    found = {
        name: write_recording(folder, name, session={"athlete": who, "bib": f"{number}"})
        for number, (name, who) in enumerate(names.items(), 1)
    }
    measure(found["a"], jump("a", 1, NOON, 25.0), jump("a", 2, NOON + timedelta(minutes=9), 25.5, ok=False))
    measure(found["b"], jump("b", 1, NOON + timedelta(days=1), 26.0))
    measure(found["d"], jump("d", 1, NOON + timedelta(minutes=3), 24.0))
    measure(found["e"], jump("e", 1, NOON + timedelta(minutes=4), 24.5))
    live = jump("f", 1, NOON + timedelta(minutes=5), 23.0, ok=False).model_dump_json()
    jumper_path(found["f"]).write_text(f'{{"summaries": [{live}]}}')
    return found


def _jumps(client: httpx.Client, **query: Any) -> list[tuple[str, int, str]]:
    found = client.get("/api/jumps", params=query).raise_for_status().json()
    return [(each["jump"]["recording"], each["jump"]["jump"], each["level"]) for each in found]


@pytest.mark.usefixtures("logs")
def test_names_that_differ_in_case_and_spaces_only_are_one_athlete(client: httpx.Client) -> None:
    found = {each["name"]: each for each in client.get("/api/athletes").json()}
    assert list(found) == ["Kari", "OLA nordmann", "Åse / Ødegård?"]
    assert (found["OLA nordmann"]["jumps"], found["OLA nordmann"]["bib"]) == (3, "2")
    assert found["OLA nordmann"]["first"].startswith("2026-02-14T12:00")
    assert found["OLA nordmann"]["last"].startswith("2026-02-15T12:00")
    assert _jumps(client, athlete=" ola nordmann") == [("b", 1, "good"), ("a", 2, "warning"), ("a", 1, "good")]
    assert _jumps(client, athlete="Åse / Ødegård?") == [("d", 1, "good")]
    assert _jumps(client, athlete="A\u030ase / \u00d8dega\u030ard?") == [("d", 1, "good")]
    assert _jumps(client, athlete="Ola") == []


@pytest.mark.usefixtures("logs")
def test_jumps_of_a_span_with_their_figures(client: httpx.Client) -> None:
    day = {"since": "2026-02-14T00:00:00Z", "until": "2026-02-15T00:00:00Z"}
    assert [name for name, *_ in _jumps(client, **day)] == ["a", "f", "e", "d", "a"]
    assert _jumps(client, limit=1) == [("b", 1, "good")]
    assert _jumps(client, athlete="Kari") == [("f", 1, "info")]
    newest = client.get("/api/jumps", params={"limit": 1}).json()[0]
    assert (newest["athlete"], newest["bib"]) == ("OLA  nordmann", "2")
    assert newest["jump"]["takeoff_speed"] == {"value": 26.0, "sigma": 0.05}
    refused(client.get("/api/jumps", params={"since": "yesterday"}), 422)
    refused(client.get("/api/jumps", params={"name": "Ola"}), 422)


def test_a_corrected_name_a_new_result_and_the_trash_count_at_once(client: httpx.Client, logs: dict[str, Path]) -> None:
    assert _jumps(client, athlete="kari") == [("f", 1, "info")]
    client.patch("/api/recordings/f", json={"athlete": "Åse / Ødegård?"}).raise_for_status()
    assert _jumps(client, athlete="kari") == []
    assert [name for name, *_ in _jumps(client, athlete="åse / ødegård?")] == ["f", "d"]
    measure(logs["f"], jump("f", 1, NOON, 23.1), jump("f", 2, NOON + timedelta(hours=1), 23.4))
    assert _jumps(client, athlete="åse / ødegård?") == [("f", 2, "good"), ("d", 1, "good"), ("f", 1, "good")]
    client.delete("/api/recordings/f").raise_for_status()
    assert _jumps(client, athlete="åse / ødegård?") == [("d", 1, "good")]


def _measured_in_images(log: Path, seed: int, leg_deg: float) -> None:
    """Keep the whole result of a simulated jump beside a log whose images have nothing but noise."""
    made = log.parent / "made"
    made.mkdir()
    found = recording(seed=seed, leg_deg=leg_deg)
    result_file.write_json(result_file.to_json(found), made / "jumper.json")
    point = PointMeasurement(np.array((80.0, 60.0)), np.eye(2))
    image = ImageMeasurements({"P1": point, "P2": replace(point, xy=point.xy + 30)}, {})
    pulses = tuple(PulseMeasurements(each.pulse, each.time, {"K2": image}) for each in found.jumps[0].pulses)
    cameras = {"K2": MeasuredCamera((160, 120), 0.002)}
    write_measurements(
        Measurements(log.stem, found.rate_hz, cameras, (JumpMeasurements(1, pulses),)), made / "measurements.json"
    )
    keep_result(made, log, (jump(log.stem, 1, NOON + timedelta(minutes=seed), 25.0),))


def test_a_page_compares_two_jumps_under_their_present_names(client: httpx.Client, service: MemoryService) -> None:
    for seed, name in enumerate(("one", "two", "three")):
        log = write_recording(
            service.catalogue.directory, name, (ALL_OK,) * 80, session={"athlete": "Kari", "bib": "5"}
        )
        _measured_in_images(log, seed, 3.0 * seed)
    client.patch("/api/recordings/two", json={"athlete": "Åse <b>Moe</b>"}).raise_for_status()
    assert client.get("/api/recordings/two/moment").json()["from_log"] is True
    query = {"first": "one", "second": "two", "language": "nb"}
    answer = client.get("/api/comparison.html", params=query, timeout=PATIENCE_S).raise_for_status()
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    assert answer.headers["content-security-policy"].startswith("sandbox ")
    assert "allow-same-origin" not in answer.headers["content-security-policy"]
    assert "<title>Kari (5) / Åse &lt;b&gt;Moe&lt;/b&gt; (5)</title>" in answer.text
    assert "Leggvinkel: 3," in answer.text
    assert answer.text.count('src="data:image/webp;base64,') == 2 * 5
    assert str(service.catalogue.directory) not in answer.text
    refused(client.get("/api/comparison.html", params=query | {"second": "one"}), 422)
    refused(client.get("/api/comparison.html", params=query | {"second_jump": 2}), 404)
    refused(client.get("/api/comparison.html", params=query | {"second": "nobody"}), 404)


def test_two_spans_are_compared_by_the_results_of_their_logs(client: httpx.Client, service: MemoryService) -> None:
    """Three jumps a day: the leg angle of the second day is greater by much more than jumps scatter."""
    for number, angle in enumerate((0.0, 1.0, 0.0, 10.0, 11.0, 10.0)):
        log = write_recording(service.catalogue.directory, f"day-{number}", session={"athlete": "Ola"})
        made = log.parent / "made"
        made.mkdir()
        result_file.write_json(result_file.to_json(recording(seed=number, leg_deg=angle)), made / "jumper.json")
        keep_result(made, log, (jump(log.stem, 1, NOON + timedelta(days=number // 3, minutes=number), 25.0),))
    measure(
        write_recording(service.catalogue.directory, "bad", session={"athlete": "Ola"}),
        jump("bad", 1, NOON, 25.0, ok=False),
    )
    spans = {
        "first_since": "2026-02-14T00:00:00Z", "first_until": "2026-02-15T00:00:00Z",
        "second_since": "2026-02-15T00:00:00Z", "second_until": "2026-02-16T00:00:00Z",
    }  # fmt: skip
    found = (
        client.get("/api/jumps/comparison", params={"athlete": "ola", **spans}, timeout=PATIENCE_S)
        .raise_for_status()
        .json()
    )
    assert (found["first"], found["second"], found["left_out"], found["scatter_jumps"]) == (3, 3, 1, 6)
    assert found["different"] == ["alpha"]
    by_name = {each["quantity"]: each for each in found["quantities"]}
    assert by_name["alpha"]["difference"] == pytest.approx(10.0, abs=1.5)
    assert by_name["alpha"]["p"] < 0.05 < by_name["gamma"]["p"]
    assert by_name["alpha"]["needed"] < by_name["alpha"]["difference"]
    for nobody in ("Kari", "two\nlines", "\x00"):
        refused(client.get("/api/jumps/comparison", params={"athlete": nobody, **spans}), 422)
    overlapping = spans | {"second_since": "2026-02-14T23:00:00Z"}
    refused(client.get("/api/jumps/comparison", params={"athlete": "ola", **overlapping}), 422)
    service.arm()
    service.start_recording(RecordingOrder())
    said = refused(client.get("/api/jumps/comparison", params={"athlete": "ola", **spans}), 409)
    assert said.detail == "jumps are not compared while a recording runs: try again when it has ended"


@pytest.mark.usefixtures("logs")
def test_conditions_find_recordings_and_jumps_and_say_what_is_wrong_with_them(client: httpx.Client) -> None:
    def ids(**query: str) -> list[str]:
        return [each["id"] for each in client.get("/api/recordings", params=query).raise_for_status().json()]

    assert _jumps(client, search='athlete:"ola nordmann" takeoff > 0') == _jumps(client, athlete="ola nordmann")
    assert ids(search="takeoff > 0 ola") == ["b", "a"]
    assert ids(search="takeoff > 900 ola") == []
    for path in ("recordings", "jumps"):
        answer = client.get(f"/api/{path}", params={"search": "gamma > 3"})
        assert (answer.status_code, answer.json()["said"]["code"]) == (422, "search_quantity")
