"""A program on the emulated bus: `python -m tests.simrig.firewire.client` drives one camera as it is told.

One JSON list per line on standard input: a method of `Client` and its arguments; one JSON object per line as answer.
"""

import ctypes
import fcntl
import json
import os
import struct
import sys
import threading
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from simrig.images import stamp
from tests.simrig.firewire import dc1394
from tests.simrig.firewire.dc1394 import Frame, Handle

_GET_CYCLE_TIMER = 2 << 30 | 16 << 16 | ord("#") << 8 | 0x0C
_SIGNATURE = struct.Struct(">III")


class Client:
    def __init__(self) -> None:
        self._stack = ExitStack()
        self._library: Any = None
        self._camera: Handle | None = None

    def cameras(self) -> list[str]:
        if self._library is None:
            self._library = self._stack.enter_context(dc1394.library())
        return [f"{guid:016x}" for guid in dc1394.guids(self._library)]

    def open(self, guid: str) -> dict[str, Any]:
        if self._library is None:
            self.cameras()
        self._camera = self._stack.enter_context(dc1394.opened(self._library, int(guid, 16)))
        about = self._camera.camera.contents
        return {
            "vendor": about.vendor.decode(), "model": about.model.decode(), "iidc": about.iidc_version,
            "advanced": about.advanced_features_csr,
        }  # fmt: skip

    def configure(self, shutter: int = 100) -> None:
        self.camera.configure(shutter)

    def run_free(self) -> None:
        self.camera.arm(triggered=False)

    def format7(self, left: int, top: int, width: int, height: int, packet_bytes: int) -> int:
        """The packet size that it comes to."""
        self.camera.call("video_set_operation_mode", dc1394.OPERATION_LEGACY)
        self.camera.call("video_set_iso_speed", dc1394.S400)
        self.camera.call("video_set_mode", dc1394.FORMAT7_0)
        region = (packet_bytes, left, top, width, height)
        self.camera.call("format7_set_roi", dc1394.FORMAT7_0, dc1394.MONO8, *region)
        return self.camera.get("format7_get_packet_size", dc1394.FORMAT7_0)

    def call(self, function: str, *arguments: int) -> None:
        self.camera.call(function, *arguments)

    def get(self, function: str, *arguments: int) -> int:
        return self.camera.get(function, *arguments)

    def arm(self) -> None:
        self.camera.arm()

    def advanced(self, offset: int) -> int:
        return self.camera.advanced(offset)

    def set_advanced(self, offset: int, value: int) -> None:
        self.camera.set_advanced(offset, value)

    def cycle_timer(self) -> list[int]:
        """Register, UTC in us, and the host's clock just after, ns."""
        return [*self.camera.cycle_timer(), time.monotonic_ns()]

    def start(self, ring: int = 64) -> None:
        self.camera.start(ring)

    def stop(self) -> None:
        self.camera.stop()

    def frames(self, count: int, timeout_s: float = 5.0) -> list[dict[str, Any]]:
        """So many frames, or fewer if none comes for a while."""
        found: list[dict[str, Any]] = []
        while len(found) < count and (frame := self.camera.frame(timeout_s)) is not None:
            found.append(describe(frame))
        return found

    def frames_until(self, pulse: int, timeout_s: float = 5.0) -> list[dict[str, Any]]:
        """Frames until one of hill pulse `pulse` or later."""
        found: list[dict[str, Any]] = []
        while not found or (found[-1]["pulse"] or 0) < pulse:
            found += self.frames(1, timeout_s)
        return found

    def sleep(self, seconds: float) -> None:
        """Be a consumer that is stalled."""
        time.sleep(seconds)

    def listing(self) -> dict[str, Any]:
        """What Python sees of the nodes."""
        names = sorted(name for name in os.listdir("/dev") if name.startswith("fw"))  # noqa: PTH208
        paths = [Path("/dev") / name for name in names]
        return {
            "listed": names, "exist": [path.exists() and path.is_char_device() for path in paths],
            "found": sorted(path.name for path in Path("/dev").glob("fw*")),
            "readable": [os.access(path, os.R_OK | os.W_OK) for path in paths],
            "others": "null" in os.listdir("/dev"), "nowhere": Path("/dev/fw99").exists(),  # noqa: PTH208
        }  # fmt: skip

    def opens(self, path: str) -> str:
        """How opening a file ends."""
        try:
            os.close(os.open(path, os.O_RDWR))
        except OSError as error:
            return type(error).__name__
        return "opened"

    def ioctl(self, path: str, code: int, size: int) -> int:
        """The error number of an ioctl whose argument is all zeros; 0 if there is none."""
        descriptor = os.open(path, os.O_RDWR)
        libc = ctypes.CDLL(None, use_errno=True)
        failed = libc.ioctl(descriptor, ctypes.c_ulong(code), ctypes.create_string_buffer(size)) < 0
        number = ctypes.get_errno() if failed else 0
        os.close(descriptor)
        return number

    def hammer(self, path: str, threads: int, rounds: int) -> list[str]:
        """Many threads at once open, ask, close and look at the files of the bus and others; what went wrong."""
        wrong: list[str] = []

        def one() -> None:
            for _ in range(rounds):
                try:
                    descriptor = os.open(path, os.O_RDWR)
                    answer = fcntl.ioctl(descriptor, _GET_CYCLE_TIMER, bytes(16))
                    os.close(descriptor)
                    if not any(answer) or "fw1" not in os.listdir("/dev") or Path("/dev/null").read_bytes():  # noqa: PTH208
                        wrong.append("a wrong answer")
                except OSError as error:
                    wrong.append(repr(error))

        workers = [threading.Thread(target=one) for _ in range(threads)]
        for worker in workers:
            worker.start()
        for worker in workers:
            worker.join()
        return wrong

    def close(self) -> None:
        self._stack.close()

    @property
    def camera(self) -> Handle:
        assert self._camera is not None
        return self._camera


def describe(frame: Frame) -> dict[str, Any]:
    image = np.frombuffer(frame.pixels, np.uint8)[: frame.width * frame.height].reshape(frame.height, frame.width)
    cycle_time, frames, triggers = _SIGNATURE.unpack(image[-1, :12].tobytes())
    seen, sample = stamp.read(image), image[::8, ::8]  # all pixels would take too long on a busy machine
    return {
        "cycle_time": cycle_time, "frame_count": frames, "trigger_count": triggers,
        "camera": seen.camera if seen else None, "pulse": seen.pulse if seen else None,
        "timestamp_us": frame.timestamp_us, "arrival_ns": time.monotonic_ns(), "utc_us": time.time_ns() // 1000,
        "size": [frame.width, frame.height], "packet_bytes": frame.packet_bytes, "packets": frame.packets,
        "mean": float(sample.mean()), "std": float(sample.std()),
    }  # fmt: skip


def main() -> None:
    client = Client()
    for line in sys.stdin:
        method, arguments = json.loads(line)
        try:
            answer = {"result": getattr(client, method)(*arguments)}
        except dc1394.Dc1394Error as error:
            answer = {"error": str(error), "code": error.code}
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()
    client.close()


if __name__ == "__main__":
    main()
