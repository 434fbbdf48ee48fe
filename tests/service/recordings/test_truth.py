"""The truth beside logs: written when the recording is over, or said why not, and never half."""

import json
import threading
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from rig.clocks import HostNs, UtcAnchor
from rig.events import Event
from rig.pulse import PulseNumber
from rig.settings.camera import Region
from rig.settings.file import CONFIG
from rig.settings.model import RigSettings
from service.processes.simulation import simulated_truth
from service.recordings.truth import TruthWriter
from tests.recorder.logs import START, write_log
from tests.support.rigs import SIM

EPOCH, RATE_HZ = HostNs(10**15), 100.0


def _rig(backend: str, **region: int) -> RigSettings:
    cameras = tuple(c.model_copy(update={"backend": backend, "region": Region(**region)}) for c in SIM.cameras)
    simulation = SIM.simulation
    assert simulation is not None
    hard = simulation.model_copy(update={"scenario": CONFIG / "scenarios" / "hard.toml"})
    trigger = SIM.trigger.model_copy(update={"rate_hz": RATE_HZ})
    return SIM.model_copy(update={"cameras": cameras, "simulation": hard, "trigger": trigger})


def _truth(folder: Path, rig: RigSettings, times: Iterable[tuple[int, float]]) -> dict[str, Any]:
    """The truth of a recording of pulses with these numbers at these times in hill pulses."""
    write = simulated_truth(rig, EPOCH)
    assert write is not None
    survey = folder / "survey.json"
    write(folder / "truth.json", survey, [(PulseNumber(n), HostNs(EPOCH + round(t * 1e9 / RATE_HZ))) for n, t in times])
    assert sorted(path.name for path in folder.iterdir()) == ["survey.json", "truth.json"], (
        "nothing half written is left"
    )
    content: dict[str, Any] = json.loads((folder / "truth.json").read_text())
    surveyed = json.loads(survey.read_text())
    for name, camera in surveyed["cameras"].items():
        assert camera.items() <= content["cameras"][name].items(), "the survey describes the images of the log"
    balls = {name for name, ball in content["balls"].items() if ball["role"] == "control"}
    assert set(surveyed["points"]) == balls, "fallen balls were surveyed too"
    assert set(surveyed["cameras"]) == {camera.name for camera in rig.cameras}
    return content


def test_pulses_in_a_pause_or_between_two_of_the_hill_have_no_truth(tmp_path: Path) -> None:
    known = _truth(tmp_path, _rig("sim"), [(1, 39.9), (2, 41.02), (3, 42.4), (4, 44.0), (5, 44.1)])
    assert known["hill_pulse_of_recording"] == {"1": 40, "2": 41, "4": 44, "5": 44}
    assert [state["pulse"] for state in known["pulses"]] == [40, 41, 44]
    assert known["cameras"]["K2"]["exposure_us"] == 2000.0, "the scenario's, not the rig's"


def test_regions_of_a_sensor_are_told_by_the_principal_point(tmp_path: Path) -> None:
    """A region of a GigE Vision sensor, and one of a FireWire sensor, whose middle is what the scenario describes."""
    pulses = [(1, 110.0)]
    whole = _truth(tmp_path, _rig("sim", width=640, height=480), pulses)["pulses"][0]["images"]
    for backend, region, shift in (
        ("aravis", {"width": 640, "height": 480}, (0, 0)),
        ("iidc", {"width": 640, "height": 480}, (0, 0)),
        ("iidc", {"x": 200, "y": 150, "width": 600, "height": 470}, (4, 1)),
    ):
        known = _truth(tmp_path, _rig(backend, **region), pulses)
        for name, spots in known["pulses"][0]["images"].items():
            for marker, spot in spots.items():
                assert spot is None or np.allclose(np.add(spot, shift), whole[name][marker], atol=1e-9)
            assert known["cameras"][name]["size"] == [region["width"], region["height"]]


def test_the_truth_stands_beside_each_log_that_can_have_one(tmp_path: Path) -> None:
    told: list[Event] = []
    writer = TruthWriter(told.append)
    seen: dict[Path, list[tuple[PulseNumber, HostNs]]] = {}

    def write(path: Path, survey: Path, pulses: Iterable[tuple[PulseNumber, HostNs]]) -> None:
        seen[path] = list(pulses)
        if "full" in path.name:
            raise OSError(28, "No space left on device")
        path.write_text("{}")
        survey.write_text("{}")

    logs = [tmp_path / f"{name}.mcap" for name in ("failed", "moved", "full", "good")]
    for log in logs:
        write_log(log)
        writer.opened(log, write)
    logs[1].rename(tmp_path / "elsewhere.mcap")
    writer.opened(tmp_path / "real.mcap", None)
    writer.closed([logs[0]])
    assert writer.wait(60)
    assert [path.name for path in tmp_path.glob("*.truth.json")] == ["good.truth.json"]
    assert [path.name for path in tmp_path.glob("*.survey.json")] == ["good.survey.json"]
    assert [event.message.partition(": ")[::2] for event in told] == [
        (
            "what the simulated cameras saw is not written beside failed.mcap",
            "the disk did not take the end of the log",
        ),
        ("what the simulated cameras saw is not written beside full.mcap", "[Errno 28] No space left on device"),
    ]
    (number, time), *_ = seen[tmp_path / "good.truth.json"]
    assert number == 1
    assert abs(UtcAnchor.take().utc(time) - START) < 1e9


def test_what_is_not_written_when_the_service_ends_is_given_up_whole(tmp_path: Path) -> None:
    told: list[Event] = []
    writer = TruthWriter(told.append)
    ending = threading.Event()

    def write(path: Path, survey: Path, pulses: Iterable[tuple[PulseNumber, HostNs]]) -> None:
        for number, _ in pulses:
            assert number == 1, "the second one is never asked for"
            assert ending.wait(60)
            writer.end(0.0)

    write_log(tmp_path / "long.mcap")
    writer.opened(tmp_path / "long.mcap", write)
    writer.closed()
    assert not writer.wait(0.0)
    ending.set()
    assert writer.wait(60)
    assert [event.message for event in told] == [
        "what the simulated cameras saw is not written beside long.mcap: the service ends"
    ]


def test_replayed_cameras_have_no_truth() -> None:
    assert simulated_truth(_rig("replay"), EPOCH) is None
    assert simulated_truth(_rig("sim").model_copy(update={"simulation": None}), EPOCH) is None
