"""Three cameras as the recorder sees them: the test writes into the grabbers' ends of real rings."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager

from rig.clocks import ClockLatch, DeviceNs, HostNs
from rig.frame import ConnectedRecord, FrameRecord, LatchRecord
from rig.settings.camera import CameraSettings, Region
from rig.settings.model import RecorderSettings, RigSettings
from rig.settings.trigger import ExternalTrigger
from rig.transport.ring import CameraRing

PERIOD = 33_333_333
SIZES = [(40, 30), (64, 30), (16, 30)]
START = 1_000_000_000
ARRIVES = 5_000_000


def ring_rig(**recorder: float) -> RigSettings:
    """A rig with three cameras of different widths."""
    cameras = tuple(
        CameraSettings(name=f"K{i + 1}", backend="aravis", address=f"127.0.0.{i + 1}", region=Region(width=w, height=h))
        for i, (w, h) in enumerate(SIZES)
    )
    return RigSettings(
        name="test", cameras=cameras, trigger=ExternalTrigger(rate_hz=30), recorder=RecorderSettings(**recorder)
    )


@contextmanager
def camera_rings(rig: RigSettings, slots: int = 16) -> Iterator[list[CameraRing]]:
    """A ring for each camera."""
    with ExitStack() as stack:
        rings = []
        for camera in rig.cameras:
            rings.append(CameraRing.create(camera.name, camera.frame_bytes, slots))
            stack.callback(rings[-1].close)
        yield rings


class RingCameras:
    """Three grabbers' ends of their rings; every device clock is the host's."""

    def __init__(self, rings: Sequence[CameraRing], start: int = START) -> None:
        self.rings, self.start = rings, start
        self.ids = [0] * len(rings)
        for ring in rings:
            ring.put(ConnectedRecord(HostNs(start - 1)), 1)
        self.latch()

    def latch(self, pulse: float = 0) -> None:
        """Read the cameras' clocks just before a pulse."""
        for ring in self.rings:
            for i in range(16):
                time = HostNs(self.time(pulse) - 16 + i)
                ring.put(LatchRecord(ClockLatch(DeviceNs(time), time, 10_000)), 1)

    def expose(self, pulse: int, *cameras: int, lose: bool = False) -> None:
        """Queue one frame of each camera with pixels (10 * pulse + camera) % 256; `lose`: the transfer loses it."""
        for camera in cameras:
            self.ids[camera] += 1
            slot = None if lose else self.rings[camera].take_slot()
            if slot is None:
                continue
            self.rings[camera].frame(slot)[:] = grey(pulse, camera)
            time = self.time(pulse)
            record = FrameRecord(HostNs(time + ARRIVES), slot, self.ids[camera], 0, DeviceNs(time + camera))
            self.rings[camera].put(record, 1)

    def time(self, pulse: float) -> HostNs:
        """When a pulse fires."""
        return HostNs(self.start + round(pulse * PERIOD))


def grey(pulse: int, camera: int) -> int:
    """Grey value of a camera's frame."""
    return (10 * pulse + camera) % 256
