"""What the camera does when its registers are read and written, and when actions come."""

import ipaddress
import math
from collections.abc import Callable
from dataclasses import dataclass

from rig.clocks import NS_PER_S, HostNs, host_now
from simrig.gige.camera_clock import CameraClock
from simrig.gige.control_channel import ControlChannel, Peer
from simrig.gige.counters import Counters
from simrig.gige.frame_store import FrameStore
from simrig.gige.gvcp import Action, Status
from simrig.gige.gvsp import FrameFormat
from simrig.gige.link import Link
from simrig.gige.register_table import USER_SET
from simrig.gige.registers import RegisterError, RegisterMap, Value
from simrig.gige.sensor import Sensor
from simrig.gige.transmitter import Transmitter
from simrig.gige.values import (
    CLOCK_RESET,
    DISCOVERY_BYTES,
    DO_NOT_FRAGMENT,
    EXTENDED_IDS,
    FIRE_TEST_PACKET,
    HEARTBEAT_DISABLE,
    MAX_PACKET_SIZE,
    MIN_PACKET_SIZE,
    PACKET_SIZE_MASK,
    PtpStatus,
    TriggerSource,
)
from simrig.image_source import Painter

USER_SET_LOAD_NS = 30_000_000  #: a real camera reads its flash memory meanwhile
_ACTION_QUEUE = 10
_NS_PER_MS = 1_000_000
_COLD_C, _WARM_C, _WARM_UP_S = 21.0, 43.0, 600.0


@dataclass(frozen=True, slots=True)
class Parts:
    """What the device is made of."""

    registers: RegisterMap
    clock: CameraClock
    painter: Painter
    link: Link
    transmitter: Transmitter
    sensor: Sensor
    counters: Counters


