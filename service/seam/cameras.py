"""The part of the seam that is about single cameras: their pictures, and how they are calibrated by them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rig.api.calibrating import Calibrating, CalibratingOrder
from rig.api.cameras.aids import CameraAids
from rig.api.cameras.balls import CameraBalls
from rig.api.cameras.light import CameraLight, LightChange
from rig.frame import FrameStatus
from rig.pulse import RigPulse


@dataclass(frozen=True, slots=True)
class Preview:
    """The newest triplet, for the live view.

    Attributes:
        pulse: number of its pulse since the recorder was started.
        pixels: (rows, columns), uint8, or blue, green, red, (rows, columns, 3); the caller owns it.
        columns: first and one past the last column by camera.
        statuses: what became of the pulse, by camera.
    """

    pulse: RigPulse
    pixels: NDArray[np.uint8]
    columns: tuple[tuple[int, int], ...]
    statuses: tuple[FrameStatus, ...]


@dataclass(frozen=True, slots=True)
class CloseUp:
    """The newest frame of one camera, for setting it up.

    Attributes:
        pulse: number of its pulse since the recorder was started.
        status: what became of the frame.
        pixels: (rows, columns), uint8, or blue, green, red, (rows, columns, 3); the caller owns it.
        sharp: where it is in focus, (rows, columns); None: nobody asked.
    """

    pulse: RigPulse
    status: FrameStatus
    pixels: NDArray[np.uint8]
    sharp: NDArray[np.bool_] | None


class Cameras(Protocol):
    """The cameras of the rig, looked at and set up. Any thread may call any method.

    Raises (each where it applies):
        UnknownCameraError: the rig has no camera of this name.
        StateForbidsError: the present state of the rig forbids the call.
        SvevError: the call failed; the message says what to do.
    """

    def preview(self, newer_than: RigPulse, timeout_s: float) -> Preview | None:
        """Wait for a triplet of another pulse than `newer_than`; None if none came in time."""
        ...

    def camera_aids(self, camera: str, newer_than: RigPulse, timeout_s: float) -> CameraAids | None:
        """How sharp and how bright the picture of a camera is; waits as `preview`. UnknownCameraError: no such one."""
        ...

    def close_up(self, camera: str, newer_than: RigPulse, timeout_s: float, *, peaking: bool) -> CloseUp | None:
        """The whole picture of a camera; waits as `preview`. UnknownCameraError: no such one."""
        ...

    def camera_balls(self, camera: str) -> CameraBalls:
        """Where a camera should show the balls of the survey. UnknownCameraError: no such camera."""
        ...

    def camera_light(self, camera: str) -> CameraLight:
        """Exposure and gain of a camera. UnknownCameraError: no such one."""
        ...

    def change_light(self, camera: str, change: LightChange) -> CameraLight:
        """Change exposure or gain of a camera, and keep them in the rig file if that is wished.

        UnknownCameraError: no such camera. BadInputError: out of range. StateForbidsError: a recording runs.
        StorageError: the rig file cannot be written.
        """
        ...


class CalibrationHelper(Protocol):
    """Takes pictures of a target while somebody moves it, and computes a calibration. Any thread may call any method.

    Raises (each where it applies):
        StateForbidsError: there are no pictures, or no calibration yet, or a recording runs.
        BadInputError: a camera has no calibration.
        StorageError: pictures or rig file cannot be written.
    """

    def view(self) -> Calibrating:
        """What it does and has; who asks keeps it going."""
        ...

    def begin(self, order: CalibratingOrder) -> Calibrating:
        """Look at live pictures and keep those that are wanted."""
        ...

    def end(self) -> Calibrating:
        """Look no more, or give up computing; the pictures stay."""
        ...

    def undo(self) -> Calibrating:
        """Remove the pictures that were kept last."""
        ...

    def compute(self) -> Calibrating:
        """Compute a calibration from the pictures."""
        ...

    def save(self) -> Calibrating:
        """Put the calibration into the rig file, and into all logs from now on."""
        ...

    def protocol(self) -> Path:
        """The protocol of the calibration."""
        ...
