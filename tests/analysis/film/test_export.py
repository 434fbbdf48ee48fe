"""Exported recordings, decoded again: every pulse in its place, at its time; whole or not there at all."""

import csv
import os
import resource
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.film.export import export
from recorder.log.triplet_buffers import TripletBuffers
from recorder.reading.items import Chunk
from recorder.reading.log_reader import LogReader
from recorder.reading.triplets import triplets
from rig.api.export import ExportOrder, Kind, Quality
from rig.api.language import Language
from rig.errors import BadInputError
from rig.frame import FrameStatus
from svev.cli import main
from tests.recorder.logs import (
    ABSENT,
    ALL_OK,
    LOST,
    MISSED,
    OK,
    OWN_TOPICS,
    PERIOD_NS,
    make_tag,
    open_writer,
    write_log,
    write_pulse,
)

SHAPE = (120, 480)
Picture = NDArray[np.uint8]


def _decoded(path: Path) -> Iterator[tuple[float, Picture]]:
    with av.open(str(path)) as video:
        for frame in video.decode(video=0):
            assert frame.time is not None
            yield frame.time, np.asarray(frame.to_ndarray(format="gray"), np.uint8)


def _write_with_gap(path: Path) -> None:
    """Pulses 1 to 12, without tags of 5 and 6; in 8 the frame of K2 is lost, in 9 all are absent."""
    buffers = TripletBuffers(SHAPE, 4)
    with open_writer(path, buffers) as log:
        for pulse in (1, 2, 3, 4, 7, 8, 9, 10, 11, 12):
            statuses: tuple[FrameStatus, ...] = {8: (OK, LOST, OK), 9: (ABSENT,) * 3}.get(pulse, ALL_OK)
            write_pulse(log, buffers, make_tag(pulse, statuses, SHAPE))
    buffers.close()


@pytest.fixture
def gap(tmp_path: Path) -> Path:
    _write_with_gap(tmp_path / "log.mcap")
    return tmp_path / "log.mcap"


def test_without_loss_every_pixel_is_that_of_the_log(gap: Path, tmp_path: Path) -> None:
    out = tmp_path / "jump.mkv"
    told: list[tuple[int, int]] = []
    assert export(gap, ExportOrder(kind=Kind.FFV1), out, lambda *step: told.append(step)) == 12
    pictures = dict(enumerate((picture for _, picture in _decoded(out)), 1))
    with av.open(str(out)) as video:
        stream = video.streams.video[0]
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("ffv1", "gray")
    assert sorted(pictures) == list(range(1, 13))
    for tag, image in triplets(gap):
        np.testing.assert_array_equal(pictures.pop(int(tag.pulse)), image)
    assert sorted(pictures) == [5, 6]
    for picture in pictures.values():  # black, with the word in the block of each camera
        assert np.median(picture) == 0
        assert all(picture[:, first : first + 160].max() > 200 for first in (0, 160, 320))
    assert told == [(done, 12) for done in range(1, 13)]


def test_a_log_with_a_topic_for_each_camera_is_exported_alike(tmp_path: Path) -> None:
    write_log(tmp_path / "log.mcap", (ALL_OK,) * 3, cameras=OWN_TOPICS)
    export(tmp_path / "log.mcap", ExportOrder(kind=Kind.FFV1, cameras=("K3", "K1")), tmp_path / "jump.mkv")
    pictures = [picture for _, picture in _decoded(tmp_path / "jump.mkv")]
    images = [image.copy() for _, image in triplets(tmp_path / "log.mcap")]
    np.testing.assert_array_equal(pictures, [np.hstack((image[:, 60:], image[:, :30])) for image in images])


@pytest.mark.parametrize("slow", [1, 10])
def test_every_pulse_stands_at_its_time(gap: Path, tmp_path: Path, slow: int) -> None:
    out = tmp_path / "jump.mp4"
    export(gap, ExportOrder(slow=slow, first=3, last=10), out)
    with av.open(str(out)) as video:
        assert video.streams.video[0].codec_context.name == "h264"
        assert video.streams.video[0].codec_context.pix_fmt == "yuv420p"
    times = [time for time, _ in _decoded(out)]
    assert times == pytest.approx([slow * place * PERIOD_NS / 1e9 for place in range(8)], abs=5e-6)  # of the container


