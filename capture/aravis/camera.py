"""GigE Vision cameras through Aravis 0.8, frames straight into the shared ring.

Aravis writes the packets' payload to the address that it is given, so the recorder can read a frame the moment it is
whole. Only a few empty buffers stand in Aravis's queue at a time, and free slots are taken lowest first: the same few
slots are used over and over and stay in the processor's cache (`frame_buffers`).

The ids of a buffer whose status is not SUCCESS mean nothing: they may be those of its previous use.
"""

from collections.abc import Collection, Mapping, Sequence
from typing import Final

from capture.aravis.action import lock_clock
from capture.aravis.clock import CameraClock
from capture.aravis.configuration import configure, region_limits
from capture.aravis.features import Features, text_at
from capture.aravis.frame_buffers import FrameBuffers
from capture.aravis.gain import gain_steps
from capture.aravis.library import Aravis, GLib
from capture.aravis.receive_socket import SOCKET_BUFFER_BYTES, prefers_plain_socket
from capture.aravis.source_filter import SourceFilter, filter_control, open_sockets
from capture.aravis.trigger import SOFTWARE_TRIGGER
from capture.aravis.wire import Frames, Wire, set_pace
from capture.command_times import CommandTimes
from capture.seam import Arrival
from rig.action import ActionKeys
from rig.clocks import NS_PER_S, ClockLatch, DeviceNs, HostNs, host_now
from rig.errors import CameraError, CameraNotFoundError
from rig.frame import DamagedRecord, FrameRecord
from rig.settings.camera import CameraSettings
from rig.settings.model import NetworkSettings
from rig.settings.region import RegionLimits
from rig.settings.trigger import ActionTrigger, ExternalTrigger, SoftwareTrigger, Trigger
from rig.transport.ring import CameraRing

_NAMES: Final = ((0x48, 32), (0x68, 32), (0xD8, 16))  # vendor, model, serial number: GigE Vision 2.0, section 28
_STREAM_SOURCE_PORT = 0x0D1C  # GigE Vision 2.0, section 28
_IDS_16_BIT = 65535
_RETENTION_US = 50_000  # enough to ask for lost packets several times and to receive them
_BY_CABLE: Final = ExternalTrigger()
_ALONE: Final = Wire()
_TEMPERATURES: Final = ("DeviceTemperature", "TemperatureAbs")  # the second: Basler, before the convention


