"""Passes hand-made records to a pairer: cameras on one clock at 30 Hz."""

from capture.clock_reading import ClockReading
from rig.clocks import NS_PER_S, ClockLatch, DeviceNs, HostNs
from rig.frame import FrameRecord
from tests.triggering.simulation import MS, US
from triggering.pairing.pairer import ClosedPulse, Pairer

PERIOD = NS_PER_S // 30
HOLD = 3 * PERIOD + 60 * MS
START = HostNs(1_000 * NS_PER_S)


class Feed:
    """A pairer and its decisions; times are given in pulses, and may be fractions.

    Args:
        cameras: how many.
        latches: whether each clock is read at the start.
        reads: whether it is read after frames as well, as a grabber does.
        hold_ns: see `Pairer`.
    """

    def __init__(self, cameras: int = 3, *, latches: bool = True, reads: bool = False, hold_ns: int = HOLD) -> None:
        self.pairer = Pairer(cameras, PERIOD, hold_ns=hold_ns)
        self.closed: list[ClosedPulse] = []
        self.readings = [ClockReading() if reads else None for _ in range(cameras)]
        for camera in range(cameras):
            self.pairer.connected(camera, 1, START)
            if latches:
                self.latch(camera)

    @staticmethod
    def time_of(pulse: float) -> HostNs:
        return HostNs(START + NS_PER_S // 2 + round(pulse * PERIOD))

    def latch(self, camera: int, at: int = START, clock: int = 0) -> None:
        self.pairer.latch(camera, ClockLatch(DeviceNs(at - START + clock), HostNs(at), 50 * US))

    def frame(
        self, camera: int, pulse: float, frame_id: int, *, epoch: int = 1, clock: int = 0, after: int = 5 * MS,
        triggers: int = -1,
    ) -> bool:  # fmt: skip
        time = self.time_of(pulse)
        record = FrameRecord(
            HostNs(time + after), 0, frame_id, 65535, DeviceNs(time - START + clock), triggers, epoch=epoch
        )
        placed = self.pairer.frame(camera, record) is not None
        reading = self.readings[camera]
        if reading is not None and reading.is_due(record.host_time, record.device_time):
            self.latch(camera, record.host_time, clock)
            reading.done(record.host_time)
        return placed or any(frame.record is record and frame.pulse for frame in self.pairer.released(record.host_time))

    def all_cameras(self, pulse: float, ids: list[int | None], triggers: list[int] | None = None) -> None:
        for camera, frame_id in enumerate(ids):
            if frame_id is not None:
                self.frame(camera, pulse, frame_id, triggers=triggers[camera] if triggers else -1)
        self.advance(self.time_of(pulse) + 6 * MS)

    def advance(self, now: int) -> None:
        self.pairer.released(HostNs(now))
        self.closed += self.pairer.advance(HostNs(now))
