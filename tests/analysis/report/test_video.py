"""The video with overlay: every pulse at its time; without loss, nothing changes but what is drawn."""

from pathlib import Path

import av
import numpy as np
import pytest

from analysis.report.frames import frames_of
from analysis.report.video import write_video
from rig.errors import BadInputError
from tests.analysis.report.jumps import SHAPE, imaged_pulses, measured_recording, measurements
from tests.analysis.simulated import RATE_HZ, true_cameras


def test_every_pulse_stands_at_its_time(jump_log: Path, tmp_path: Path) -> None:
    steps: list[tuple[int, int]] = []
    out = tmp_path / "overlay.mp4"
    count = write_video(
        measured_recording(),
        measurements(),
        true_cameras(),
        jump_log,
        out,
        progress=lambda done, all_: steps.append((done, all_)),
    )
    pulses = np.array(imaged_pulses())
    assert count == len(pulses) == len(steps)
    with av.open(str(out)) as video:
        stream = video.streams.video[0]
        assert stream.codec_context.name == "h264"
        times = [frame.time for frame in video.decode(stream)]
    expected = (pulses - pulses[0]) / RATE_HZ
    assert times == pytest.approx(expected, abs=1e-5)  # each step is rounded to 1 us


def test_without_loss_only_the_overlay_differs(jump_log: Path, tmp_path: Path) -> None:
    out = tmp_path / "overlay.mkv"
    write_video(measured_recording(), measurements(), true_cameras(), jump_log, out, lossless=True)
    images = [image.copy() for _, image in frames_of(jump_log, imaged_pulses())]
    with av.open(str(out)) as video:
        pictures = [frame.to_ndarray(format="bgr24") for frame in video.decode(video=0)]
    assert pictures[0].shape[1] == SHAPE[1]
    assert pictures[5][SHAPE[0] :].any()  # the jumper enlarged
    changed = [
        (picture[: SHAPE[0]] != image[:, :, None]).any(axis=2).mean()
        for picture, image in zip(pictures, images, strict=True)
    ]
    assert max(changed) < 0.03
    assert min(changed[1:-1]) > changed[0]  # before the jump there are only words


def test_what_cannot_be_done_is_said_in_one_line(jump_log: Path, tmp_path: Path) -> None:
    def write(out: Path, *, lossless: bool = False) -> None:
        write_video(measured_recording(), measurements(), true_cameras(), jump_log, out, lossless=lossless)

    with pytest.raises(BadInputError, match=r"needs the ending \.mkv"):
        write(tmp_path / "overlay.webm", lossless=True)
    with pytest.raises(BadInputError, match="cannot be written"):
        write(tmp_path / "nowhere" / "overlay.mp4")