class AravisCamera:
    """One GigE Vision camera, triggered by its input, by commands (`fire`), or by action commands of another process.

    Args:
        settings: of the camera in the rig file.
        network: of the rig file.
        ring: where the frames go.
        period_ns: time between two pulses.
        trigger: of the rig file.
        origin: time of a pulse, the same for all programs of the rig; it makes the keys of action commands.
        wire: the network port at which its packets come in.
        set_back: whether `close` sets it as it was before.

    Raises:
        CameraNotFoundError: nobody answers at the address.
        CameraError: the camera is in use, lacks a feature, or has another frame size.
    """

    def __init__(
        self,
        settings: CameraSettings,
        network: NetworkSettings,
        ring: CameraRing,
        period_ns: int,
        trigger: Trigger = _BY_CABLE,
        origin: HostNs = HostNs(0),
        wire: Wire = _ALONE,
        *,
        set_back: bool = False,
    ) -> None:
        self._name, self._address, self._ring = settings.name, settings.address, ring
        self._commands: CommandTimes | None = None
        self._lost, self._set_back = False, set_back
        self._buffers = FrameBuffers(ring, period_ns)
        self._frame_came = False
        self._notices: list[str] = []
        plain_socket = prefers_plain_socket(network, settings.frame_bytes, period_ns)
        sockets = open_sockets()
        try:
            self._camera = Aravis.Camera.new(settings.address)
        except GLib.Error as error:
            raise _opening_error(settings, error) from None
        try:
            self._device = self._camera.get_device()
            if not self._device.is_controller():  # Aravis opens it all the same, to read only
                raise _controlled_error(settings, "no control")
            filter_control(sockets, self._camera_host())
            self._device.connect("control-lost", self._on_control_lost)
            self._features = Features(self._device)
            self._configure(settings, NS_PER_S / period_ns, trigger, origin)
            self._set_packets(network, plain_socket=plain_socket)
            self._frame_ns = self._set_pace(settings, network, period_ns, wire)
            self._open_clock(settings, trigger)
            self._stream = self._open_stream(network, plain_socket=plain_socket)
        except GLib.Error as error:
            self.close()
            raise CameraError(
                f"camera {self._name} at {self._address} refuses its settings: {error.message}; "
                "check the rig file against the camera's manual"
            ) from None
        except OSError as error:
            self.close()
            raise CameraError(
                f"camera {self._name}: its packets cannot be told from others ({error}); run svev doctor"
            ) from None
        except CameraError:
            self.close()
            raise

    @property
    def description(self) -> str:
        """Vendor, model, serial number, packet size, and how long a frame takes if that is known."""
        vendor, model, serial = (text_at(self._device, *place) for place in _NAMES)
        time = f", {self._frame_ns / 1e6:.1f} ms to send a frame" if self._frame_ns else ""
        size = self._camera.gv_get_packet_size()
        return f"{vendor} {model} serial {serial} at {self._address}, {size}-byte packets{time}"

    @property
    def limits(self) -> RegionLimits | None:
        """See `capture.seam.Camera.limits`."""
        return region_limits(self._features)

    @property
    def gain_steps(self) -> tuple[int, int] | None:
        """Least and largest gain of a camera that has it in steps alone."""
        return gain_steps(self._features)

    def start(self) -> None:
        """See `capture.seam.Camera.start`."""
        self._buffers.top_up(self._stream)
        try:
            self._camera.start_acquisition()
        except GLib.Error as error:
            raise CameraError(f"camera {self._name} does not start: {error.message}; check its power") from None

    def receive(self, timeout_s: float) -> Arrival | None:
        """See `capture.seam.Camera.receive`."""
        if self._lost:
            raise CameraError(f"camera {self._name} at {self._address} lost control; check power and cable")
        self._buffers.top_up(self._stream)
        buffer = self._stream.timeout_pop_buffer(round(timeout_s * 1e6))
        if buffer is None:
            self._check_source()
            return None
        now = host_now()
        slot = self._buffers.popped(buffer)
        time = self._time_of(buffer, now)
        if time is None or buffer.get_status() != Aravis.BufferStatus.SUCCESS:
            self._ring.return_slot(slot)
            return DamagedRecord(now)
        self._frame_came = True
        frame_id = buffer.get_frame_id()
        if frame_id > _IDS_16_BIT:
            self._id_modulus = 0  # its ids are long, without a feature that says so
        return FrameRecord(now, slot, frame_id, self._id_modulus, time)

    def fire(self) -> None:
        """See `capture.seam.Commanded.fire`."""
        before = host_now()
        if self._commands is not None and not self._commands.is_free(before):
            return
        try:
            self._device.execute_command(SOFTWARE_TRIGGER)
        except GLib.Error as error:
            raise CameraError(f"camera {self._name} does not take the command to expose: {error.message}") from None
        if self._commands is not None:
            self._commands.sent(before, host_now())

    def latch(self) -> ClockLatch:
        """See `capture.aravis.clock.CameraClock.latch`; without a clock, that of the commands."""
        return self._clock.latch() if self._commands is None else self._commands.latch(host_now())

    def counters(self) -> Mapping[str, int]:
        """Aravis's own counters of the stream, and the temperature if the camera has a sensor."""
        stream = self._stream
        counted = {
            "underruns": stream.get_info_uint64_by_name("n_underruns"),
            "resent_packets": stream.get_info_uint64_by_name("n_resent_packets"),
            "missing_packets": stream.get_info_uint64_by_name("n_missing_packets"),
        }
        try:
            for name in _TEMPERATURES:
                if (celsius := self._features.measured(name)) is not None:
                    counted["temperature_mdeg"] = max(0, round(celsius * 1000))
                    break
        except GLib.Error as error:
            raise CameraError(f"camera {self._name} does not answer: {error.message}") from None
        return counted

    def notices(self) -> Sequence[str]:
        """What is unusual about the camera's packets."""
        if self._commands is not None and (notice := self._commands.notice()) is not None:
            self._notices.append(f"camera {self._name}: {notice}")
        notices, self._notices = self._notices, []
        return notices

    @property
    def bytes_received(self) -> int:
        """See `capture.seam.Camera.bytes_received`."""
        return int(self._stream.get_info_uint64_by_name("n_transferred_bytes"))

    def close(self) -> None:
        """Stop, leave control (or the next opening would wait for the heartbeat), and drop all Aravis objects."""
        try:
            self._camera.stop_acquisition()
            if self._set_back:
                self._features.set_back()
            self._device.leave_control()
        except (AttributeError, GLib.Error):
            # The camera was never fully opened, or it is dead: then its heartbeat runs out by itself.
            pass
        if "_source" in self.__dict__:
            self._source.close()
        if "_features" in self.__dict__:
            self._features.close()  # an error that is still shown refers to them
        for name in ("_source", "_stream", "_clock", "_features", "_device", "_camera"):
            self.__dict__.pop(name, None)
        self._buffers.close()

    def _on_control_lost(self, _device: object) -> None:
        self._lost = True

    def _configure(self, settings: CameraSettings, rate_hz: float, trigger: Trigger, origin: HostNs) -> None:
        """Set everything that must be set before the stream is made."""
        # No local names for Aravis objects: the traceback of an error would keep the camera's sockets open.
        keys = ActionKeys.of(origin) if isinstance(trigger, ActionTrigger) else None
        software = isinstance(trigger, SoftwareTrigger)
        self._notices += configure(self._features, settings, rate_hz, software=software, action=keys)
        if isinstance(trigger, ActionTrigger) and trigger.scheduled:
            lock_clock(self._features, settings.name)

    def _set_packets(self, network: NetworkSettings, *, plain_socket: bool) -> None:
        """Set how frames come: size of the packets, socket, length of the ids; check how large frames are."""
        if self._features.set_number("GevSCPSPacketSize", network.packet_size, up_to=True) is None:
            self._camera.gv_set_packet_size(network.packet_size)
        if plain_socket:
            self._camera.gv_set_stream_options(Aravis.GvStreamOption.PACKET_SOCKET_DISABLED)
        self._id_modulus = 0 if self._features.switch("GevGVSPExtendedIDMode", on=True) else _IDS_16_BIT
        payload = self._camera.get_payload()
        if payload != self._ring.frame_bytes:
            raise CameraError(
                f"camera {self._name} sends {payload} bytes per frame, the rig file's region makes "
                f"{self._ring.frame_bytes}: correct region and pixel_format of {self._name}"
            )

    def _set_pace(self, settings: CameraSettings, network: NetworkSettings, period_ns: int, wire: Wire) -> float:
        """Leave time between packets; how long a frame takes, ns."""
        tick_hz = self._device.get_timestamp_tick_frequency() or NS_PER_S
        frames = Frames(settings.frame_bytes, self._camera.gv_get_packet_size(), period_ns, tick_hz)
        pace = set_pace(self._features, settings.name, network.packet_delay, frames, wire)
        self._notices += [f"camera {settings.name}: {notice}" for notice in pace.notices]
        return pace.frame_ns

    def _open_clock(self, settings: CameraSettings, trigger: Trigger) -> None:
        """Find a way to read the camera's clock; one that is told to expose can do without."""
        try:
            self._clock = CameraClock(settings.name, self._device, self._features)
        except CameraError:
            if not isinstance(trigger, SoftwareTrigger):
                raise
            self._commands = CommandTimes(round(settings.exposure_us * 1000), trigger.longest_ns)

    def _time_of(self, buffer: "Aravis.Buffer", now: HostNs) -> DeviceNs | None:
        """When the camera exposed, by its clock, or by the command that has made the frame; None: it cannot be told."""
        return DeviceNs(buffer.get_timestamp()) if self._commands is None else self._commands.answered(now)

    def _open_stream(self, network: NetworkSettings, *, plain_socket: bool) -> "Aravis.Stream":
        sockets = open_sockets()
        stream = self._camera.create_stream(None, None)
        if stream is None:
            raise CameraError(f"camera {self._name}: no stream can be opened; check the network interface")
        self._source = self._filter_source(stream, sockets)
        resend = Aravis.GvStreamPacketResend.ALWAYS if network.resend else Aravis.GvStreamPacketResend.NEVER
        # A packet socket hands packets over in blocks of up to 5 ms: a shorter timeout asks for packets that have
        # come already. A whole frame waits behind a damaged one for `frame-retention`.
        packet_timeout_us = 3_000 if plain_socket else 8_000
        for name, value in {
            "packet-resend": resend,
            "packet-timeout": packet_timeout_us,
            "initial-packet-timeout": packet_timeout_us // 3,
            "frame-retention": _RETENTION_US,
            "packet-request-ratio": 1.0,  # a stall may lose most of a frame's packets: ask for all of them
            "socket-buffer": Aravis.GvStreamSocketBuffer.FIXED,
            "socket-buffer-size": SOCKET_BUFFER_BYTES,
        }.items():
            stream.set_property(name, value)
        self._buffers.make()
        return stream

    def _filter_source(self, stream: "Aravis.Stream", before: Collection[str]) -> SourceFilter:
        """Refuse packets that are not from the camera's address and port."""
        local = self._device.get_interface_address().get_address().to_string(), stream.get_port()
        try:
            port = self._read(_STREAM_SOURCE_PORT) & 0xFFFF
        except GLib.Error:
            port = 0  # cameras of GigE Vision 1.0 have no such register
        return SourceFilter(before, local, (self._camera_host(), port))

    def _camera_host(self) -> str:
        """Address of the camera, numbers only."""
        return str(self._device.get_device_address().get_address().to_string())

    def _check_source(self) -> None:
        """Give up asking for the source port, if the camera sends, but not from the port that it names."""
        if self._frame_came or not self._source.doubt(self._stream.get_info_uint64_by_name("n_received_packets")):
            return
        self._notices.append(
            f"camera {self._name} streams from another port than it says: packets from other ports of "
            f"{self._address} are taken for its own"
        )

    def _read(self, register: int) -> int:
        return int(self._device.read_register(register))


def _opening_error(settings: CameraSettings, error: GLib.Error) -> CameraError | CameraNotFoundError:
    if "denied" in error.message or "control" in error.message.lower():
        return _controlled_error(settings, error.message)
    return CameraNotFoundError(
        f"camera {settings.name} at {settings.address} does not answer: check power, cable and address, "
        "then run: svev doctor"
    )


def _controlled_error(settings: CameraSettings, detail: str) -> CameraError:
    return CameraError(
        f"camera {settings.name} at {settings.address} is controlled by another program: close that program, "
        f"or wait 3 s for its heartbeat to run out ({detail})"
    )
