"""IIDC cameras on FireWire, through libdc1394; see `capture.seam.Camera`.

libdc1394 on Linux counts no lost frames and marks no damaged ones. The camera's signature in the image tells both.
Frames of a camera that writes no signature are taken as they come.
"""

import ctypes
import logging
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from typing import Any, Final

from capture.iidc.avt import AVT_VENDOR_ID, AvtRegisters
from capture.iidc.bus import Bus
from capture.iidc.clock import BusClock, CycleTimer, PacketTimes, first_packet
from capture.iidc.configuration import (
    READOUT_NS,
    longest_delay_ns,
    region_limits,
    set_exposure,
    set_gain,
    set_trigger,
    set_video_format,
)
from capture.iidc.device import Device
from capture.iidc.dma import DmaRing
from capture.iidc.library import Dc1394Error
from capture.iidc.pixels import copier
from capture.iidc.point_grey import POINT_GREY_VENDOR_ID, PointGreyRegisters
from capture.iidc.signature import ByteOrder, SignatureReader
from capture.seam import Arrival
from rig.clocks import NS_PER_S, NS_PER_US, ClockLatch, DeviceNs, HostNs, host_now
from rig.errors import CameraError, CameraNotFoundError, SvevError
from rig.frame import DamagedRecord, FrameRecord, StampedPixels
from rig.settings.camera import CameraSettings
from rig.settings.region import RegionLimits
from rig.transport.ring import CameraRing

_CLOCK_STEP_NS: Final = 5_000_000  # far more than a crystal drifts between two latches
_LOGGER: Final = logging.getLogger("svev.iidc")


