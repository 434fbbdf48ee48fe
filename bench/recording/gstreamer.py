"""The baseline: `gst-launch-1.0 aravissrc`, one per camera, into nothing or into a file, without pairing."""

import shutil
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

from bench.recording.loads import Load
from bench.recording.processes import cpu_seconds
from rig.errors import BadInputError, CameraError
from rig.settings.model import RigSettings

SINKS = ("fakesink", "filesink")
_WARM_S = 3.0


def run_gstreamer(load: Load, rig: RigSettings, sink: str, seconds: float, directory: Path) -> dict[str, Any]:
    """Three pipelines for `seconds`, measured after a warm-up.

    GStreamer does not say how many frames went into a fakesink, so the frames that the cameras sent are taken: lost
    ones flatter the baseline. What a filesink wrote is measured.
    """
    program = shutil.which("gst-launch-1.0")
    if program is None:
        raise BadInputError("gst-launch-1.0 is missing: install gstreamer1.0-tools and aravis-tools")
    files = [directory / f"gst-{camera.name}.raw" for camera in rig.cameras]
    pipelines = [
        _start(program, load, camera.address, sink, file, rig) for camera, file in zip(rig.cameras, files, strict=True)
    ]
    try:
        time.sleep(_WARM_S)  # pipelines do not tell when they play
        pids = [pipeline.pid for pipeline in pipelines]
        if any(pipeline.poll() is not None for pipeline in pipelines):
            raise CameraError("GStreamer does not play: see its message above, and try aravissrc by hand")
        before, sizes = cpu_seconds(pids), _sizes(files)
        time.sleep(seconds)
        cpu, written = cpu_seconds(pids) - before, _sizes(files) - sizes
    finally:
        for pipeline in pipelines:
            pipeline.send_signal(signal.SIGINT)  # ends the stream and leaves control of the camera
        for pipeline in pipelines:
            pipeline.wait(10)
        for file in files:
            file.unlink(missing_ok=True)
    gigabytes = written / 1e9 if sink == "filesink" else seconds * load.bytes_per_s / 1e9
    return {
        "GB": round(gigabytes, 3),
        "MB_per_s": round(gigabytes * 1e3 / seconds, 1),
        "cpu_s": round(cpu, 2),
        "cpu_s_per_GB": round(cpu / gigabytes, 3),
    }


def _start(program: str, load: Load, address: str, sink: str, file: Path, rig: RigSettings) -> subprocess.Popen[bytes]:
    size = f"width={load.width},height={load.height}"
    sinks = {"fakesink": ["fakesink", "sync=false"], "filesink": ["filesink", f"location={file}"]}
    source = [
        "aravissrc", f"camera-name={address}", f"packet-size={rig.network.packet_size}", "auto-packet-size=false",
        "features=TriggerSelector=FrameStart TriggerMode=On TriggerSource=Line0", f"num-arv-buffers={20}",
    ]  # fmt: skip
    pipeline = [*source, "!", f"video/x-raw,format=GRAY8,{size}", "!", *sinks[sink]]
    return subprocess.Popen([program, "-q", *pipeline], stdout=subprocess.DEVNULL, stdin=subprocess.DEVNULL)


def _sizes(files: list[Path]) -> int:
    return sum(file.stat().st_size for file in files if file.exists())
