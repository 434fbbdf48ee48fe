"""Folders and videos give their frames by number, in grey, and say what is wrong with them."""

import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

from recorder.importing.flash import flashes
from recorder.importing.image_folder import ImageFolder
from recorder.importing.names import named
from recorder.importing.source import Film
from recorder.importing.video import Video
from rig.errors import BadInputError
from rig.frame import FrameStatus
from rig.images.pixels import Stored
from rig.settings.file import CONFIG, load_rig
from tests.recorder.importing.films import SIZE, picture, write_folder, write_video

FRAMES = [picture(number) for number in range(1, 11)]


def pixels_of(film: Film, number: int) -> Stored:
    """The frame of a film."""
    pixels = next(film.frames(number)).pixels
    assert pixels is not None
    return pixels


def test_images_are_sorted_as_people_count(tmp_path: Path) -> None:
    film = ImageFolder(write_folder(tmp_path / "K1", [8, 9, 10, 11, 100, 12, *range(13, 100)]))
    assert [taken.number for taken in film.frames(8)] == list(range(8, 101))
    assert film.expected == 93
    assert film.remarks == ()
    assert np.array_equal(pixels_of(film, 12), picture(12))


def test_a_number_that_is_left_out_is_a_lost_frame(tmp_path: Path) -> None:
    film = ImageFolder(write_folder(tmp_path / "K1", [2, 4, 6, 10, 12], "a1_{:04d}.tif"))
    assert [(taken.number, taken.status.value) for taken in film.frames(2)] == [
        (2, "ok"), (4, "ok"), (6, "ok"), (8, "lost"), (10, "ok"), (12, "ok"),
    ]  # fmt: skip
    assert film.remarks == ("numbers left out among its file names: 1; these frames are lost",)


@pytest.mark.parametrize("numbers", [[1000, 1033, 1067, 1100], [1, 500, 501], [20241101, 20241102, 20250101]])
def test_names_that_count_something_else_count_nothing(numbers: list[int], tmp_path: Path) -> None:
    film = ImageFolder(write_folder(tmp_path / "K1", numbers))
    assert [taken.number for taken in film.frames(1)] == list(range(1, len(numbers) + 1))
    assert film.first == 1


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["120001_0998", "120001_0999", "120002_1001", "120002_1002"], [998, 999, 1001, 1002]),
        (["120001_5", "120002_6", "120004_8"], [5, 6, 8]),
        (["120001_1", "120001_2", "120002_1", "120002_2"], [1, 2, 3, 4]),
        (["10_1", "11_2", "13_3", "14_5"], [1, 2, 3, 4]),
    ],
)
def test_the_counter_is_found_beside_the_time(names: list[str], expected: list[int], tmp_path: Path) -> None:
    (tmp_path / "K1").mkdir()
    for name in names:
        cv2.imwrite(str(tmp_path / "K1" / f"{name}.png"), picture(1))
    film = ImageFolder(tmp_path / "K1")
    whole = [taken.number for taken in film.frames(film.first) if taken.status is FrameStatus.OK]
    assert whole == expected