class IidcCamera:
    """One FireWire camera, triggered by its input or, if `software`, by commands (`fire`).

    Raises:
        CameraNotFoundError: it is not there; the message tells why.
        CameraError: it refuses its settings, or finds no room on the bus.
        BadInputError: libdc1394 is missing.
    """

    def __init__(self, settings: CameraSettings, ring: CameraRing, rate_hz: float, *, software: bool = False) -> None:
        self._settings, self._ring, self._software = settings, ring, software
        self._underruns = self._frames = 0
        self._notices: list[str] = []
        self._exposure_ns = 0 if settings.iidc.trigger_mode == 1 else round(settings.exposure_us * NS_PER_US)
        self._cleanup = ExitStack()
        try:
            self._connect(settings, rate_hz)
        except Dc1394Error as error:
            self.close()
            raise CameraError(
                f"camera {settings.name} refuses its settings: {error}; check the rig file against the camera's manual"
            ) from None
        except CameraNotFoundError as error:
            self.close()
            raise CameraNotFoundError(f"camera {settings.name}: {error}") from None
        except SvevError:
            self.close()
            raise

    def _connect(self, settings: CameraSettings, rate_hz: float) -> None:
        bus = self._cleanup.enter_context(Bus())
        device = self._device = self._cleanup.enter_context(Device(bus, bus.find(int(settings.address, 16))))
        self._at_close(lambda: device.set_transmission(on=False))  # also what a crashed run left on
        device.set_transmission(on=False)
        self._format = set_video_format(device, settings, rate_hz)
        set_trigger(device, settings, software=self._software)
        set_gain(device, settings)
        self._copy = copier(settings, at_top=device.vendor_id == AVT_VENDOR_ID)
        self._avt = AvtRegisters(device)
        self._clock: BusClock = PacketTimes()
        self._signatures: SignatureReader | None = None
        self._signer: AvtRegisters | PointGreyRegisters = self._avt
        if device.vendor_id == POINT_GREY_VENDOR_ID:
            self._signer = PointGreyRegisters(device)
        if self._signer.signs and not settings.iidc.signature:
            self._signer.sign_nothing()
        elif self._signer.signs:
            self._signer.sign()
            self._clock = CycleTimer(device)
            delay_ns = longest_delay_ns(settings, round(NS_PER_S / rate_hz))
            self._signatures = SignatureReader(
                delay_ns, pixel_bytes=settings.format.pixels.size, words=self._signer.words
            )
            self._stamped_pixels = StampedPixels(self._signer.row % settings.region.height, 0, self._signatures.bytes)
            self._stamp_at = self._stamped_pixels.row * settings.region.width * settings.format.pixels.size
        self._dma = DmaRing(device, settings.iidc.dma_frames, settings.name)
        self._at_close(self._dma.close)
        set_exposure(device, self._avt, settings)

    @property
    def description(self) -> str:
        """Vendor, model, GUID, format and bandwidth."""
        signed = "no signature, times from packets"
        if self._signatures is not None:
            signed = "signs its frames" if self._signer is self._avt else "numbers and times its frames"
        need = self._format.need
        return f"{self._device.name}, {self._format.name}, {need.units} bandwidth units, {signed}"

    @property
    def limits(self) -> RegionLimits | None:
        """See `capture.seam.Camera.limits`."""
        return region_limits(self._device, self._settings)

    @property
    def byte_order(self) -> ByteOrder | None:
        """Order of the bytes in the signature; None without a signature, or before the first frame."""
        return None if self._signatures is None else self._signatures.order

    @property
    def transport_ns(self) -> int:
        """Time from the first packet of a frame to its last."""
        return self._format.need.transport_ns

    def start(self) -> None:
        """See `capture.seam.Camera.start`."""
        try:
            self._device.set_transmission(on=True)
        except Dc1394Error as error:
            raise CameraError(f"camera {self._settings.name} does not start: {error}; check its power") from None

    def receive(self, timeout_s: float) -> Arrival | None:
        """See `capture.seam.Camera.receive`."""
        try:
            frame = self._dma.wait(timeout_s)
            if frame is not None:
                return self._take(frame)
            if self._dma.disturbed:
                self._after_bus_reset()
        except Dc1394Error as error:
            raise self._gone(error) from None
        return None

    def fire(self) -> None:
        """See `capture.seam.Commanded.fire`."""
        try:
            self._device.fire()
        except Dc1394Error as error:
            raise self._gone(error) from None

    def latch(self) -> ClockLatch:
        """See `capture.seam.Camera.latch`."""
        try:
            return self._clock.latch()
        except Dc1394Error as error:
            raise self._gone(error) from None

    def counters(self) -> Mapping[str, int]:
        """Frames for which the ring had no free slot. The camera's own counts come with the frames."""
        return {"underruns": self._underruns}

    def notices(self) -> Sequence[str]:
        """See `capture.seam.Camera.notices`."""
        notices, self._notices = self._notices, []
        return notices

    @property
    def bytes_received(self) -> int:
        """See `capture.seam.Camera.bytes_received`."""
        return 0

    def close(self) -> None:
        """Stop the camera, and close it and the library."""
        self._cleanup.close()
        self._ring.reclaim()

    # -- details -------------------------------------------------------------------------------------------------

    def _at_close(self, step: Callable[[], None]) -> None:
        """Add a step to `close`, which goes on if the step fails because the camera is dead."""

        def carefully() -> None:
            try:
                step()
            except Dc1394Error as error:
                _LOGGER.info("closing camera %s: %s", self._settings.name, error)

        self._cleanup.callback(carefully)

    def _take(self, frame: Any) -> Arrival | None:
        """Read the frame's signature, copy the frame into a slot of the ring, and give its DMA buffer back."""
        contents = frame.contents
        first = first_packet(contents.timestamp)
        try:
            if contents.image_bytes != self._ring.frame_bytes:
                raise CameraError(
                    f"camera {self._settings.name} sends {contents.image_bytes} bytes per frame, the rig file's region "
                    f"makes {self._ring.frame_bytes}: correct region and pixel_format of {self._settings.name}"
                )
            return self._arrival(contents.image, first)
        finally:
            self._dma.give_back(frame)

    def _arrival(self, image: int, first: HostNs) -> Arrival | None:
        self._frames += 1
        frames, triggers = self._frames, -1
        stamped: StampedPixels | None = None
        device_time = self._clock.at(HostNs(first - self._exposure_ns - READOUT_NS))
        if self._signatures is not None:
            data = ctypes.string_at(image + self._stamp_at, self._signatures.line_bytes)
            signature = self._signatures.read(data, self._clock.at(first))
            if signature is None:
                return DamagedRecord(host_now(), device_time)
            device_time, frames, triggers = DeviceNs(signature.trigger_ns), signature.frames, signature.triggers
            stamped = self._stamped_pixels
        slot = self._ring.take_slot()
        if slot is None:
            self._underruns += 1
            return None
        self._copy(image, self._ring.frame(slot))
        return FrameRecord(host_now(), slot, frames, 0, device_time, triggers, stamped)

    def _after_bus_reset(self) -> None:
        """After somebody plugged a device, or a power dip: go on if the camera still has our settings.

        Raises:
            CameraError: it has not, or the bus has another clock.
        """
        self._dma.disturbed = False
        device = self._device
        same = (
            device.transmits()
            and device.is_triggered()
            and device.mode() == self._format.mode
            and (self._signatures is None or self._signer.still_signs())
        )
        if not same:
            raise CameraError(
                f"camera {self._settings.name} lost its settings at a FireWire bus reset; connecting again"
            )
        if abs(self._clock_step()) > _CLOCK_STEP_NS:
            raise CameraError(
                f"the FireWire bus of camera {self._settings.name} has another clock after a bus reset; "
                "connecting again"
            )
        self._notices.append("FireWire bus reset; the camera goes on as it was set")

    def _clock_step(self) -> int:
        """By how much the camera's clock differs from what it should show, ns."""
        now = host_now()
        expected = self._clock.at(now)
        latch = self._clock.latch()
        return (latch.device - expected) - (latch.host - now)

    def _gone(self, error: Dc1394Error) -> CameraError:
        return CameraError(
            f"camera {self._settings.name} does not answer any more ({error}); check its power and cable"
        )
