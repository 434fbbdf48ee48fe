"""Finds FireWire cameras, and tells why one is not found: no port, no permission, no camera at all, or another GUID.

libdc1394 gives the same answer, an empty list, in the first three cases.
"""

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Final, Self

from capture.iidc.library import Library, load
from capture.iidc.structures import ListPointer
from rig.errors import CameraError, CameraNotFoundError

_DEVICES: Final = Path("/dev")
_SYSFS: Final = Path("/sys/bus/firewire/devices")


@dataclass(frozen=True, slots=True)
class Found:
    """A camera on a FireWire bus of this computer.

    Attributes:
        guid: its globally unique identifier.
        unit: which camera of the device, for devices with several.
    """

    guid: int
    unit: int


def guid_text(guid: int) -> str:
    """A GUID as the camera's label and the rig file have it."""
    return f"{guid:016x}"


class Bus:
    """libdc1394's view of all FireWire buses of this computer; a context manager.

    Attributes:
        handle: `dc1394_t`.

    Raises:
        BadInputError: libdc1394 is missing.
        CameraNotFoundError: there is no FireWire port.
    """

    def __init__(self, devices: Path = _DEVICES) -> None:
        self.library: Library = load()
        self._devices = devices
        self.handle: int | None = self.library.get("new")
        if not self.handle:
            raise CameraNotFoundError(why_no_camera(devices))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Close the library's handle; a second call does nothing."""
        if self.handle:
            self.library.get("free", self.handle)
        self.handle = None

    def cameras(self) -> list[Found]:
        """All cameras that answer.

        Raises:
            CameraError: libdc1394 cannot list them.
        """
        with self._camera_list() as found:
            return [Found(int(found.ids[i].guid), int(found.ids[i].unit)) for i in range(found.num)]

    def find(self, guid: int) -> Found:
        """The camera with a GUID.

        Raises:
            CameraNotFoundError: it is not there; the message says why and what to do.
        """
        cameras = self.cameras()
        for camera in cameras:
            if camera.guid == guid:
                return camera
        if not cameras:
            raise CameraNotFoundError(why_no_camera(self._devices))
        others = ", ".join(sorted(guid_text(camera.guid) for camera in cameras))
        denied = _denied(self._devices)
        hint = f" ({_permission(denied)})" if denied else ""
        raise CameraNotFoundError(
            f"no FireWire camera with GUID {guid_text(guid)}, but {others}: correct the address in the rig file, or "
            f"check power and cable of that camera{hint}"
        )

    @contextmanager
    def _camera_list(self) -> Iterator[ctypes.Structure]:
        pointer = ListPointer()
        self.library.call("camera_enumerate", self.handle, ctypes.byref(pointer))
        if not pointer:
            raise CameraError("libdc1394 does not list the FireWire cameras: plug a camera out and in, then try again")
        try:
            yield pointer.contents
        finally:
            self.library.get("camera_free_list", pointer)


def why_no_camera(devices: Path = _DEVICES, sysfs: Path = _SYSFS) -> str:
    """The reason why libdc1394 lists nothing, and what to do about it.

    Args:
        devices: the directory of the device files.
        sysfs: where the kernel says what they are.
    """
    if not _device_files(devices):
        return (
            "this computer has no FireWire port that the kernel drives (no /dev/fw*): fit a FireWire card, and if it "
            "has one, run: sudo modprobe firewire-ohci"
        )
    if denied := _denied(devices, sysfs):
        return _permission(denied)
    return "no FireWire camera answers: check its power and cable, and its place in the chain of cables"


def _device_files(devices: Path) -> list[Path]:
    return sorted(path for path in devices.glob("fw*") if path.name[2:].isdigit())


def _denied(devices: Path, sysfs: Path = _SYSFS) -> list[Path]:
    """Device files of other devices than the computer's own card that this user may not open."""
    others = [path for path in _device_files(devices) if not _is_own_card(sysfs / path.name)]
    return [path for path in others if not os.access(path, os.R_OK | os.W_OK)]


def _is_own_card(device: Path) -> bool:
    try:
        return (device / "is_local").read_text().strip() == "1"
    except FileNotFoundError:
        return False


def _permission(denied: list[Path]) -> str:
    names = ", ".join(str(path) for path in denied)
    return (
        f"no right to use the FireWire devices {names}: run: sudo usermod -aG video $USER, then log in again "
        "(and see docs/how-to/firewire.md for the udev rule)"
    )
