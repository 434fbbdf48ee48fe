"""What the camera does when a program reads and writes its registers and when it receives actions."""

import ipaddress
import math
from collections.abc import Callable

from rig.clocks import NS_PER_S, HostNs, host_now
from rig.images.pixels import FORMATS
from simrig.gige.control.control_channel import ControlChannel, Peer
from simrig.gige.imaging.camera_clock import CameraClock
from simrig.gige.imaging.frame_store import FrameStore
from simrig.gige.imaging.sensor import Sensor
from simrig.gige.imaging.transmitter import Transmitter
from simrig.gige.protocol.gvcp import Action, ForceIp, Status
from simrig.gige.protocol.gvsp import FrameFormat
from simrig.gige.registers.register_map import RegisterError, RegisterMap, Value
from simrig.gige.registers.register_table import (
    CLOCK_RESET,
    DISCOVERY_BYTES,
    DO_NOT_FRAGMENT,
    EXTENDED_IDS,
    FIRE_TEST_PACKET,
    HEARTBEAT_DISABLE,
    MAX_PACKET_SIZE,
    MIN_PACKET_SIZE,
    PACKET_SIZE_MASK,
    USER_SET,
    PtpStatus,
    TriggerSource,
)
from simrig.images.painter import Painter

USER_SET_LOAD_NS = 30_000_000  #: a real camera needs this time to read its flash memory
_ACTION_QUEUE = 10
_NS_PER_MS = 1_000_000
_COLD_C, _WARM_C, _WARM_UP_S = 21.0, 43.0, 600.0

_FORMAT_NAMES = {each.code: name for name, each in FORMATS.items()}