def test_words_are_burnt_in_and_missing_frames_say_why(gap: Path, tmp_path: Path) -> None:
    plain, named = tmp_path / "plain.mp4", tmp_path / "named.mp4"
    export(gap, ExportOrder(cameras=("K2",), quality=Quality.BEST), plain)
    export(gap, ExportOrder(cameras=("K2",), quality=Quality.BEST, burn_in=True), named)
    without, with_ = (np.array([picture for _, picture in _decoded(path)], float) for path in (plain, named))
    assert without.shape == (12, 120, 160)
    upper, lower = slice(0, 90), slice(90, 120)
    for pulse in (1, 5, 8, 9):  # the caption stands below, on black too
        assert np.abs(with_[pulse - 1, lower] - without[pulse - 1, lower]).mean() > 10
        assert np.abs(with_[pulse - 1, upper] - without[pulse - 1, upper]).mean() < 5
    for pulse in (5, 6, 8, 9):
        assert np.median(without[pulse - 1]) < 3
        assert without[pulse - 1, 45:75].max() > 180
    assert np.abs(without[4] - without[7]).max() > 100  # "missing" and "lost"
    np.testing.assert_allclose(without[4], without[5], atol=20)
    export(gap, ExportOrder(cameras=("K2",), quality=Quality.BEST, language=Language.NB), plain)
    norwegian = np.array([picture for _, picture in _decoded(plain)], float)
    for pulse in (5, 8):  # "mangler" and "tapt"
        assert np.abs(norwegian[pulse - 1] - without[pulse - 1]).max() > 100


def test_worse_quality_is_smaller(gap: Path, tmp_path: Path) -> None:
    sizes = []
    for quality in Quality:
        export(gap, ExportOrder(quality=quality), tmp_path / "jump.mp4")
        sizes.append((tmp_path / "jump.mp4").stat().st_size)
    assert sizes == sorted(sizes)
    assert sizes[0] < sizes[2] / 2


@pytest.mark.parametrize("extra", [["--separate"], ["--camera", "K1"]])
def test_one_camera_alone_keeps_its_size_and_several_are_made_smaller(extra: list[str], tmp_path: Path) -> None:
    log = tmp_path / "log.mcap"
    write_log(log, (ALL_OK,) * 2, shape=(64, 3 * 4400))
    assert main(["export", str(log), "--out", str(tmp_path / "all.mp4")]) == 0
    assert main(["export", str(log), "--out", str(tmp_path / "one.mp4"), *extra]) == 0
    shapes = {path.stem: next(_decoded(path))[1].shape for path in tmp_path.glob("*.mp4")}
    assert shapes.pop("all")[1] == 4096
    assert set(shapes.values()) == {(64, 4400)}
    assert len(shapes) == (3 if extra == ["--separate"] else 1)


@pytest.mark.parametrize(("kind", "ending"), [(Kind.PNG, "png"), (Kind.TIFF, "tif")])
def test_a_folder_has_each_frame_that_came_and_the_table(gap: Path, tmp_path: Path, kind: Kind, ending: str) -> None:
    folder = tmp_path / "jump"
    assert export(gap, ExportOrder(kind=kind, first=4), folder) == 9
    images = {int(tag.pulse): image.copy() for tag, image in triplets(gap)}
    there = {file.relative_to(folder).as_posix() for file in folder.rglob("*.*")}
    frames = {(camera, pulse) for camera in (1, 2, 3) for pulse in (4, 7, 8, 10, 11, 12)} - {(2, 8)}
    assert there == {"tags.csv", *(f"K{camera}/K{camera}_{pulse:06d}.{ending}" for camera, pulse in frames)}
    for camera, pulse in frames:
        file = folder / f"K{camera}" / f"K{camera}_{pulse:06d}.{ending}"
        picture = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
        np.testing.assert_array_equal(picture, images[pulse][:, 160 * (camera - 1) : 160 * camera])
    with (folder / "tags.csv").open(newline="") as file_:
        rows = list(csv.DictReader(file_))
    assert [int(row["pulse"]) for row in rows] == list(range(4, 13))
    assert [row["K2_status"] for row in rows] == [
        "ok", "missing", "missing", "ok", "lost", "absent", "ok", "ok", "ok",
    ]  # fmt: skip
    assert rows[0]["time_utc_ns"] == str(make_tag(4).time)
    assert (rows[0]["K1_frame_id"], rows[0]["K1_offset_us"], rows[1]["time_utc_ns"]) == ("11", "-1.5", "")


