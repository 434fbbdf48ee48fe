"""Are the cameras of the rig there, and which others are?"""

import os
import socket
from collections.abc import Iterator

from rig.settings import CameraSettings, RigSettings
from svev.doctor.finding import Finding, Topic, failure, passed
from svev.doctor.gvcp import ask_camera

_ANSWER_S = 1.5
_GVCP_PORT = 3956


def look_at_cameras(rig: RigSettings) -> Iterator[Finding]:
    """Each camera of the rig file, in its order."""
    for camera in rig.cameras:
        match camera.backend:
            case "sim":
                yield passed(Topic.CAMERAS, f"{camera.name} is simulated inside the program")
            case "aravis" if rig.simulation is not None:
                yield _look_at_simulated(camera)
            case "aravis":
                yield _look_at_gige(camera)
            case "iidc":
                pass  # all at once: `svev.doctor.firewire`
            case other:
                remedy = 'use backend "aravis", "iidc" or "sim"'
                yield failure(Topic.CAMERAS, f'{camera.name}: backend "{other}" is not built yet', remedy)


def look_for_cameras(rig: RigSettings) -> Iterator[Finding]:
    """What Aravis finds on all networks of this machine. Takes a second."""
    if rig.simulation is not None or not any(camera.backend == "aravis" for camera in rig.cameras):
        return
    from svev.doctor.discovery import discover  # noqa: PLC0415 - Aravis may be missing, which is a finding of its own

    found = discover()
    what = ", ".join(found) if found else "none (a camera in another subnet is not found this way)"
    yield passed(Topic.CAMERAS, f"found on the network: {what}")


def _look_at_gige(camera: CameraSettings) -> Finding:
    where = f"{camera.name} at {camera.address}"
    remedy = "check its power and cable, and that a network port of this machine has an address in its subnet"
    try:
        answer = ask_camera(camera.address, _ANSWER_S)
    except (OSError, ValueError) as error:
        return failure(Topic.CAMERAS, f"{where} cannot be asked: {error}", remedy)
    if answer is None:
        return failure(Topic.CAMERAS, f"{where} does not answer", remedy)
    who = f"{where}: {answer.vendor} {answer.model}, serial {answer.serial}"
    if answer.in_use:
        return failure(Topic.CAMERAS, f"{who}, is controlled by another program", "end that program (another svev?)")
    return passed(Topic.CAMERAS, who)


def _look_at_simulated(camera: CameraSettings) -> Finding:
    """The simulated camera is started with the recording; its address has to be free until then."""
    where = f"{camera.name} is simulated at {camera.address}"
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind((camera.address, _GVCP_PORT))
    except OSError as error:
        what = f"{where}, which cannot be taken: {os.strerror(error.errno) if error.errno else error}"
        return failure(Topic.CAMERAS, what, "end the program that uses it (another svev?), or correct the address")
    return passed(Topic.CAMERAS, where)