def test_an_unreadable_image_between_whole_ones_is_damaged(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "K1", range(5))
    whole = (folder / "frame_2.png").read_bytes()
    (folder / "frame_2.png").write_bytes(whole[: len(whole) // 2])
    damaged = list(ImageFolder(folder).frames(0))[2]
    assert damaged.status is FrameStatus.DAMAGED
    assert damaged.pixels is None
    assert damaged.why == f"{folder}/frame_2.png cannot be read as an image"
    (folder / "frame_3.png").write_bytes(b"")
    with pytest.raises(
        BadInputError, match=r"frame_2.png cannot be read as an image, and the frame after it too: .*frame_3"
    ):
        list(ImageFolder(folder).frames(0))


def test_images_that_do_not_belong_together_are_named(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "K1", range(5))
    cv2.imwrite(str(folder / "frame_5.png"), picture(1, (60, 48)))
    with pytest.raises(BadInputError, match=r"frame_5.png: is 60 x 48 px, the images before it are 64 x 48"):
        list(ImageFolder(folder).frames(0))
    cv2.imwrite(str(folder / "frame_5.png"), picture(1, kind=np.uint16))
    with pytest.raises(BadInputError, match=r"frame_5.png: has 16 bits, the images before it have 8"):
        list(ImageFolder(folder).frames(0))
    cv2.imwrite(str(folder / "frame_05.png"), picture(1))
    with pytest.raises(BadInputError, match=r"frame_05.png and frame_5.png have the same number"):
        ImageFolder(folder)
    with pytest.raises(BadInputError, match="holds no images"):
        ImageFolder(tmp_path)
    with pytest.raises(BadInputError, match="has no frame 9: its frames are 0 to 3; correct --start"):
        list(ImageFolder(write_folder(tmp_path / "K2", range(4))).frames(9))


def test_colours_become_grey(tmp_path: Path) -> None:
    (tmp_path / "K1").mkdir()
    red_green_blue = np.array([[[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255]]], np.uint8)
    cv2.imwrite(str(tmp_path / "K1" / "1.png"), red_green_blue[:, :, ::-1])
    assert pixels_of(ImageFolder(tmp_path / "K1"), 1).tolist() == [[76, 150, 29, 255]]


def test_a_video_without_loss_gives_its_pixels(tmp_path: Path) -> None:
    film = Video(write_video(tmp_path / "K1.mkv", FRAMES), 50)
    taken = list(film.frames(3))
    assert [each.number for each in taken] == list(range(3, 11))
    assert all(np.array_equal(pixels_of(film, number), FRAMES[number - 1]) for number in (1, 5, 10))
    assert film.remarks == ()
    assert film.expected == 10
    assert film.date is None


@pytest.mark.parametrize(
    ("stored", "bits"),
    [
        ("yuv420p", 8),
        ("yuv420p10le", 10),
        ("yuv422p10le", 10),
        ("gbrp10le", 10),
        ("gray12le", 12),
        ("bgr0", 8),
    ],
)
def test_luma_is_spread_over_all_values(stored: str, bits: int, tmp_path: Path) -> None:
    ramp = np.tile(np.arange(256, dtype=np.uint8), (48, 1))
    film = Video(write_video(tmp_path / "K1.mkv", [ramp] * 3, stored=stored), 50)
    assert film.bits == bits
    found = pixels_of(film, 1)
    assert np.abs(found * (255 / ((1 << bits) - 1)) - ramp).max() < 1.6  # FFmpeg rounds limited range twice


@pytest.mark.parametrize(("rate", "played"), [(50, 50), (30, 30), (240, 240), (240, 30)])
@pytest.mark.parametrize("dropped", [(6,), (2, 3, 9), (11,)])
def test_a_frame_that_was_dropped_is_lost_and_those_behind_it_keep_their_numbers(
    dropped: tuple[int, ...], rate: int, played: int, tmp_path: Path
) -> None:
    numbers = [number for number in range(1, 13) if number not in dropped]
    frames = [picture(number) for number in numbers]
    ticks = [round((number - 1) * 1000 / played) for number in numbers]
    film = Video(write_video(tmp_path / "K1.mkv", frames, ticks=ticks), rate)
    taken = list(film.frames(1))
    assert [each.number for each in taken] == list(range(1, 13))
    assert [each.number for each in taken if each.status is FrameStatus.LOST] == list(dropped)
    assert all(np.array_equal(each.pixels, picture(each.number)) for each in taken if each.pixels is not None), (
        "each frame has the number of its time"
    )
    assert f"frames left out among its times: {len(dropped)}; these frames are lost" in film.remarks
    assert not any("evenly" in remark for remark in film.remarks)
    assert next(film.frames(dropped[0])).status is FrameStatus.LOST


@pytest.mark.parametrize("stored", ["uyvy422", "yuyv422", "nv12"])
def test_pixels_of_cameras_without_compression_are_their_luma(stored: str, tmp_path: Path) -> None:
    ramp = np.tile(np.arange(256, dtype=np.uint8), (48, 1))
    film = Video(write_video(tmp_path / "K1.avi", [ramp] * 3, codec="rawvideo", stored=stored), 50)
    assert (film.bits, film.kind) == (8, f"video, rawvideo, {stored}")
    assert np.abs(pixels_of(film, 1) - ramp.astype(float)).max() < 1.6


def test_interlaced_frames_are_said(tmp_path: Path) -> None:
    options = {"flags": "+ildct", "x264-params": "tff=1"}
    path = write_video(tmp_path / "K1.mkv", FRAMES, codec="libx264", stored="yuv420p", options=options)
    assert any(remark.startswith("its frames are interlaced") for remark in Video(path, 50).remarks)


def test_a_phone_held_upright_gives_frames_as_its_camera_had_them(tmp_path: Path) -> None:
    """The file asks to be shown turned by a matrix in its track's header (ISO 14496-12, 8.3.2)."""
    path = write_video(tmp_path / "K1.mp4", FRAMES, codec="libx264", stored="yuv420p")
    content = path.read_bytes()
    matrix = content.index(b"tkhd") + 4 + 40
    turned = struct.pack(">9i", 0, 1 << 16, 0, -(1 << 16), 0, 0, 0, 0, 1 << 30)
    assert struct.unpack(">9i", content[matrix : matrix + 36]) == (1 << 16, 0, 0, 0, 1 << 16, 0, 0, 0, 1 << 30)
    path.write_bytes(content[:matrix] + turned + content[matrix + 36 :])
    film = Video(path, 50)
    assert film.size == SIZE
    assert next(film.frames(1)).pixels.shape == SIZE[::-1]  # type: ignore[union-attr]
    assert any("turned by -90 degrees" in remark for remark in film.remarks)


@pytest.mark.parametrize(("name", "codec"), [("K1.mp4", "libx264"), ("K1.mov", "mjpeg"), ("K1.webm", "libvpx")])
def test_a_dropped_frame_is_lost_in_every_container(name: str, codec: str, tmp_path: Path) -> None:
    numbers = [*range(1, 20), *range(21, 41)]
    frames = [np.full(picture(1).shape, 20 + 5 * number, np.uint8) for number in numbers]
    ticks = [40 * (number - 1) for number in numbers]
    path = write_video(
        tmp_path / name, frames, rate=25, codec=codec, stored="yuvj420p" if codec == "mjpeg" else "yuv420p", ticks=ticks
    )
    film = Video(path, 25)
    taken = {each.number: each for each in film.frames(1)}
    assert sorted(taken) == list(range(1, 41))
    assert [number for number, each in taken.items() if each.status is FrameStatus.LOST] == [20]
    bright = [float(each.pixels.mean()) for _, each in sorted(taken.items()) if each.pixels is not None]
    assert bright == sorted(bright)
    assert film.remarks == ("frames left out among its times: 1; these frames are lost",)


def test_frames_that_do_not_come_evenly_are_said(tmp_path: Path) -> None:
    ticks = [0, 20, 40, 60, 80, 110, 120, 140, 160, 180]
    film = Video(write_video(tmp_path / "K1.mkv", FRAMES, ticks=ticks), 50)
    assert [each.number for each in film.frames(1)] == list(range(1, 11))
    assert "frame 6 is 10.0 ms (0.50 frames) later than the rate says" in film.remarks[-1]
    hasty = [0, 20, 40, 60, 100, 101, 120, 140, 160, 180]  # one that was written late is not dropped
    film = Video(write_video(tmp_path / "K3.mkv", FRAMES, ticks=hasty), 50)
    assert [each.number for each in film.frames(1)] == list(range(1, 11))
    slow = Video(write_video(tmp_path / "K2.mkv", FRAMES), 200)
    list(slow.frames(1))
    assert slow.remarks == ("the file plays 50 frames a second; --rate says that 200 were taken",)


def test_a_video_that_breaks_off_says_where(tmp_path: Path) -> None:
    path = write_video(tmp_path / "K1.mkv", FRAMES * 4)
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 3 // 4])
    film = Video(path, 50)
    taken = list(film.frames(1))
    assert 20 < len(taken) < 35
    assert any(f"after frame {len(taken)}" in remark for remark in film.remarks)


def test_what_is_no_video_is_refused(tmp_path: Path) -> None:
    write_video(tmp_path / "K1.mp4", FRAMES, codec="libx264", stored="yuv420p")
    (tmp_path / "list.m3u8").write_text("#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1.0,\nK1.mp4\n#EXT-X-ENDLIST\n")
    (tmp_path / "half.mp4").write_bytes((tmp_path / "K1.mp4").read_bytes()[:5000])
    (tmp_path / "empty.avi").write_bytes(b"")
    for name in ("list.m3u8", "half.mp4", "empty.avi"):
        with pytest.raises(BadInputError, match=name):
            Video(tmp_path / name, 50)
    with pytest.raises(BadInputError, match="has no frame 11: it has 10 frames"):
        list(Video(tmp_path / "K1.mp4", 50).frames(11))


def test_the_date_of_a_video_is_read(tmp_path: Path) -> None:
    metadata = {"creation_time": "2009-02-14T12:30:00.500000Z"}
    film = Video(write_video(tmp_path / "K1.mkv", FRAMES, metadata=metadata), 50)
    assert film.date == 1_234_614_600_500_000_000


def test_a_flash_is_found_and_a_jumper_is_not_taken_for_one() -> None:
    rng = np.random.default_rng(3)
    quiet = 0.4 + rng.normal(0, 2e-5, 300) + np.linspace(0, 0.02, 300)
    jumper = 0.004 * np.exp(-(((np.arange(300) - 150) / 8) ** 2))
    assert flashes(quiet) == []
    flash = np.zeros(300)
    flash[[40, 41]] = 0.01, 0.05  # begins while the shutter is open
    assert flashes(quiet + jumper + flash) == [40]
    assert flashes(quiet + flash + np.roll(flash, 100)) == [40, 140]
    assert flashes(np.full(10, 0.5)) == []
    with_gap = quiet + flash
    with_gap[30] = np.nan
    assert flashes(with_gap) == [40]


def test_cameras_get_names(tmp_path: Path) -> None:
    for name in ("left", "2. Kamera øst", "K3=x"):
        (tmp_path / name).mkdir()
    left, east, odd = (str(tmp_path / name) for name in ("left", "2. Kamera øst", "K3=x"))
    assert [name for name, _ in named([left, east, odd], None)] == ["left", "K2_Kamera_st", "K3_x"]
    assert [name for name, _ in named([f"A={left}", east, f"B={odd}"], None)] == ["A", "K2_Kamera_st", "B"]
    rig = load_rig(CONFIG / "rigs" / "sim.toml")
    assert [name for name, _ in named([left, f"K2={east}", odd], rig)] == ["K1", "K2", "K3"]
    for sources, said in (
        ([left, left], "two films have the camera name left"),
        ([f"1x={left}"], '"1x" of 1x='),
        ([str(tmp_path / "no")], "no such folder or video"),
        ([left] * 9, "a log takes 1 to 8 cameras"),
    ):
        with pytest.raises(BadInputError, match=said):
            named(sources, None)
    with pytest.raises(BadInputError, match="and 2 films are given"):
        named([left, odd], rig)
    with pytest.raises(BadInputError, match="is named K2, and at its place the rig file has K1"):
        named([f"K2={left}", east, odd], rig)
