"""`svev import`: a log of films that every other command takes, and that says that no trigger stands behind it."""

import errno
import json
import re
from pathlib import Path

import numpy as np
import pytest

from analysis.procedure.log_facts import log_facts
from recorder.checking.verify import Verdict, verify
from recorder.importing.films import ImportOrder
from recorder.importing.run import Import
from recorder.reading.info import info
from recorder.reading.triplets import triplets
from rig.clocks import UtcNs
from rig.errors import StorageError
from rig.images.pixels import Pixels
from rig.settings.file import load_rig
from svev.cli import main
from tests.recorder.importing.films import picture, write_folder, write_video
from tests.recorder.merging.test_merge import refusing


@pytest.fixture
def films(tmp_path: Path) -> tuple[Path, Path, Path]:
    """Films of three cameras, of different kind, size and length."""
    left = write_folder(tmp_path / "left", range(101, 113))
    middle = write_folder(tmp_path / "middle", range(8), "{:03d}.bmp", size=(60, 40))
    right = write_video(tmp_path / "right.mkv", [picture(number) for number in range(1, 11)])
    return left, middle, right


def test_a_log_of_films_is_a_log(
    films: tuple[Path, Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (films[0] / "frame_104.png").write_bytes(b"no image")
    out = tmp_path / "old.mcap"
    given = [str(films[0]), f"K2={films[1]}", str(films[2])]
    assert main(["import", *given, "-o", str(out), "--rate", "50", "--start", "left=102", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["pulses"] == 11
    assert report["causes"] == {"lost": 0, "missed": 0, "damaged": 1, "absent": 4}
    assert report["findings"] == [
        f"pulse 3: left damaged: {films[0]}/frame_104.png cannot be read as an image",
        "pulse 9: K2 absent: middle has no more frames, others have",
        "pulse 11: right absent: right.mkv has no more frames, others have",
    ]
    checked = verify(out)
    assert checked.verdict is Verdict.PARTIAL
    assert checked.findings == checked.off_time == ()
    assert checked.recounted.agrees
    said = checked.events[0].message
    assert said.startswith("imported from films, without a trigger: pulses are told by frame number")
    for pulse, (tag, image) in enumerate(triplets(out), 1):
        frames = {camera.name: camera for camera in tag.cameras}
        assert tag.time == round((pulse - 1) * 1e9 / 50)
        assert tag.shape == (48, 188)
        expected = picture(101 + pulse) if pulse != 3 else np.zeros((48, 64))
        assert np.array_equal(image[frames["left"].part], expected)
        expected = picture(pulse - 1, (60, 40)) if pulse < 9 else np.zeros((40, 60))
        assert np.array_equal(image[frames["K2"].part], expected)
        assert frames["left"].frame_id == (None if pulse == 3 else 101 + pulse)
        assert all(camera.offset_us is None and camera.device_time is None for camera in frames.values())
    assert "imported" in info(out).to_json()
    assert log_facts(out).messages[0].text.startswith("exposure time of left, K2, right is unknown")
    assert "without a trigger" in log_facts(out).messages[1].text


def test_a_frame_that_one_camera_dropped_mixes_no_pulses(tmp_path: Path) -> None:
    left = write_folder(tmp_path / "left", range(1, 11))
    numbers = [1, 2, 3, 4, 6, 7, 8, 9, 10]
    ticks = [20 * (number - 1) for number in numbers]
    right = write_video(tmp_path / "right.mkv", [picture(number) for number in numbers], ticks=ticks)
    report = Import(ImportOrder([("K1", left), ("K2", right)], 50.0, tmp_path / "films.mcap")).run()
    assert report.findings == (
        f"pulse 5: K2 lost: {right} has no frame 5, by the times of those beside it",
        "K2: frames left out among its times: 1; these frames are lost",
    )
    assert verify(report.path).verdict is Verdict.PARTIAL
    for pulse, (tag, image) in enumerate(triplets(report.path), 1):
        assert [camera.status.value for camera in tag.cameras] == ["ok", "lost" if pulse == 5 else "ok"]
        for camera in tag.cameras:
            there = camera.status.value == "ok"
            assert np.array_equal(image[camera.part], picture(pulse) if there else np.zeros((48, 64)))


def test_other_commands_take_it(
    films: tuple[Path, Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(tmp_path / "old.mcap")
    assert main(["import", *map(str, films), "-o", out, "--rate", "50"]) == 0
    assert main(["verify", out]) == 0
    assert main(["verify", "--ledger", out]) == 0
    assert main(["info", out]) == 0
    assert re.search(r"^imported +from films, without a trigger", capsys.readouterr().out, re.MULTILINE)
    assert main(["export", out, "--out", str(tmp_path / "film.mkv")]) == 0
    assert main(["export", out, "--out", str(tmp_path / "pictures")]) == 0
    assert main(["recover", out, "-o", str(tmp_path / "copy.mcap")]) == 0
    assert info(tmp_path / "copy.mcap").imported == info(Path(out)).imported


def test_pictures_of_a_log_become_the_log_again(films: tuple[Path, Path, Path], tmp_path: Path) -> None:
    out, again = tmp_path / "old.mcap", tmp_path / "again.mcap"
    assert main(["import", *map(str, films), "-o", str(out), "--rate", "50", "--to", "8"]) == 0
    assert main(["export", str(out), "--out", str(tmp_path / "pictures")]) == 0
    folders = [str(tmp_path / "pictures" / name) for name in ("left", "middle", "right")]
    assert main(["import", *folders, "-o", str(again), "--rate", "50"]) == 0
    for (_, one), (_, two) in zip(triplets(out), triplets(again), strict=True):
        assert np.array_equal(one, two)


def test_a_part_keeps_its_times(films: tuple[Path, Path, Path], tmp_path: Path) -> None:
    order = ImportOrder(
        [("K1", films[0]), ("K2", films[2])], 50.0, tmp_path / "o.mcap", first=3, last=6, date=UtcNs(10**18)
    )
    report = Import(order).run()
    assert report.fields["date"] == "2001-09-09 01:46:40 UTC by --date"
    tags = [tag for tag, _ in triplets(order.out)]
    assert [tag.pulse for tag in tags] == [1, 2, 3, 4]
    assert [tag.cameras[1].frame_id for tag in tags] == [3, 4, 5, 6]
    assert tags[0].time == 10**18 + 40_000_000
    assert verify(order.out).verdict is Verdict.CLEAN


def test_the_flash_is_pulse_1(tmp_path: Path) -> None:
    dark = [np.full((48, 64), 60, np.uint8) + (picture(number) & 1) for number in range(30)]
    for name, at in (("K1", 7), ("K2", 12)):
        frames = list(dark)
        frames[at] = frames[at] + 90
        write_video(tmp_path / f"{name}.mkv", frames)
    cameras = [(name, tmp_path / f"{name}.mkv") for name in ("K1", "K2")]
    report = Import(ImportOrder(cameras, 50.0, tmp_path / "o.mcap", flash=True)).run()
    assert [report.fields[f"first_frame_{place}"] for place in (1, 2)] == ["8", "13"]
    assert report.fields["synchrony"] == "unknown, at the flash less than one frame"
    _, image = next(iter(triplets(tmp_path / "o.mcap")))
    assert image.min() >= 150
    write_video(tmp_path / "K2.mkv", dark)
    again = [
        "import",
        str(tmp_path / "K1.mkv"),
        str(tmp_path / "K2.mkv"),
        "-o",
        str(tmp_path / "p.mcap"),
        "--rate",
        "50",
    ]
    assert main([*again, "--flash"]) == 2
    assert not (tmp_path / "p.mcap").exists()


def test_more_bits_stay(tmp_path: Path) -> None:
    deep = write_folder(tmp_path / "K1", range(4), kind=np.uint16)
    flat = write_folder(tmp_path / "K3", range(4))
    order = ImportOrder([("K1", deep), ("K3", flat)], 50.0, tmp_path / "o.mcap")
    report = Import(order).run()
    assert report.findings == ("K3: its 8 bits became 16; white stays white",)
    tag, image = next(iter(triplets(order.out)))
    assert tag.pixels == Pixels("mono16", 16)
    assert np.array_equal(image[:, :64], picture(0, kind=np.uint16))
    assert np.array_equal(image[:, 64:], picture(0).astype(np.uint16) * 257)
    few = ["import", str(deep), "-o", str(tmp_path / "p.mcap"), "--rate", "50", "--bits", "12"]
    assert main(few) == 2


def test_the_rig_file_names_the_cameras(films: tuple[Path, Path, Path], tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    cameras = [
        f'[[cameras]]\nname = "{name}"\nbackend = "replay"\naddress = "x.mcap"\nexposure_us = 500\n'
        f"region = {{ width = {width}, height = {height} }}\n"
        for name, width, height in (("A", 64, 48), ("B", 60, 40), ("C", 64, 48))
    ]
    rig.write_text('name = "old hill"\n' + "\n".join(cameras))
    out = tmp_path / "old.mcap"
    command = ["import", *map(str, films), "-o", str(out), "--rate", "50", "--rig", str(rig)]
    assert main(command) == 0
    assert info(out).cameras == ("A", "B", "C")
    assert log_facts(out).cameras["B"].size == (60, 40)
    assert log_facts(out).cameras["B"].exposure_s == 0.0005
    rig.write_text(rig.read_text().replace("width = 60", "width = 62"))
    assert main([*command, "--force"]) == 2
    assert info(out).cameras == ("A", "B", "C")


def test_the_rig_file_of_an_import_is_one(films: tuple[Path, Path, Path], tmp_path: Path) -> None:
    out = tmp_path / 'o"dd.mcap'
    Import(ImportOrder([("K1", films[0]), ("K2", films[1])], 49.5, out)).run()
    text = out.read_bytes()
    begin = text.index(b"# Made by svev import")
    (tmp_path / "rig.toml").write_bytes(text[begin : text.index(b'"Mono8"\n', text.index(b'"K2"')) + 8])
    rig = load_rig(tmp_path / "rig.toml")
    assert rig.trigger.rate_hz == 49.5
    assert [camera.region.width for camera in rig.cameras] == [64, 60]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ([], "--rate is missing"),
        (["--rate", "5000"], "--rate 5000: give 0.1 to 1000"),
        (["--rate", "50", "--start", "K9=3"], "--start names K9, and the cameras are left, right"),
        (["--rate", "50", "--start", "left"], "--start left: give camera and frame"),
        (["--rate", "50", "--start", "left=101", "--flash"], "give one of them"),
        (["--rate", "50", "--from", "90"], "no film has a frame for pulse 90"),
        (["--rate", "50", "--bits", "12"], "is for images of 16 bits"),
        (["--rate", "50", "--bits", "11"], "a log holds 10, 12 or 16 bits"),
        (["--rate", "50", "--date", "2009-02-14"], "with its time zone"),
        (["--rate", "50", "--flash"], "--start, for each camera"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(
    options: list[str], said: str, films: tuple[Path, Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = set(tmp_path.iterdir())
    assert main(["import", str(films[0]), str(films[2]), "-o", str(tmp_path / "o.mcap"), *options]) == 2
    told = capsys.readouterr().err
    assert said in told
    assert told.count("\n") == 1
    assert set(tmp_path.iterdir()) == before


def test_no_log_is_replaced_unless_that_is_said(
    films: tuple[Path, Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "old.mcap"
    out.write_text("precious")
    command = ["import", str(films[0]), "-o", str(out), "--rate", "50"]
    assert main(command) == 2
    assert "exists already; choose another name, or give --force" in capsys.readouterr().err
    (films[0] / "frame_105.png").write_bytes(b"")
    (films[0] / "frame_106.png").write_bytes(b"")
    assert main([*command, "--force"]) == 2
    assert out.read_text() == "precious"
    assert main([*command, "--force", "--to", "3"]) == 0
    assert verify(out).verdict is Verdict.CLEAN


def test_a_full_disk_leaves_nothing(
    films: tuple[Path, Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = set(tmp_path.iterdir())
    monkeypatch.setattr("os.pwrite", refusing(errno.ENOSPC))
    with pytest.raises(StorageError, match=r"o.mcap: the disk is full: .*; nothing of the new log is left"):
        Import(ImportOrder([("K1", films[0])], 50.0, tmp_path / "o.mcap")).run()
    assert set(tmp_path.iterdir()) == before
