"""A camera opened with the real Aravis, and what it receives."""

import gc
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Self

import gi
import numpy as np
from numpy.typing import NDArray

from capture.aravis.source_filter import open_sockets, opened_since
from rig.pulse import HillPulse
from simrig.images import stamp

gi.require_version("Aravis", "0.8")
from gi.repository import Aravis  # noqa: E402

# Looking for USB cameras opens sockets and threads of libusb that stay for good; none is looked for here.
Aravis.disable_interface("USB3Vision")

_BUFFERS = 60
_SOCKET_BUFFER_BYTES = 8 << 20


@dataclass(frozen=True, slots=True)
class Received:
    """One buffer that Aravis gave back. Without success, only `status` means anything."""

    status: str
    block_id: int
    device_ns: int
    image: NDArray[np.uint8]

    @property
    def pulse(self) -> HillPulse:
        """Hill pulse that stands in the pixels."""
        read = stamp.read(self.image)
        assert read is not None, "the frame carries no stamp"
        return read.pulse


class Receiver:
    """A camera under Aravis's control, with a stream, from `start` on triggered by `trigger`.

    The plain socket is the default here: while a packet socket is being set up, Aravis takes the packets of every
    other stream on the machine for its own.

    Its patience is that of a busy machine: a packet that is only late is not asked for again.
    """

    def __init__(
        self,
        address: str,
        *,
        trigger: str | None = "Line0",
        exposure_us: float = 1000.0,
        region: tuple[int, int, int, int] | None = None,
        packet_size: int = 9000,
        extended: bool = False,
        packet_socket: bool = False,
        retention_us: int = 500_000,
        **features: str | int,
    ) -> None:
        self.camera = Aravis.Camera.new(address)
        self.device = self.camera.get_device()
        if region:
            self.camera.set_region(*region)
        self.camera.gv_set_packet_size(packet_size)
        if trigger:
            self.camera.set_trigger(trigger)
        self.camera.set_exposure_time(exposure_us)
        if extended:
            self.device.set_string_feature_value("GevGVSPExtendedIDMode", "On")
        for name, value in features.items():
            if isinstance(value, str):
                self.device.set_string_feature_value(name, value)
            else:
                self.device.set_integer_feature_value(name, value)
        if not packet_socket:
            self.camera.gv_set_stream_options(Aravis.GvStreamOption.PACKET_SOCKET_DISABLED)
        before = open_sockets()
        self.stream = self.camera.create_stream(None, None)
        for opened in opened_since(before):
            with opened:  # Aravis enlarges it only once a packet has come: a stall before that would lose frames
                opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _SOCKET_BUFFER_BYTES)
        for name, value in {
            "socket-buffer": Aravis.GvStreamSocketBuffer.FIXED,
            "socket-buffer-size": _SOCKET_BUFFER_BYTES,
            "packet-timeout": 50_000,
            "packet-request-ratio": 1.0,  # a stall may lose most of a frame's packets: ask for all of them
            "frame-retention": retention_us,
        }.items():
            self.stream.set_property(name, value)
        for _ in range(_BUFFERS):
            self.stream.push_buffer(Aravis.Buffer.new_allocate(self.camera.get_payload()))

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *error: object) -> None:
        if error[0] is None:
            self.camera.stop_acquisition()
            self.device.leave_control()
        self.drop()

    def start(self) -> None:
        """Start acquisition."""
        self.camera.start_acquisition()

    def drop(self) -> None:
        """Drop all Aravis objects without a word to the camera."""
        for name in ("stream", "device", "camera"):
            self.__dict__.pop(name, None)
        gc.collect()

    def frames(self, count: int, timeout_s: float = 5.0) -> list[Received]:
        """The next `count` buffers, fewer if they do not come in time."""
        return list(islice(self._incoming(timeout_s), count))

    def first(self, accept: Callable[[Received], bool], timeout_s: float = 5.0) -> Received:
        """The first buffer that is accepted.

        Raises:
            StopIteration: none came in time.
        """
        return next(filter(accept, self._incoming(timeout_s)))

    def _incoming(self, timeout_s: float) -> Iterator[Received]:
        deadline = time.monotonic() + timeout_s
        while (left_s := deadline - time.monotonic()) > 0:
            buffer = self.stream.timeout_pop_buffer(round(left_s * 1e6))
            if buffer is not None:
                received = self._received(buffer)
                self.stream.push_buffer(buffer)
                yield received

    def count(self, name: str) -> int:
        """One of Aravis's counters of the stream."""
        value: int = self.stream.get_info_uint64_by_name(name)
        return value

    def _received(self, buffer: "Aravis.Buffer") -> Received:
        status = buffer.get_status().value_nick
        if status != "success":
            return Received(status, 0, 0, np.zeros((0, 0), np.uint8))
        shape = buffer.get_image_height(), buffer.get_image_width()
        image = np.frombuffer(buffer.get_data(), np.uint8).reshape(shape)
        return Received(status, buffer.get_frame_id(), buffer.get_timestamp(), image)
