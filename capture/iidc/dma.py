"""Fetches frames from the kernel's ring of DMA buffers, through libdc1394, with a deadline for each wait."""

import ctypes
import select
from os import close
from typing import Any, Final

from capture.iidc.bandwidth import UNITS_PER_BUS
from capture.iidc.device import Device
from capture.iidc.library import Dc1394Error
from capture.iidc.structures import CAPTURE_FLAGS_DEFAULT, CAPTURE_POLICY_POLL, Code, FramePointer, VideoFrame
from rig.clocks import NS_PER_S, host_now
from rig.errors import CameraError

_libc: Final = ctypes.CDLL(None)
_libc.munmap.argtypes = (ctypes.c_void_p, ctypes.c_size_t)
_GONE: Final = select.POLLHUP | select.POLLERR | select.POLLNVAL


class DmaRing:
    """Frames of one camera as the FireWire card writes them into memory.

    Args:
        device: the camera, its format set.
        frames: size of the ring, frames.
        name: of the camera, for messages.

    Attributes:
        disturbed: `wait` ended without a frame because the bus was reset. The caller clears it.

    Raises:
        CameraError: no channel, no bandwidth, no memory.
    """

    def __init__(self, device: Device, frames: int, name: str) -> None:
        self._device, self._name = device, name
        self.disturbed = False
        try:
            device.call("capture_setup", frames, CAPTURE_FLAGS_DEFAULT)
        except Dc1394Error as error:
            # The kernel has one error for both, so libdc1394 reports -7 (no channel) if there is no bandwidth left.
            if error.code not in (Code.NO_ISO_CHANNEL, Code.NO_BANDWIDTH):
                raise
            raise CameraError(
                f"camera {name} finds no room on its FireWire bus: it needs {device.bandwidth_units()} of its "
                f"{UNITS_PER_BUS} bandwidth units and a channel; stop other cameras on the bus, or make regions smaller"
            ) from None
        self._frames, self._memory, self._bytes = frames, 0, 0
        self._descriptor = device.file_descriptor()
        self._poll = select.poll()
        self._poll.register(self._descriptor, select.POLLIN)

    def wait(self, timeout_s: float) -> Any:
        """Wait for the next frame.

        Args:
            timeout_s: longest wait, s.

        Returns:
            Pointer to a `VideoFrame`, which the caller must `give_back`; None if none came, or if `disturbed`.

        Raises:
            CameraError: the camera was unplugged.
        """
        deadline = host_now() + round(timeout_s * NS_PER_S)
        while True:
            remaining_ms = max(0, deadline - host_now()) / 1e6
            ready = self._poll.poll(remaining_ms)
            if not ready:
                return None
            if ready[0][1] & _GONE:
                raise CameraError(f"camera {self._name} is gone from the FireWire bus; check its power and cable")
            frame = FramePointer()
            self._device.call("capture_dequeue", CAPTURE_POLICY_POLL, ctypes.byref(frame))
            if frame:
                self._note_memory(frame.contents)
                return frame
            self.disturbed = True
            return None

    def give_back(self, frame: Any) -> None:
        """Return a frame's buffer to the ring."""
        self._device.call("capture_enqueue", frame)

    def close(self) -> None:
        """Stop, and free the ring, even if the camera is gone.

        Raises:
            Dc1394Error: the card does not stop.
        """
        try:
            self._device.call("capture_stop")
        except Dc1394Error:
            # libdc1394 2.2.6 gives up at its first step and leaks descriptor and memory: free them here.
            close(self._descriptor)
            if self._memory:
                _libc.munmap(self._memory, self._bytes)
            raise

    def _note_memory(self, frame: VideoFrame) -> None:
        """Note address and size of the ring, whose frames stand one behind the other, for `close`."""
        self._memory = frame.image - frame.id * frame.total_bytes
        self._bytes = frame.total_bytes * self._frames
