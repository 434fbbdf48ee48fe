"""A rig of replayed cameras, as a user runs it: what is recorded from it is what stands in the log that it replays."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from recorder.checking.verify import verify
from recorder.reading.items import Chunk
from recorder.reading.log_reader import LogReader
from recorder.reading.triplets import triplets
from rig.clocks import host_now
from rig.errors import BadInputError, CameraNotFoundError
from rig.frame import FrameStatus
from rig.settings.file import load_rig
from rig.settings.model import RigSettings
from rig.transport.ring import CameraRing
from service.processes.backends import camera_opener, check_backends
from service.processes.replayed_log import ReplayedLog
from simrig.images import stamp
from tests.capture.rigs import write_rig
from tests.recorder.logs import ALL_OK, DAMAGED, OK, SHAPE, write_log
from tests.service.serving import serving
from tests.support.commands import run_svev
from tests.support.loopback import Loopback

SVEV = [sys.executable, "-m", "svev"]


def _record(rig: Path, out: Path, seconds: float) -> dict[str, Any]:
    length = ("--seconds", str(seconds))
    done = run_svev("record", "--rig", str(rig), *length, "--out", str(out), "--json", timeout_s=90)
    assert done.returncode == 0, done.stderr
    result: dict[str, Any] = json.loads(done.stdout)
    assert not verify(Path(result["log"])).damaged
    return result


Blocks = tuple[tuple[str, FrameStatus, NDArray[np.uint8]], ...]


def _by_hill_pulse(log: Path) -> Iterator[tuple[int, Blocks]]:
    """Pulses in the order of the log: the hill pulse that all their stamps name, and each camera's status and image."""
    for tag, image in triplets(log):
        blocks = tuple(
            (camera.name, camera.status, image[:, camera.columns[0] : camera.columns[1]].copy())
            for camera in tag.cameras
        )
        stamps = [stamp.read(block) for _, status, block in blocks if status is OK]
        (pulse,) = {found.pulse for found in stamps if found is not None}
        yield pulse, blocks


def _runs_on(pulses: list[int], original: list[int]) -> bool:
    """Whether each pulse is followed by that which follows it in the original, the last by the first."""
    place = original.index(pulses[0])
    return pulses == [original[(place + n) % len(original)] for n in range(len(pulses))]


def test_what_is_recorded_from_replayed_cameras_is_the_log(tmp_path: Path, loopback: Loopback) -> None:
    faults: list[dict[str, Any]] = [
        {"kind": kind, "camera": camera, "at_pulse": pulse}
        for place, (kind, camera) in enumerate([("missed_pulse", "K1"), ("lost_frame", "K2"), ("damaged_frame", "K3")])
        for pulse in range(20 + 7 * place, 900, 21)
    ]
    first = _record(write_rig(tmp_path, "sim", loopback, faults=faults), tmp_path / "first", 2)
    rig = write_rig(tmp_path, "replay", loopback, log=Path(first["log"]))
    second = _record(rig, tmp_path / "second", 4)
    assert second["pulses"] == 120
    assert min(second["causes"][cause] for cause in ("missed", "lost", "damaged")) >= 2
    original = dict(_by_hill_pulse(Path(first["log"])))
    replayed = list(_by_hill_pulse(Path(second["log"])))
    assert _runs_on([pulse for pulse, _ in replayed], list(original))
    for pulse, blocks in replayed:
        for (name, status, block), (_, expected, pixels) in zip(blocks, original[pulse], strict=True):
            assert status is expected, (pulse, name)
            assert np.array_equal(block, pixels), (pulse, name)


@pytest.mark.long
def test_a_camera_that_was_away_is_away_again(tmp_path: Path, loopback: Loopback) -> None:
    """Until its connection is up again more pulses may go by than in the log, so the pulses of its return are free."""
    faults = [{"kind": "restart", "camera": "K3", "at_pulse": pulse, "duration_s": 0.3} for pulse in range(60, 900, 60)]
    first = _record(write_rig(tmp_path, "sim", loopback, faults=faults), tmp_path / "first", 3)
    rig = write_rig(tmp_path, "replay", loopback, log=Path(first["log"]))
    second = _record(rig, tmp_path / "second", 5)
    assert second["causes"]["absent"] >= first["causes"]["absent"] > 0
    original = dict(_by_hill_pulse(Path(first["log"])))
    returned = 0
    for pulse, blocks in _by_hill_pulse(Path(second["log"])):
        statuses, expected = ([status for _, status, _ in found] for found in (blocks, original[pulse]))
        assert statuses[:2] == expected[:2] == [OK, OK]
        if expected[2] is not OK or statuses[2] is OK:
            assert statuses[2] is expected[2], pulse
            assert all(np.array_equal(a[2], b[2]) for a, b in zip(blocks, original[pulse], strict=True))
            returned += statuses[2] is OK
    assert returned > 30


