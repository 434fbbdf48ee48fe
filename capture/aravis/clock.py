"""Reads the clock of a GigE Vision camera together with the host's.

Cameras latch their clock by a bootstrap register (GigE Vision 2.0, section 28.3), or by a GenICam command where the
register is not there (SFNC 2.7, chapter 2).
"""

from collections.abc import Callable, Iterable
from typing import Final

from capture.aravis.features import Features
from capture.aravis.library import Aravis, GLib
from rig.clocks import NS_PER_S, ClockLatch, DeviceNs, HostNs, host_now
from rig.errors import CameraError

_CONTROL, _LATCH = 0x0944, 2
_HIGH, _LOW = 0x0948, 0x094C
#: The same by features: the command, where its result is, and ticks of the result per second; 0: those of the clock.
_COMMANDS: Final = (
    ("TimestampLatch", "TimestampLatchValue", NS_PER_S),
    ("GevTimestampControlLatch", "GevTimestampValue", 0),
)
#: Host time before and after the latch, and device time, ns.
_Reading = Callable[[], tuple[HostNs, HostNs, int]]


class CameraClock:
    """The clock by which a camera stamps its frames.

    Args:
        name: of the camera, for messages.
        device: the open camera.
        features: its features.

    Raises:
        CameraError: it has no clock that can be read.
    """

    def __init__(self, name: str, device: "Aravis.Device", features: Features) -> None:
        self._name = name
        tick_hz = _frequency(name, device)
        ways = [_by_register(device, tick_hz)]
        for command, result, result_hz in _COMMANDS:
            if features.has(command) and features.has(result):
                ways.append(_by_command(device, command, result, result_hz or tick_hz))
        self._read = _advancing(name, ways)

    def latch(self) -> ClockLatch:
        """Read both clocks; the round trip is that of the write that latches the device clock.

        Raises:
            CameraError: the camera does not answer.
        """
        try:
            before, after, device = self._read()
        except GLib.Error as error:
            raise CameraError(f"camera {self._name} does not tell its time: {error.message}") from None
        return ClockLatch(DeviceNs(device), HostNs((before + after) // 2), after - before)


# Functions and no methods: an object that refers to itself would keep the camera's sockets open after it is closed.


def _by_register(device: "Aravis.Device", tick_hz: int) -> _Reading:
    def read() -> tuple[HostNs, HostNs, int]:
        before = host_now()
        device.write_register(_CONTROL, _LATCH)
        after = host_now()
        ticks = device.read_register(_HIGH) << 32 | device.read_register(_LOW)
        return before, after, ticks * NS_PER_S // tick_hz

    return read


def _by_command(device: "Aravis.Device", command: str, result: str, tick_hz: int) -> _Reading:
    def read() -> tuple[HostNs, HostNs, int]:
        before = host_now()
        device.execute_command(command)
        after = host_now()
        return before, after, int(device.get_integer_feature_value(result)) * NS_PER_S // tick_hz

    return read


def _advancing(name: str, ways: Iterable[_Reading]) -> _Reading:
    """The first way by which the clock can be read and goes on between two readings."""
    why = "it stands still"
    for read in ways:
        try:
            if read()[2] < read()[2]:
                return read
        except GLib.Error as error:
            why = error.message
    raise CameraError(
        f"camera {name} has a clock that cannot be read ({why}), so its frames cannot be tied to pulses: "
        "use another camera or its newest firmware"
    )


def _frequency(name: str, device: "Aravis.Device") -> int:
    frequency = int(device.get_timestamp_tick_frequency())  # by the bootstrap registers: descriptions may lack it
    if frequency == 0:
        raise CameraError(
            f"camera {name} has no clock (timestamp frequency 0), so its frames cannot be tied to pulses: "
            "use another camera or its newest firmware"
        )
    return frequency
