"""Videos as FFmpeg's own program reads them, which browsers, editors and digitizers are built on."""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from analysis.film.export import export
from rig.api.export import ExportOrder, Kind
from tests.recorder.logs import ALL_OK, PERIOD_NS, write_log

pytestmark = pytest.mark.skipif(
    shutil.which("ffprobe") is None, reason="FFmpeg's programs are missing: make installs them (apt-get install ffmpeg)"
)


def _probed(path: Path) -> tuple[dict[str, Any], list[float]]:
    """What ffprobe says of the only stream, and the times of its pictures, all of which it decodes."""
    asked = ["-show_streams", "-show_frames", "-show_entries", "frame=pts_time", "-of", "json"]
    command = ["ffprobe", "-v", "error", *asked, "-show_entries", "stream", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    assert done.stderr == ""
    found = json.loads(done.stdout)
    (stream,) = found["streams"]
    return stream, [float(frame["pts_time"]) for frame in found["frames"]]


def test_a_video_for_people_is_read(tmp_path: Path) -> None:
    write_log(tmp_path / "log.mcap", (ALL_OK,) * 7)
    export(tmp_path / "log.mcap", ExportOrder(slow=5), tmp_path / "jump.mp4")
    stream, times = _probed(tmp_path / "jump.mp4")
    told = ("codec_name", "pix_fmt", "color_range", "color_space", "color_primaries", "color_transfer")
    assert [stream[name] for name in told] == ["h264", "yuv420p", "tv", "bt709", "bt709", "iec61966-2-1"]
    assert times == pytest.approx([5 * place * PERIOD_NS / 1e9 for place in range(7)], abs=5e-6)


def test_a_video_without_loss_is_read(tmp_path: Path) -> None:
    write_log(tmp_path / "log.mcap", (ALL_OK,) * 7)
    export(tmp_path / "log.mcap", ExportOrder(kind=Kind.FFV1), tmp_path / "jump.mkv")
    stream, times = _probed(tmp_path / "jump.mkv")
    assert (stream["codec_name"], stream["pix_fmt"], len(times)) == ("ffv1", "gray", 7)
