"""Examines the cameras of the rig, except FireWire ones: does each one answer, is it free, which others are there?"""

import os
import socket
import struct
import time
from collections.abc import Iterator
from dataclasses import dataclass

from rig.errors import BadInputError
from rig.settings.model import CameraSettings, RigSettings
from service.processes.replayed_log import check_replay
from svev.doctor.finding import Finding, Topic, failure, passed

_PORT = 3956
_REQUEST = struct.Struct(">BBHHH")  # 0x42, flags, command, length, request id (GigE Vision 2.0, section 15)
_ANSWER = struct.Struct(">HHHH")  # status, acknowledge, length, request id
_KEY, _WANTS_ANSWER = 0x42, 0x01
_DISCOVERY, _READ_REGISTER = 0x0002, 0x0080
_CONTROL_CHANNEL_PRIVILEGE = 0x0A00
_CONTROLLED = 0b11  # exclusive access or control access is taken
_TRIES = 3


@dataclass(frozen=True, slots=True)
class GigeCamera:
    """Answer of a camera to the discovery request, and whether a program controls it."""

    vendor: str
    model: str
    serial: str
    in_use: bool


def ask_camera(address: str, timeout_s: float) -> GigeCamera | None:
    """Ask the camera at `address` what it is.

    Returns:
        None if nothing answers within `timeout_s` seconds.

    Raises:
        OSError: there is no route to the address.
        ValueError: the answer is not that of a camera.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as channel:
        channel.connect((address, _PORT))
        who = _ask(channel, _DISCOVERY, b"", timeout_s)
        if who is None:
            return None
        if len(who) < 248:
            raise ValueError(f"the discovery answer has {len(who)} bytes, 248 are due")
        control = _ask(channel, _READ_REGISTER, struct.pack(">I", _CONTROL_CHANNEL_PRIVILEGE), timeout_s)
    in_use = control is not None and len(control) == 4 and bool(control[3] & _CONTROLLED)
    return GigeCamera(_text(who[72:104]), _text(who[104:136]), _text(who[216:232]), in_use)


def _ask(channel: socket.socket, command: int, payload: bytes, timeout_s: float) -> bytes | None:
    """The payload of the answer, None if there is none; repeats the request, since a datagram may get lost."""
    for request_id in range(1, _TRIES + 1):
        channel.send(_REQUEST.pack(_KEY, _WANTS_ANSWER, command, len(payload), request_id) + payload)
        deadline = time.monotonic() + timeout_s / _TRIES
        while (left := deadline - time.monotonic()) > 0:
            channel.settimeout(left)
            try:
                answer = channel.recv(1024)
            except (TimeoutError, ConnectionRefusedError):  # refused: the address is of a computer, not of a camera
                break
            if len(answer) >= _ANSWER.size and _ANSWER.unpack_from(answer)[1] == command + 1:
                return answer[_ANSWER.size :]
    return None


def _text(field: bytes) -> str:
    return field.split(b"\0")[0].decode(errors="replace")


def discover() -> list[str]:
    """GigE Vision cameras that answer a broadcast within a second: address, vendor, model, serial number."""
    import gi  # noqa: PLC0415 - Aravis may be missing, which is a finding of its own

    gi.require_version("Aravis", "0.8")
    from gi.repository import Aravis  # noqa: PLC0415

    Aravis.disable_interface("USB3Vision")
    Aravis.disable_interface("Fake")
    Aravis.update_device_list()
    found = [
        f"{Aravis.get_device_address(i)} {Aravis.get_device_vendor(i)} {Aravis.get_device_model(i)} "
        f"serial {Aravis.get_device_serial_nbr(i)}"
        for i in range(Aravis.get_n_devices())
    ]
    Aravis.shutdown()
    return found


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
    """List the cameras that Aravis finds on all networks of this machine; takes a second."""
    if rig.simulation is not None or not any(camera.backend == "aravis" for camera in rig.cameras):
        return

    found = discover()
    what = ", ".join(found) if found else "none (a camera in another subnet is not found this way)"
    yield passed(Topic.CAMERAS, f"found on the network: {what}")


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
    who = f"{where}: {answer.vendor} {answer.model}, serial {answer.serial}"
    if answer.in_use:
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
