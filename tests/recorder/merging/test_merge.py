"""`svev merge`: logs of two computers with clocks of their own become one, sound to every check, or none at all."""

import errno
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from recorder.checking.verify import Verdict, verify
from recorder.log.extent import extent
from recorder.log.triplet_buffers import TripletBuffers
from recorder.merging.merge import merge
from recorder.reading.info import info
from recorder.reading.triplets import triplets
from recorder.writing.log_writer import LogDescription, LogWriter
from rig.clocks import DeviceNs, UtcNs
from rig.errors import BadInputError, LogDamagedError, StorageError
from rig.events import Event, Level
from rig.frame import FrameStatus
from rig.host.utc_clock import UtcState
from rig.pulse import PulseNumber
from rig.tag import CameraTag, TripletTag
from rig.topics import RECORDING_METADATA
from svev.cli import main
from tests.recorder.logs import ABSENT, LOST, OK, PERIOD_NS, SESSION, START, acquire
from tests.support.waiting import wait_until

KNOWN = UtcState(True, "chrony", 0.0, 100.0, 3000.0)
#: What the second computer's clock shows too much, ns, and how much too fast it runs.
OFFSET_NS, DRIFT = 2_345_678, 20e-6
WIDTH = 30
#: No process has this number: it is larger than Linux gives.
DEAD_PID = 4_194_305


def write_part(
    path: Path,
    names: Sequence[str],
    pulses: Sequence[int],
    *,
    offset_ns: int = 0,
    drift: float = 0.0,
    rows: int = 24,
    utc: UtcState | None = KNOWN,
    lost: Sequence[int] = (),
) -> None:
    """A log of one computer, which saw these pulses of the train; all pixels of a frame tell camera and pulse."""
    buffers = TripletBuffers((rows, WIDTH * len(names)), 4)
    rig = {"name": path.stem, "cameras": ", ".join(names), "rate_hz": "30.0"}
    cameras_toml = "\n".join(f'[[cameras]]\nname = "{name}"\nexposure_us = {len(name)}000.0' for name in names)
    rig_toml = f'name = "{path.stem}"\n[trigger]\nrate_hz = 30.0\n{cameras_toml}\n'.encode()
    rng = np.random.default_rng(len(names))

    def shown(time: float) -> int:
        return round(START + time * (1 + drift)) + offset_ns

    with LogWriter(path, LogDescription(SESSION, rig | (utc.to_fields() if utc else {}), rig_toml), buffers) as log:
        log.write_event(Event(UtcNs(shown(0)), Level.INFO, "recorder", f"recording {path.stem} started"))
        for number, pulse in enumerate(pulses, 1):
            time = shown(pulse * PERIOD_NS) + round(rng.normal(0, 10e3))
            cameras = []
            for place, name in enumerate(names):
                columns = (place * WIDTH, (place + 1) * WIDTH)
                if pulse in lost and place == 0:
                    cameras.append(CameraTag(name, columns, LOST))
                    continue
                # Frames are numbered by the pulses that the camera saw.
                frame = number + 7
                cameras.append(
                    CameraTag(
                        name,
                        columns,
                        OK,
                        frame,
                        None,
                        DeviceNs(pulse * PERIOD_NS),
                        UtcNs(time + 5_000_000),
                        1.0 + place,
                    )
                )
            tag = TripletTag(
                PulseNumber(number), UtcNs(time), "morning", path.stem, (rows, len(names) * WIDTH), tuple(cameras)
            )
            slot = acquire(buffers)
            image = np.zeros(tag.shape, np.uint8)
            for camera in tag.cameras:
                if camera.status is OK:
                    image[:, slice(*camera.columns)] = shade(camera.name, pulse)
            buffers.write(slot, image)
            log.write_pulse(tag, slot, UtcNs(time + 6_000_000))
        log.write_health(b'{"free_triplets":4}', UtcNs(shown(pulses[-1] * PERIOD_NS)))
        begin, end = shown((pulses[0] - 0.4) * PERIOD_NS), shown((pulses[-1] + 0.4) * PERIOD_NS)
        log.set_metadata(RECORDING_METADATA, extent(UtcNs(begin), UtcNs(end)))
    buffers.close()