class Device:
    """Ties the camera's registers to its parts. Only the thread that serves the control channel calls the methods."""

    def __init__(
        self, registers: RegisterMap, clock: CameraClock, painter: Painter, transmitter: Transmitter, sensor: Sensor
    ) -> None:
        self._registers, self._clock, self._painter = registers, clock, painter
        self._transmitter, self._sensor, self._link = transmitter, sensor, transmitter.link
        self.control = ControlChannel()
        self._peer: Peer = ("", 0)
        self._store: FrameStore | None = None
        self._began = host_now()
        self._sensor_size = (self._registers.number("SensorWidth"), self._registers.number("SensorHeight"))
        self._registers.set("GevSCSP", self._link.port)
        self._hook()

    def read(self, peer: Peer, address: int, count: int) -> bytes:
        """Read for a peer.

        Raises:
            RegisterError: the peer may not read, or there is nothing to read.
        """
        self.control.check_read(peer)
        return self._registers.read(address, count)

    def write(self, peer: Peer, address: int, data: bytes) -> int:
        """Write for a peer.

        Returns:
            How long the camera is busy with the write, ns.

        Raises:
            RegisterError: the peer may not write, or the camera refuses the value.
        """
        if address != self._registers.address("GevCCP"):
            self.control.check_write(peer)
        self._peer = peer
        self._registers.write(address, data)
        return USER_SET_LOAD_NS if address == self._registers.address("UserSetLoad") else 0

    @property
    def mac(self) -> int:
        """The camera's MAC address."""
        return self._registers.number("GevMACAddressHigh") << 32 | self._registers.number("GevMACAddressLow")

    @property
    def address(self) -> int:
        """The camera's present IPv4 address."""
        return self._registers.number("GevCurrentIPAddress")

    def moved(self, order: ForceIp) -> None:
        """Stream from the address that the camera was given, and say so in the registers."""
        if order.address != self.address:
            self._link.move(str(ipaddress.IPv4Address(order.address)))
            self._registers.set("GevSCSP", self._link.port)
        self._registers.set("GevCurrentIPAddress", order.address)
        self._registers.set("GevCurrentSubnetMask", order.mask)
        self._registers.set("GevCurrentDefaultGateway", order.gateway)

    def discovery_data(self) -> bytes:
        """The answer to a discovery."""
        return self._registers.read(0, DISCOVERY_BYTES)

    def resend(self, block_id: int, first: int, last: int) -> None:
        """Send packets again."""
        self._transmitter.resend(block_id, first, last)

    def act(self, action: Action) -> Status | None:
        """Carry out an action command.

        Returns:
            Status to answer with; None if the command is not for this camera.
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
        clock, sensor = self._clock, self._sensor
        if action.time is None:
            sensor.trigger(TriggerSource.ACTION0, now)
            return Status.SUCCESS
        if clock.ptp_status(now) is not PtpStatus.SLAVE:
            return self._extended(Status.NO_REFERENCE_TIME)
        if sensor.waiting_triggers >= _ACTION_QUEUE:
            return self._extended(Status.OVERFLOW)
        time = clock.host_of(action.time)
        sensor.trigger(TriggerSource.ACTION0, max(time, now))
        return Status.SUCCESS if time >= now else self._extended(Status.ACTION_LATE)

    def _extended(self, status: Status) -> Status:
        """A status of GigE Vision 2.0, or what a camera says that was not told to use these."""
        return status if self._registers.number("GevGVCPExtendedStatusCodes") else Status.ERROR

    def silent_at(self) -> HostNs | None:
        """When the controller's silence will have lasted too long; None if it may last for ever."""
        if self._registers.number("GevGVCPConfiguration") & HEARTBEAT_DISABLE:
            return None
        return self.control.silent_at(self._registers.number("GevHeartbeatTimeout") * _NS_PER_MS)

    def lose_control(self) -> None:
        """The controller left or fell silent: stop acquisition and close the stream channel."""
        self.control.release()
        self._stop_acquisition()
        for name in ("GevCCP", "GevSCP", "GevSCDA"):
            self._registers.set(name, 0)
        self._link.connect("", 0)

    def _hook(self) -> None:
        """Install the hooks of the registers that do something."""
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
            "TriggerSoftware": lambda: self._sensor.trigger(TriggerSource.SOFTWARE, host_now()),
            "CounterReset": self._reset_counter,
            "UserSetLoad": self._load_user_set,
        }.items():
            write(name, _command(command))
        clock, sensor = self._clock, self._sensor
        if "TimestampLatch" in self._registers:
            write("TimestampLatch", _command(self._latch_clock))
        read("PayloadSize", lambda: self._format().payload_bytes)
        if self._registers.is_writable("PtpDataSetLatch"):
            write("PtpDataSetLatch", _command(self._latch_ptp))
        else:
            read("PtpStatus", lambda: clock.ptp_status(host_now()))
        read("CounterValue", lambda: sensor.trigger_count)
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
            self._link.send_test_packet(address, port, size, whole=whole)
        return int(value) & ~FIRE_TEST_PACKET

    def _write_timestamp_control(self, value: Value) -> Value:
        now = host_now()
        if value == CLOCK_RESET:
            self._clock.reset(now)
        else:
            self._registers.set("GevTimestampValue", self._clock.ticks(now))
        return 0

    def _write_ptp_enable(self, value: Value) -> Value:
        self._clock.enable_ptp(bool(value), host_now())
        return value

    def _latch_clock(self) -> None:
        """Latch as cameras do that have a command for it: in ns."""
        ticks, tick_hz = self._clock.ticks(host_now()), self._registers.number("GevTimestampTickFrequency")
        self._registers.set("TimestampLatchValue", ticks * NS_PER_S // tick_hz)

    def _latch_ptp(self) -> None:
        now = host_now()
        self._registers.set("PtpStatus", self._clock.ptp_status(now))
        self._registers.set("PtpOffsetFromMaster", self._clock.ptp_offset_ns(now))

    def _trigger_setting(self, name: str) -> Callable[[Value], Value]:
        """A hook for a setting that decides about the sensor's next trigger."""

        def hook(value: Value) -> Value:
            self._registers.set(name, value)  # the sensor reads it at once
            self._sensor.settings_changed()
            return value

        return hook

    def _fits(self, other: str, limit: int) -> Callable[[Value], Value]:
        """A hook that refuses a region that reaches beyond the sensor."""

        def check(value: Value) -> Value:
            if int(value) + self._registers.number(other) > limit:
                raise RegisterError(Status.INVALID_PARAMETER)
            return value

        return check

    def _start_acquisition(self) -> None:
        self._sensor.acquire(None)
        frame = self._format()
        if self._store is None or self._store.format != frame:
            self._store = FrameStore(frame)
            images = (slot.image for slot in self._store.slots)
            self._painter.prepare(images, frame.rows, frame.columns, frame.pixel_format)
        self._transmitter.restart(self._store)
        self._link.connect(*self._destination())
        delay_ticks, tick_hz = self._registers.number("GevSCPD"), self._registers.number("GevTimestampTickFrequency")
        self._link.packet_delay_ns = delay_ticks * NS_PER_S // tick_hz
        self._link.limit_bytes_s = self._rate_limit()
        self._sensor.acquire(self._store)

    def _rate_limit(self) -> int:
        """Bytes per second at which other makers' cameras send at most; 0: no limit."""
        registers = self._registers
        if "StreamBytesPerSecond" in registers:
            return registers.number("StreamBytesPerSecond")
        if "DeviceLinkThroughputLimit" in registers and not registers.number("DeviceLinkThroughputLimitMode"):
            return registers.number("DeviceLinkThroughputLimit")
        return 0

    def _stop_acquisition(self) -> None:
        """Stop exposing; the transmitter still sends the exposed frames."""
        self._sensor.acquire(None)

    def _format(self) -> FrameFormat:
        number = self._registers.number
        return FrameFormat(
            number("Width"),
            number("Height"),
            number("OffsetX"),
            number("OffsetY"),
            number("GevSCPS") & PACKET_SIZE_MASK,
            bool(number("GevGVSPConfiguration") & EXTENDED_IDS),
            _FORMAT_NAMES[number("PixelFormat")],
        )

    def _destination(self) -> Peer:
        address = ipaddress.IPv4Address(self._registers.number("GevSCDA"))
        return str(address), self._registers.number("GevSCP") & 0xFFFF

    def _reset_counter(self) -> None:
        self._sensor.trigger_count = 0

    def _load_user_set(self) -> None:
        if self._registers.locked:
            raise RegisterError(Status.WRITE_PROTECT)
        self._registers.reset(USER_SET)
        self._sensor.settings_changed()

    def _temperature(self) -> float:
        up_s = (host_now() - self._began) / NS_PER_S
        return _WARM_C - (_WARM_C - _COLD_C) * math.exp(-up_s / _WARM_UP_S)


def _command(run: Callable[[], None]) -> Callable[[Value], Value]:
    """A hook that runs a command and sets the register back to 0."""

    def hook(value: Value) -> Value:
        del value
        run()
        return 0

    return hook