class Device:
    """The registers' meaning. All methods are called by the one thread that serves the control channel."""

    def __init__(self, parts: Parts) -> None:
        self._parts = parts
        self._registers = parts.registers
        self.control = ControlChannel()
        self._peer: Peer = ("", 0)
        self._store: FrameStore | None = None
        self._began = host_now()
        self._sensor_size = (self._registers.number("SensorWidth"), self._registers.number("SensorHeight"))
        self._registers.set("GevSCSP", parts.link.port)
        self._hook()

    def read(self, peer: Peer, address: int, count: int) -> bytes:
        """Read for a peer.

        Raises:
            RegisterError: it may not, or there is nothing to read.
        """
        self.control.check_read(peer)
        return self._registers.read(address, count)

    def write(self, peer: Peer, address: int, data: bytes) -> int:
        """Write for a peer.

        Returns:
            How long the camera is busy with it, ns.

        Raises:
            RegisterError: it may not, or the camera refuses.
        """
        if address != self._registers.address("GevCCP"):
            self.control.check_write(peer)
        self._peer = peer
        self._registers.write(address, data)
        return USER_SET_LOAD_NS if address == self._registers.address("UserSetLoad") else 0

    def discovery_data(self) -> bytes:
        """What a discovery is answered with."""
        return self._registers.read(0, DISCOVERY_BYTES)

    def resend(self, block_id: int, first: int, last: int) -> None:
        """Send packets again."""
        self._parts.transmitter.resend(block_id, first, last)

    def act(self, action: Action) -> Status | None:
        """Take an action command.

        Returns:
            What to answer; None if the command was not meant for this camera.
        """
        number = self._registers.number
        if self.control.controller is None or (action.device_key, action.group_key) != (
            number("ActionDeviceKey"),
            number("ActionGroupKey"),
        ):
            return None
        if not action.group_mask & number("ActionGroupMask"):
            return None
        now = host_now()
        clock, sensor = self._parts.clock, self._parts.sensor
        if action.time is None:
            sensor.trigger(TriggerSource.ACTION0, now)
            return Status.SUCCESS
        if clock.ptp_status(now) is not PtpStatus.SLAVE:
            return Status.NO_REFERENCE_TIME
        if sensor.waiting_triggers >= _ACTION_QUEUE:
            return Status.OVERFLOW
        time = clock.host_of(action.time)
        sensor.trigger(TriggerSource.ACTION0, max(time, now))
        return Status.SUCCESS if time >= now else Status.ACTION_LATE

    def silent_at(self) -> HostNs | None:
        """When the controller's silence becomes too long; None if that never happens."""
        if self._registers.number("GevGVCPConfiguration") & HEARTBEAT_DISABLE:
            return None
        return self.control.silent_at(self._registers.number("GevHeartbeatTimeout") * _NS_PER_MS)

    def lose_control(self) -> None:
        """The controller left or fell silent: stop, close the stream channel, and wait for another one."""
        self.control.release()
        self._stop_acquisition()
        for name in ("GevCCP", "GevSCP", "GevSCDA"):
            self._registers.set(name, 0)
        self._parts.link.connect("", 0)

    def _hook(self) -> None:
        """Tie the registers to what they do."""
        write, read = self._registers.on_write, self._registers.on_read
        write("GevCCP", self._write_privilege)
        write("GevSCPS", self._write_packet_size)
        write("GevTimestampControl", self._write_timestamp_control)
        write("PtpEnable", self._write_ptp_enable)
        for name, position, size in (("Width", "OffsetX", 0), ("Height", "OffsetY", 1)):
            write(name, self._fits(position, self._sensor_size[size]))
            write(position, self._fits(name, self._sensor_size[size]))
        for name in (
            "TriggerMode", "TriggerSource", "TriggerActivation", "AcquisitionFrameRate", "AcquisitionFrameRateEnable",
        ):  # fmt: skip
            write(name, self._trigger_setting(name))
        for name, command in {
            "AcquisitionStart": self._start_acquisition,
            "AcquisitionStop": self._stop_acquisition,
            "TriggerSoftware": lambda: self._parts.sensor.trigger(TriggerSource.SOFTWARE, host_now()),
            "CounterReset": self._reset_counter,
            "UserSetLoad": self._load_user_set,
            "PtpDataSetLatch": self._latch_ptp,
        }.items():
            write(name, _command(command))
        clock, counters = self._parts.clock, self._parts.counters
        read("PayloadSize", lambda: self._registers.number("Width") * self._registers.number("Height"))
        read("PtpStatus", lambda: clock.ptp_status(host_now()))
        read("CounterValue", lambda: counters.frame_triggers)
        read("DeviceTemperature", self._temperature)

    def _write_privilege(self, value: Value) -> Value:
        self.control.claim(self._peer, int(value), host_now())
        if self.control.controller is None:
            self.lose_control()
        return self.control.privilege

    def _write_packet_size(self, value: Value) -> Value:
        size = int(value) & PACKET_SIZE_MASK
        if not MIN_PACKET_SIZE <= size <= MAX_PACKET_SIZE:
            raise RegisterError(Status.INVALID_PARAMETER)
        if int(value) & FIRE_TEST_PACKET:
            address, port = self._destination()
            whole = bool(int(value) & DO_NOT_FRAGMENT)
            self._parts.link.send_test_packet(address, port, size, whole=whole)
        return int(value) & ~FIRE_TEST_PACKET

    def _write_timestamp_control(self, value: Value) -> Value:
        now = host_now()
        if value == CLOCK_RESET:
            self._parts.clock.reset(now)
        else:
            self._registers.set("GevTimestampValue", self._parts.clock.ticks(now))
        return 0

    def _write_ptp_enable(self, value: Value) -> Value:
        self._parts.clock.enable_ptp(bool(value), host_now())
        return value

    def _latch_ptp(self) -> None:
        self._registers.set("PtpOffsetFromMaster", self._parts.clock.ptp_offset_ns(host_now()))

    def _trigger_setting(self, name: str) -> Callable[[Value], Value]:
        """A hook for a setting that the sensor's next trigger depends on."""

        def hook(value: Value) -> Value:
            self._registers.set(name, value)  # the sensor looks at it at once
            self._parts.sensor.settings_changed()
            return value

        return hook

    def _fits(self, other: str, limit: int) -> Callable[[Value], Value]:
        """A hook that refuses a region that would reach beyond the sensor."""

        def check(value: Value) -> Value:
            if int(value) + self._registers.number(other) > limit:
                raise RegisterError(Status.INVALID_PARAMETER)
            return value

        return check

    def _start_acquisition(self) -> None:
        parts = self._parts
        parts.sensor.acquire(None)
        frame = self._format()
        if self._store is None or self._store.format != frame:
            self._store = FrameStore(frame)
            parts.painter.prepare((slot.image for slot in self._store.slots), frame.rows, frame.columns)
        parts.transmitter.restart(self._store)
        parts.link.connect(*self._destination())
        delay_ticks, tick_hz = self._registers.number("GevSCPD"), self._registers.number("GevTimestampTickFrequency")
        parts.link.packet_delay_ns = delay_ticks * NS_PER_S // tick_hz
        parts.sensor.acquire(self._store)

    def _stop_acquisition(self) -> None:
        """Expose no more; what is exposed is still sent."""
        self._parts.sensor.acquire(None)

    def _format(self) -> FrameFormat:
        number = self._registers.number
        return FrameFormat(
            number("Width"),
            number("Height"),
            number("OffsetX"),
            number("OffsetY"),
            number("GevSCPS") & PACKET_SIZE_MASK,
            bool(number("GevGVSPConfiguration") & EXTENDED_IDS),
        )

    def _destination(self) -> Peer:
        address = ipaddress.IPv4Address(self._registers.number("GevSCDA"))
        return str(address), self._registers.number("GevSCP") & 0xFFFF

    def _reset_counter(self) -> None:
        self._parts.counters.frame_triggers = 0

    def _load_user_set(self) -> None:
        if self._registers.locked:
            raise RegisterError(Status.WRITE_PROTECT)
        self._registers.reset(USER_SET)
        self._parts.sensor.settings_changed()

    def _temperature(self) -> float:
        up_s = (host_now() - self._began) / NS_PER_S
        return _WARM_C - (_WARM_C - _COLD_C) * math.exp(-up_s / _WARM_UP_S)


def _command(run: Callable[[], None]) -> Callable[[Value], Value]:
    """A hook that runs a command; the register goes back to 0."""

    def hook(value: Value) -> Value:
        del value
        run()
        return 0

    return hook