def shade(camera: str, pulse: int) -> int:
    return 1 + (31 * int(camera[1:]) + pulse) % 255


@pytest.fixture
def parts(tmp_path: Path) -> tuple[Path, Path]:
    """Pulses 0 to 119 on the left, without 50; 30 to 149 on the right, without 60 to 62, and 70 lost in K3."""
    left, right = tmp_path / "left.mcap", tmp_path / "right.mcap"
    write_part(left, ["K1", "K2"], [pulse for pulse in range(120) if pulse != 50])
    second = [pulse for pulse in range(30, 150) if pulse not in (60, 61, 62)]
    write_part(right, ["K3"], second, offset_ns=OFFSET_NS, drift=DRIFT, rows=20, lost=[70])
    return left, right


def test_each_pulse_has_the_frames_of_its_instant_and_times_of_the_first_log(
    parts: tuple[Path, Path], tmp_path: Path
) -> None:
    before = [part.read_bytes() for part in parts]
    report = merge(*parts, tmp_path / "both.mcap")
    assert [part.read_bytes() for part in parts] == before
    assert (report.alignment.common, report.alone) == (86, (33, 31))
    middle = 75 * PERIOD_NS
    assert abs(report.alignment.offset_ns + OFFSET_NS + DRIFT * middle) < 10_000
    statuses: dict[int, list[FrameStatus]] = {}
    for tag, image in triplets(tmp_path / "both.mcap"):
        pulse = round((tag.time - START) / PERIOD_NS)
        assert abs(tag.time - START - pulse * PERIOD_NS) < 100_000, "on the line of time of the first log"
        assert tag.pulse == pulse + 1, "some camera saw every pulse"
        assert (image.shape, tag.shape) == ((24, 90), (24, 90))
        statuses[pulse] = [camera.status for camera in tag.cameras]
        assert [camera.name for camera in tag.cameras] == ["K1", "K2", "K3"]
        assert [camera.rows for camera in tag.cameras[2:]] == [20]
        for camera in tag.cameras:
            block = image[camera.part]
            assert set(block.ravel()) == ({shade(camera.name, pulse)} if camera.status is OK else {0})
            if camera.host_time is not None:
                assert abs(camera.host_time - tag.time - 5_000_000) < 150_000
            if camera.offset_us is not None:
                assert abs(camera.offset_us) < 100
    assert sorted(statuses) == list(range(150))
    assert {tuple(statuses[pulse]) for pulse in [*range(30), 60, 61, 62]} == {(OK, OK, ABSENT)}
    assert {tuple(statuses[pulse]) for pulse in [50, *range(120, 150)]} == {(ABSENT, ABSENT, OK)}
    assert tuple(statuses[70]) == (OK, OK, LOST)


