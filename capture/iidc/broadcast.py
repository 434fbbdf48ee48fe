"""Tells all cameras of a FireWire bus to expose: one broadcast write to their software trigger registers."""

from collections.abc import Sequence
from contextlib import ExitStack
from types import TracebackType
from typing import Self

from capture.iidc.bus import Bus, guid_text, why_no_camera
from capture.iidc.device import Device
from rig.errors import CameraNotFoundError


class Broadcast:
    """A way to all cameras of the bus on which one of the given cameras is; a context manager.

    That camera is only the way to the bus: it stays in the hands of its grabber.

    Args:
        guids: of the cameras, any of which may be missing.

    Raises:
        CameraNotFoundError: none of them answers.
        CameraError: the bus cannot be used.
    """

    def __init__(self, guids: Sequence[int]) -> None:
        with ExitStack() as stack:
            bus = stack.enter_context(Bus())
            found = next((camera for camera in bus.cameras() if camera.guid in guids), None)
            if found is None:
                raise CameraNotFoundError(why_no_camera())
            self._device = stack.enter_context(Device(bus, found))
            self._device.set_broadcast()
            self.name = f"FireWire bus of {guid_text(found.guid)}"
            self._cleanup = stack.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        self._cleanup.close()

    def fire(self) -> None:
        """Let all cameras expose.

        Raises:
            CameraError: the bus does not take the command.
        """
        self._device.fire()