def test_a_folder_with_something_in_it_is_left_alone(gap: Path, tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match="holds files already"):
        export(gap, ExportOrder(kind=Kind.PNG), tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["log.mcap"]


@pytest.mark.parametrize("name", ["jump.mp4", "jump.mkv", "jump.csv", "sheet.png", "jump"])
def test_a_full_disk_is_said_and_nothing_is_left(tmp_path: Path, name: str) -> None:
    write_log(tmp_path / "log.mcap", (ALL_OK,) * 200, SHAPE)
    out = tmp_path / "out"
    out.mkdir()
    (out / "jump.mp4").write_bytes(b"older")
    options = ["--force", *(["--contact-sheet"] if name == "sheet.png" else [])]
    command = [sys.executable, "-m", "svev", "export", str(tmp_path / "log.mcap"), "--out", str(out / name), *options]

    def small_disk() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))  # a file of this size is as a full disk

    done = subprocess.run(
        command, preexec_fn=small_disk, capture_output=True, text=True, timeout=60, check=False, env=os.environ
    )
    assert done.returncode == 4, done.stderr
    assert "the disk refuses (File too large): write to another one" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert [file.name for file in out.iterdir()] == ["jump.mp4"]
    assert (out / "jump.mp4").read_bytes() == b"older"


@pytest.mark.parametrize(
    ("order", "words"),
    [
        (ExportOrder(cameras=("K4",)), "has no camera K4; choose among K1, K2, K3"),
        (ExportOrder(first=13), "has pulses 1 to 12; choose among them"),
        (ExportOrder(last=99), "has pulses 1 to 12; choose among them"),
    ],
)
def test_what_the_log_has_not_is_named(gap: Path, tmp_path: Path, order: ExportOrder, words: str) -> None:
    with pytest.raises(BadInputError, match=words):
        export(gap, order, tmp_path / "jump.mp4")
    assert [file.name for file in tmp_path.iterdir()] == ["log.mcap"]


def test_a_damaged_image_is_a_missing_frame(tmp_path: Path) -> None:
    log = tmp_path / "log.mcap"
    write_log(log, (ALL_OK,) * 4, SHAPE)
    with LogReader(log) as reader:
        chunk = [item for item in reader.items() if isinstance(item, Chunk) and item.length > 10_000][2]
    content = bytearray(log.read_bytes())
    content[chunk.offset + chunk.length // 2] ^= 0xFF
    log.write_bytes(content)
    export(log, ExportOrder(kind=Kind.FFV1), tmp_path / "jump.mkv")
    pictures = [picture for _, picture in _decoded(tmp_path / "jump.mkv")]
    assert [bool(np.median(picture) == 0) for picture in pictures] == [False, False, True, False]


def test_absurd_numbers_of_pulses_are_no_endless_video(tmp_path: Path) -> None:
    buffers = TripletBuffers(SHAPE, 4)
    with open_writer(tmp_path / "log.mcap", buffers) as log:
        for pulse in (1, 2, 4_000_000_000):
            write_pulse(log, buffers, make_tag(pulse, (MISSED, OK, OK), SHAPE, make_tag(min(pulse, 3)).time))
    buffers.close()
    assert main(["export", str(tmp_path / "log.mcap"), "--out", str(tmp_path / "jump.mp4")]) == 3


def test_the_command_writes_one_video_for_each_camera(
    gap: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code = main(["export", str(gap), "--out", str(tmp_path / "jump.mp4"), "--separate", "--from", "2", "--to", "4"])
    assert (code, capsys.readouterr().err) == (0, "")
    for name in ("K1", "K2", "K3"):
        pictures = [picture for _, picture in _decoded(tmp_path / f"jump_{name}.mp4")]
        assert [picture.shape for picture in pictures] == [(120, 160)] * 3
    assert main(["export", str(gap), "--out", str(tmp_path / "jump.avi")]) == 2
    assert "name a .mp4" in capsys.readouterr().err
    assert main(["export", str(gap), "--out", str(tmp_path / "a.csv"), "--slow", "2"]) == 2