def test_the_service_is_armed_as_long_as_an_operator_wants(tmp_path: Path, loopback: Loopback) -> None:
    """The log lasts 1.3 s; the recording goes on through its end, and nothing is missing there."""
    write_log(tmp_path / "log.mcap", (ALL_OK,) * 40)
    with serving(tmp_path, _small_rig(tmp_path, loopback), loopback) as service:
        service.arm()
        service.await_cameras("ready", "ready", "ready")
        recording = service.post("/api/recordings", {"preroll_s": 0})["id"]
        service.await_pulses(100)
        counts = service.post(f"/api/recordings/{recording}/stop")["counts"]
    assert counts["pulses"] == counts["complete"] >= 100


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('name = "K2"', 'name = "K9"'), "has no camera of this name, but K1, K2, K3: correct name"),
        (("rate_hz = 30.0", "rate_hz = 50.0"), "was recorded at 30 pulses per second, trigger.rate_hz is 50: "),
        (("width = 30", "width = 31"), "are 30 x 24, the rig file's region is 31 x 24: write region = { width = 30"),
        (("log.mcap", "none.mcap"), "none.mcap: no such file; name an existing log"),
        (("log.mcap", "rig.toml"), "rig.toml: is not an MCAP log; name a log of svev"),
        (("log.mcap", "empty.mcap"), "empty.mcap: holds no pulse; replay another log"),
    ],
)
def test_a_log_that_does_not_fit_is_refused_in_one_line(
    tmp_path: Path, loopback: Loopback, change: tuple[str, str], words: str
) -> None:
    write_log(tmp_path / "log.mcap")
    write_log(tmp_path / "empty.mcap", ())
    path = _small_rig(tmp_path, loopback)
    check_backends(load_rig(path))
    path.write_text(path.read_text().replace(*change))
    with pytest.raises(BadInputError) as caught:
        check_backends(load_rig(path))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_log_that_vanished_is_a_camera_that_is_not_there(tmp_path: Path, loopback: Loopback) -> None:
    write_log(tmp_path / "log.mcap")
    rig = load_rig(_small_rig(tmp_path, loopback))
    ring = CameraRing.create("K1", rig.cameras[0].frame_bytes, 4)
    opener = camera_opener(rig, 0, ring, host_now())
    (tmp_path / "log.mcap").unlink()
    with pytest.raises(CameraNotFoundError, match=r"camera K1: .*log\.mcap: no such file"):
        opener()
    ring.close()


def _small_rig(folder: Path, loopback: Loopback) -> Path:
    """Three cameras that replay `log.mcap`, whose frames are small."""
    path = write_rig(folder, "replay", loopback, log=folder / "log.mcap")
    path.write_text(path.read_text().replace("[[cameras]]", "[[cameras]]\nregion = { width = 30, height = 24 }"))
    return path


@pytest.fixture
def small(tmp_path: Path, loopback: Loopback) -> RigSettings:
    return load_rig(_small_rig(tmp_path, loopback))


def _frames(rig: RigSettings, index: int) -> tuple[list[FrameStatus], list[NDArray[np.uint8] | None]]:
    """What the log says of a camera, and the frames that can be read."""
    log = ReplayedLog(rig, index)
    frames: list[NDArray[np.uint8] | None] = []
    for place in range(len(log.times)):
        out = np.zeros((24, 30), np.uint8)
        frames.append(out if log.read_into(out, place) else None)
    log.close()
    return [tag.status for tag in log.tags], frames


def test_each_camera_gets_its_own_columns(tmp_path: Path, small: RigSettings) -> None:
    written = write_log(tmp_path / "log.mcap", [ALL_OK, (OK, DAMAGED, OK), ALL_OK])
    for index in range(3):
        statuses, frames = _frames(small, index)
        for pulse, status, frame in zip(written, statuses, frames, strict=True):
            assert status is pulse.tag.cameras[index].status
            assert pulse.image is not None
            assert frame is not None
            assert np.array_equal(frame, pulse.image[:, 30 * index : 30 * (index + 1)])


def test_a_frame_whose_bytes_are_damaged_is_not_taken_for_a_picture(tmp_path: Path, small: RigSettings) -> None:
    log = tmp_path / "log.mcap"
    write_log(log, (ALL_OK,) * 5)
    with LogReader(log) as reader:
        chunks = [item for item in reader.items() if isinstance(item, Chunk) and len(item.messages) > 1]
    data = bytearray(log.read_bytes())
    data[chunks[2].offset + chunks[2].length // 2] ^= 1
    log.write_bytes(data)
    statuses, frames = _frames(small, 1)
    assert statuses == [OK] * 5
    assert [frame is None for frame in frames] == [False, False, True, False, False]


@pytest.mark.parametrize("keep", [0.3, 0.6, 0.9])
def test_a_log_that_was_cut_off_is_replayed_as_far_as_it_goes(tmp_path: Path, small: RigSettings, keep: float) -> None:
    log = tmp_path / "log.mcap"
    write_log(log, (ALL_OK,) * 40)
    data = log.read_bytes()
    log.write_bytes(data[: round(len(data) * keep)])
    statuses, frames = _frames(small, 0)
    assert 0 < len(statuses) <= 40
    assert abs(len(statuses) - 40 * keep) < 5
    assert all(frame is not None for frame in frames)


def test_a_log_that_shrinks_while_it_is_replayed_gives_damaged_frames(tmp_path: Path, small: RigSettings) -> None:
    path = tmp_path / "log.mcap"
    write_log(path, (ALL_OK,) * 40)
    log = ReplayedLog(small, 0)
    with path.open("r+b") as file:
        file.truncate(path.stat().st_size // 2)
    out = np.zeros((24, 30), np.uint8)
    readable = [log.read_into(out, place) for place in range(40)]
    log.close()
    assert readable == sorted(readable, reverse=True)
    assert 15 < sum(readable) < 25


def test_damage_in_the_middle_leaves_the_rest(tmp_path: Path, small: RigSettings) -> None:
    log = tmp_path / "log.mcap"
    write_log(log, (ALL_OK,) * 40)
    data = bytearray(log.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 6000] = b"\xff" * 6000
    log.write_bytes(data)
    statuses, frames = _frames(small, 2)
    assert 34 <= len(statuses) <= 40
    assert 34 <= sum(frame is not None for frame in frames) < 40


def test_the_rig_of_the_tests_is_as_wide_as_their_logs(small: RigSettings) -> None:
    assert small.triplet_shape == SHAPE
