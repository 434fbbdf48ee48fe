"""Examines the cameras of the rig, except FireWire ones: does each one answer, is it free, which others are there?"""

import os
import socket
from collections.abc import Iterator

from rig.errors import BadInputError
from rig.settings.model import CameraSettings, RigSettings
from service.processes.replayed_log import check_replay
from svev.doctor.finding import Finding, Topic, failure, passed, warning
from svev.gige.gvcp import FoundCamera, ask_camera, find_cameras

_ANSWER_S = 1.5
_GVCP_PORT = 3956


def look_at_cameras(rig: RigSettings) -> Iterator[Finding]:
    """Examine each camera of the rig file, in its order, and cameras that replay a log together."""
    if any(camera.backend == "replay" for camera in rig.cameras):
        yield _look_at_log(rig)
    for camera in rig.cameras:
        match camera.backend:
            case "sim":
                yield passed(Topic.CAMERAS, f"{camera.name} is simulated inside the program")
            case "aravis" if rig.simulation is not None:
                yield _look_at_simulated(camera)
            case "aravis":
                yield _look_at_gige(camera)
            case "iidc":
                pass  # `svev.doctor.firewire` examines these together
            case "replay":
                pass  # `_look_at_log` examines these together


def look_for_cameras(rig: RigSettings) -> Iterator[Finding]:
    """List the cameras on all networks of this machine; takes a second."""
    if rig.simulation is not None or not any(camera.backend == "aravis" for camera in rig.cameras):
        return
    names = {camera.address: camera.name for camera in rig.cameras}
    found = find_cameras()
    if not found:
        remedy = "check power and cables, and that no firewall blocks UDP port 3956"
        yield warning(Topic.CAMERAS, "no camera answers a broadcast on any network", remedy)
    for each in found:
        yield judge_found(each, names)


def judge_found(found: FoundCamera, names: dict[str, str]) -> Finding:
    """Judge a camera that was found.

    Args:
        found: the camera.
        names: names of the cameras in the rig file, by address.
    """
    camera, port = found.camera, found.interface
    what = f"found behind {port.name}: {camera.vendor} {camera.model}, serial {camera.serial}, at {camera.address}"
    if not found.reachable:
        remedy = f"run: svev cameras set-ip {camera.serial} ADDRESS, or give {port.name} an address in its subnet"
        return warning(Topic.CAMERAS, f"{what}, which is not in the subnet {port.network} of this port", remedy)
    name = names.get(camera.address)
    return passed(Topic.CAMERAS, f"{what}, {name} of the rig file" if name else f"{what}, not in the rig file")


def _look_at_log(rig: RigSettings) -> Finding:
    try:
        check_replay(rig)
    except BadInputError as error:
        remedy = "correct address, names, regions or trigger.rate_hz in the rig file, or replay another log"
        return failure(Topic.CAMERAS, str(error), remedy)
    names = ", ".join(camera.name for camera in rig.cameras)
    return passed(Topic.CAMERAS, f"{names} are replayed from {rig.cameras[0].address}")


def _look_at_gige(camera: CameraSettings) -> Finding:
    where = f"{camera.name} at {camera.address}"
    remedy = "check its power and cable, and that a network port of this machine has an address in its subnet"
    try:
        answer = ask_camera(camera.address, _ANSWER_S)
    except (OSError, ValueError) as error:
        return failure(Topic.CAMERAS, f"{where} cannot be asked: {error}", remedy)
    if answer is None:
        return failure(Topic.CAMERAS, f"{where} does not answer", remedy)
    camera_there, in_use = answer
    who = f"{where}: {camera_there.vendor} {camera_there.model}, serial {camera_there.serial}"
    if in_use:
        return failure(Topic.CAMERAS, f"{who}, is controlled by another program", "end that program (another svev?)")
    return passed(Topic.CAMERAS, who)


def _look_at_simulated(camera: CameraSettings) -> Finding:
    """Is the address of a simulated camera free? The camera itself is started with the recording."""
    where = f"{camera.name} is simulated at {camera.address}"
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind((camera.address, _GVCP_PORT))
    except OSError as error:
        what = f"{where}, which cannot be taken: {os.strerror(error.errno) if error.errno else error}"
        return failure(Topic.CAMERAS, what, "end the program that uses it (another svev?), or correct the address")
    return passed(Topic.CAMERAS, where)
