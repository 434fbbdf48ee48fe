"""Videos say how their numbers are to be read as light, and what is read so is what was given."""

from pathlib import Path

import av
import numpy as np
import pytest
from av.video.reformatter import Colorspace

from analysis.film.video_file import VP9, Codec, VideoFile, h264


@pytest.mark.parametrize(("ending", "codec"), [(".mp4", h264(1)), (".webm", VP9)])
def test_range_matrix_and_primaries_are_told_and_true(tmp_path: Path, ending: str, codec: Codec) -> None:
    picture = np.zeros((64, 96, 3), np.uint8)
    for column, colour in enumerate([(0, 0, 255), (0, 255, 0), (255, 0, 0), (255, 255, 255), (128, 128, 128)]):
        picture[:, column * 16 : column * 16 + 16] = colour
    path = tmp_path / f"video{ending}"
    video = VideoFile(path, ending, picture, 30.0, codec)
    for number in range(3):
        video.add(picture, number * 33_333)
    video.finish()
    video.close()
    with av.open(str(path)) as read:
        context = read.streams.video[0].codec_context
        frame = next(read.decode(video=0))
        # ITU-T H.273: limited range, matrix and primaries of BT.709, transfer of sRGB
        assert (context.color_range, context.colorspace, context.color_primaries, context.color_trc) == (1, 1, 1, 13)
        shown = frame.reformat(format="bgr24", src_colorspace=Colorspace.ITU709).to_ndarray()
    middles = slice(8, 80, 16)
    assert np.abs(shown[32, middles].astype(int) - picture[32, middles]).max() <= 12


def test_grey_from_black_to_white_comes_back(tmp_path: Path) -> None:
    picture = np.tile(np.arange(0, 256, 4, dtype=np.uint8), (32, 1)).repeat(2, axis=1)
    path = tmp_path / "grey.mp4"
    video = VideoFile(path, ".mp4", picture, 30.0, h264(1))
    video.add(picture, 0)
    video.finish()
    video.close()
    with av.open(str(path)) as read:
        shown = next(read.decode(video=0)).reformat(format="gray").to_ndarray()
    assert np.abs(shown.astype(int) - picture).max() <= 4