def test_the_result_is_sound_and_says_where_it_comes_from(
    parts: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "both.mcap"
    assert main(["merge", *map(str, parts), "-o", str(out), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert (report["pulses"], report["complete"], report["common"], report["alone"]) == (150, 85, 86, [33, 31])
    assert report["causes"] == {"lost": 1, "missed": 0, "damaged": 0, "absent": 33 + 2 * 31}
    assert main(["verify", "--ledger", str(out)]) == 0, capsys.readouterr()
    found = verify(out)
    assert (found.verdict, found.findings, found.every_byte) == (Verdict.PARTIAL, (), True)
    assert found.ledger.pauses() == ()
    spoken = {(event.name, event.message) for event in found.events}
    assert {
        ("K3", "absent: its log knows nothing of pulses 61-63"),
        ("K1", "absent: its log knows nothing of pulse 51"),
        ("recorder", "recording left started"),
        ("recorder", "recording right started"),
    } <= spoken
    capsys.readouterr()
    assert main(["info", str(out)]) == 0
    said = capsys.readouterr().out
    assert "from left.mcap and right.mcap: 86 pulses are in both; the clock of the second was 2.3" in said
    assert "ahead of that of the first" in said
    about = info(out)
    assert (about.rig["name"], about.rig["cameras"]) == ("left + right", "K1, K2, K3")
    assert about.session["athlete"] == SESSION["athlete"]
    assert about.recording == "both"
    assert list(tmp_path.glob(".*")) == []


def test_what_cannot_be_decided_or_does_not_fit_is_refused_and_leaves_nothing(
    parts: tuple[Path, Path], tmp_path: Path
) -> None:
    left, right = parts
    out, free, same = tmp_path / "out.mcap", tmp_path / "free.mcap", tmp_path / "same.mcap"
    write_part(free, ["K3"], range(30, 100), offset_ns=OFFSET_NS, utc=None)
    write_part(same, ["K2"], range(30, 100))
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(right.read_bytes()[:-1000])
    flipped = bytearray(right.read_bytes())
    flipped[flipped.index(bytes([shade("K3", 90)]) * WIDTH)] ^= 1
    bent = tmp_path / "bent.mcap"
    bent.write_bytes(flipped)
    for other, error, text in (
        (free, BadInputError, "fit at more than one offset"),
        (same, BadInputError, "both have a camera K2"),
        (left, BadInputError, "both have a camera K1"),
        (torn, LogDamagedError, "svev recover"),
        (bent, LogDamagedError, "svev recover"),
        (tmp_path / "no.mcap", BadInputError, "no such file"),
    ):
        with pytest.raises(error, match=text):
            merge(left, other, out)
    with pytest.raises(BadInputError, match="never overwritten"):
        merge(left, right, right)
    with pytest.raises(BadInputError, match="no such directory"):
        merge(left, right, tmp_path / "no" / "out.mcap")
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"left.mcap", "right.mcap", "free.mcap", "same.mcap", "torn.mcap", "bent.mcap"}


def test_a_full_disk_leaves_nothing(parts: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.pwrite", refusing(errno.ENOSPC))
    with pytest.raises(StorageError, match="the disk is full"):
        merge(*parts, tmp_path / "out.mcap")
    assert {path.name for path in tmp_path.iterdir()} == {"left.mcap", "right.mcap"}


@pytest.mark.parametrize("error", [errno.ENOTSUP, errno.ENOSYS, errno.EMLINK, errno.EPERM, errno.EINVAL])
def test_a_file_system_without_links_gets_the_log(
    error: int, parts: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rig.host.file_names._rename_exclusively", refusing(error))
    monkeypatch.setattr("os.link", refusing(error))
    report = merge(*parts, tmp_path / "out.mcap")
    assert verify(report.path).findings == ()
    assert {path.name for path in tmp_path.iterdir()} == {"left.mcap", "right.mcap", "out.mcap"}


def test_a_whole_log_that_cannot_get_its_name_is_kept(
    parts: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, kept = tmp_path / "out.mcap", tmp_path / f".out.mcap.{os.getpid()}.part"
    monkeypatch.setattr("recorder.recovering.unfinished_log.give_name", refusing(errno.EIO))
    with pytest.raises(StorageError, match=f"the new log is whole, and stays in {kept}"):
        merge(*parts, out)
    assert not out.exists()
    assert verify(kept).findings == ()


def test_a_log_of_the_same_name_made_meanwhile_stays_and_so_does_the_merged_one(
    parts: tuple[Path, Path], tmp_path: Path
) -> None:
    out, kept = tmp_path / "out.mcap", tmp_path / f".out.mcap.{os.getpid()}.part"

    def intrude(_: int) -> None:
        out.write_text("precious")

    with pytest.raises(BadInputError, match=f"never overwritten; the new log is whole, and stays in {kept}"):
        merge(*parts, out, progress=intrude)
    assert out.read_text() == "precious"
    assert verify(kept).findings == ()


def test_a_whole_log_that_a_dead_process_left_is_not_cleared_away(parts: tuple[Path, Path], tmp_path: Path) -> None:
    left, torn = tmp_path / f".out.mcap.{DEAD_PID}.part", tmp_path / f".out.mcap.{DEAD_PID + 1}.part"
    left.write_bytes(parts[0].read_bytes())
    torn.write_bytes(parts[0].read_bytes()[:-1])
    merge(*parts, tmp_path / "out.mcap")
    assert {path.name for path in tmp_path.iterdir()} == {"left.mcap", "right.mcap", "out.mcap", left.name}


def test_names_as_long_as_a_file_system_takes_them(parts: tuple[Path, Path], tmp_path: Path) -> None:
    first = parts[0].rename(tmp_path / f"{'ø' * 125}.mcap")
    out = tmp_path / f"{'å' * 125}.mcap"
    merge(first, parts[1], out)
    assert verify(out).findings == ()
    assert {path.name for path in tmp_path.iterdir()} == {first.name, parts[1].name, out.name}


def refusing(error: int) -> Callable[..., None]:
    """A function that fails as a system call does."""

    def refuses(*_: object, **__: object) -> None:
        raise OSError(error, os.strerror(error))

    return refuses


def test_one_that_is_killed_leaves_no_log_and_the_next_one_clears_away(
    parts: tuple[Path, Path], tmp_path: Path
) -> None:
    """The process stops itself (SIGSTOP) after the tenth pulse, so that it is killed in the midst of its work."""
    out = tmp_path / "out.mcap"
    program = (
        "import os, signal, sys; from pathlib import Path; from recorder.merging.merge import merge\n"
        "stop = lambda done: done == 10 and os.kill(os.getpid(), signal.SIGSTOP)\n"
        "merge(*map(Path, sys.argv[1:]), progress=stop)"
    )
    with subprocess.Popen([sys.executable, "-c", program, *map(str, parts), str(out)]) as merging:
        try:
            wait_until(lambda: is_stopped(merging.pid), "the tenth pulse", 60)
            assert not out.exists()
            assert (tmp_path / f".out.mcap.{merging.pid}.part").stat().st_size > 0
        finally:
            merging.send_signal(signal.SIGKILL)
    assert not out.exists()
    merge(*parts, out)
    assert {path.name for path in tmp_path.iterdir()} == {"left.mcap", "right.mcap", "out.mcap"}


def is_stopped(pid: int) -> bool:
    return " T " in Path(f"/proc/{pid}/stat").read_text()


def test_memory_does_not_grow_with_the_pixels(tmp_path: Path) -> None:
    """The memory that is used grows by less than a fifth of the size of the logs, old and new."""
    used = []
    for rows, name in ((24, "small"), (2000, "large")):
        folder = tmp_path / name
        folder.mkdir()
        for part, cameras in (("left", ["K1", "K2"]), ("right", ["K3"])):
            write_part(folder / f"{part}.mcap", cameras, range(200), rows=rows)
        program = (
            "import sys; from pathlib import Path; from recorder.merging.merge import merge\n"
            "from tests.support.processes import peak_memory_bytes\n"
            "merge(*map(Path, sys.argv[1:])); print(peak_memory_bytes())"
        )
        paths = [str(folder / f"{part}.mcap") for part in ("left", "right", "both")]
        done = subprocess.run([sys.executable, "-c", program, *paths], capture_output=True, check=True, timeout=120)
        used.append(int(done.stdout))
        size = sum(path.stat().st_size for path in folder.iterdir())
    assert size > 70_000_000
    assert used[1] - used[0] < size / 5
