"""Examines the cameras of the rig, except FireWire ones: does each one answer, is it free, which others are there?"""

import os
import socket
from collections import Counter
from collections.abc import Iterator, Sequence

from rig.errors import BadInputError
from rig.host.interfaces import sharing_subnet, way_to
from rig.phrase import phrase
from rig.settings.camera import CameraSettings
from rig.settings.model import RigSettings
from service.processes.replayed_log import check_replay
from svev.doctor.cameras.child import Trial, hear
from svev.doctor.finding import Finding, Level, Topic, failure, judged, passed, warning
from svev.gige.gvcp import FoundCamera, ask_camera, find_cameras
from svev.gige.path_probe import SMALL, largest_packet

_ANSWER_S = 1.5
_GVCP_PORT = 3956
_TRIAL_S = 15.0


def look_at_cameras(rig: RigSettings) -> Iterator[Finding]:
    """Examine each camera of the rig file, in its order, and cameras that replay a log together.

    GigE Vision cameras that answer are opened as a recording opens them, and set back.
    """
    ready = []
    if any(camera.backend == "replay" for camera in rig.cameras):
        yield _look_at_log(rig)
    for camera in rig.cameras:
        match camera.backend:
            case "sim":
                what = "{camera} is simulated inside the program"
                yield passed(Topic.CAMERAS, "check_sim_camera", what, camera=camera.name)
            case "aravis" if rig.simulation is not None:
                yield _look_at_simulated(camera)
            case "aravis":
                found = [_look_at_gige(camera)]
                if found[0].level is Level.PASS and rig.network.packet_size > SMALL:
                    found += _look_at_way(camera, rig.network.packet_size)
                yield from found
                if all(each.level is Level.PASS for each in found):
                    ready.append(camera.name)
            case "iidc":
                pass  # `svev.doctor.cameras.firewire` examines these together
            case "replay":
                pass  # `_look_at_log` examines these together
    if ready:
        yield from _try(rig, ready)


def look_limit_s(rig: RigSettings) -> float:
    """Time limit of `look_at_cameras`, s."""
    return (5.0 + _TRIAL_S) * len(rig.cameras)


def _try(rig: RigSettings, names: Sequence[str]) -> Iterator[Finding]:
    limit_s = _TRIAL_S * len(names)
    config = Trial(rig=rig, names=tuple(names))
    heard = hear("trial of cameras", "svev.doctor.cameras.gige_trial", config, limit_s, {})
    yield from heard.findings
    if heard.hangs:
        what, remedy = "{cameras}: not set up within {seconds:g} s", "switch them off and on, and try again"
        yield failure(Topic.CAMERAS, "check_trial_hangs", what, remedy, cameras=", ".join(names), seconds=limit_s)
    if heard.broken:
        what, remedy = "{cameras} cannot be tried: {why}", "report it with this line"
        yield failure(Topic.CAMERAS, "check_trial_broken", what, remedy, cameras=", ".join(names), why=heard.broken)


def look_for_cameras(rig: RigSettings) -> Iterator[Finding]:
    """List the cameras on all networks of this machine; takes a second."""
    if rig.simulation is not None or not any(camera.backend == "aravis" for camera in rig.cameras):
        return
    names = {camera.address: camera.name for camera in rig.cameras}
    found = find_cameras()
    if not found:
        remedy = "check power and cables, and that no firewall blocks UDP port 3956"
        yield warning(Topic.CAMERAS, "check_none_found", "no camera answers a broadcast on any network", remedy)
    times = Counter(each.camera.address for each in found)
    for each in found:
        yield judge_found(each, names, alone=times[each.camera.address] == 1)


def judge_found(found: FoundCamera, names: dict[str, str], *, alone: bool = True) -> Finding:
    """Judge a camera that was found.

    Args:
        found: the camera.
        names: names of the cameras in the rig file, by address.
        alone: whether no other camera has its address.
    """
    camera, port = found.camera, found.interface
    said = phrase(
        "camera_found",
        "found behind {port}: {model}, serial {serial}, at {address}",
        port=port.name, model=f"{camera.vendor} {camera.model}", serial=camera.serial, address=camera.address,
    )  # fmt: skip
    if not found.reachable:
        return warning(
            Topic.CAMERAS,
            "check_found_unreachable",
            "{said}, which is not in the subnet {subnet} of this port",
            "run: svev cameras set-ip {mac} ADDRESS, or give {port} an address in its subnet",
            said=said,
            subnet=str(port.network),
            mac=camera.mac,
            port=port.name,
        )
    if not alone:
        what = "{said}, an address that another camera has too"
        remedy = "give each camera an address of its own: svev cameras set-ip {mac} ADDRESS"
        return warning(Topic.CAMERAS, "check_found_twice", what, remedy, said=said, mac=camera.mac)
    way = way_to(camera.address)
    if way is not None and way.interface != port and way.interface.network.overlaps(port.network):
        return warning(
            Topic.CAMERAS,
            "check_found_elsewhere",
            "{said}, but the computer sends to this address by {way}",
            "give each port a subnet of its own, then: svev cameras set-ip {mac} ADDRESS",
            said=said,
            way=way.interface.name,
            mac=camera.mac,
        )
    if name := names.get(camera.address):
        return passed(Topic.CAMERAS, "check_found", "{said}, {camera} of the rig file", said=said, camera=name)
    return passed(Topic.CAMERAS, "check_found_other", "{said}, not in the rig file", said=said)


def _look_at_log(rig: RigSettings) -> Finding:
    try:
        check_replay(rig)
    except BadInputError as error:
        remedy = "correct address, names, regions or trigger.rate_hz in the rig file, or replay another log"
        return failure(Topic.CAMERAS, "check_replay_wrong", "{why}", remedy, why=error.said)
    names, what = ", ".join(camera.name for camera in rig.cameras), "{cameras} are replayed from {log}"
    return passed(Topic.CAMERAS, "check_replay", what, cameras=names, log=rig.cameras[0].address)


def _no_answer_by(port: str, ports: str, camera: CameraSettings) -> Finding:
    """A camera does not answer by the one of several ports of a subnet by which the computer asks it."""
    what = "{camera} at {address} does not answer by {port}, the one port by which the computer asks it"
    remedy = "give each of {ports} a subnet of its own, or plug the camera in at {port}; see the network above"
    return failure(
        Topic.CAMERAS, "check_no_answer_shared", what, remedy,
        camera=camera.name, address=camera.address, port=port, ports=ports,
    )  # fmt: skip


def _look_at_gige(camera: CameraSettings) -> Finding:
    name, address = camera.name, camera.address
    remedy = "check its power and cable, and that a network port of this machine has an address in its subnet"
    try:
        answer = ask_camera(address, _ANSWER_S)
    except (OSError, ValueError) as error:
        what = "{camera} at {address} cannot be asked: {why}"
        return failure(Topic.CAMERAS, "check_not_asked", what, remedy, camera=name, address=address, why=str(error))
    if answer is None:
        way = way_to(address)
        if way is not None and len(sharing := sharing_subnet(way.interface)) > 1:
            return _no_answer_by(way.interface.name, ", ".join(each.name for each in sharing), camera)
        what = "{camera} at {address} does not answer"
        return failure(Topic.CAMERAS, "check_no_answer", what, remedy, camera=name, address=address)
    there, in_use = answer
    said = phrase(
        "check_answers",
        "{camera} at {address}: {model}, serial {serial}",
        camera=name, address=address, model=f"{there.vendor} {there.model}", serial=there.serial,
    )  # fmt: skip
    if in_use:
        what, remedy = "{said}, is controlled by another program", "end that program (another svev?)"
        return failure(Topic.CAMERAS, "check_controlled", what, remedy, said=said)
    return judged(Level.PASS, Topic.CAMERAS, said, remedy)


def _look_at_way(camera: CameraSettings, size: int) -> Iterator[Finding]:
    """Do packets as large as are asked for come through? Switches drop larger ones than theirs without a word."""
    largest = largest_packet(camera.address, size)
    if largest is None:  # nothing is known
        return
    said = phrase(
        "check_packets", "{camera}: packets of {size} bytes come through", camera=camera.name, size=str(largest)
    )
    if largest == size:
        yield judged(Level.PASS, Topic.NETWORK, said, "")
        return
    yield failure(
        Topic.NETWORK,
        "check_packets_dropped",
        "{said}, and {wanted} are asked for: no frame will arrive",
        "allow jumbo frames in every switch between {camera} and this computer, or set network.packet_size = {size} in "
        "the rig file",
        said=said,
        wanted=str(size),
        camera=camera.name,
        size=str(largest),
    )


def _look_at_simulated(camera: CameraSettings) -> Finding:
    """Is the address of a simulated camera free? The camera itself is started with the recording."""
    remedy = "end the program that uses it (another svev?), or correct the address"
    where = phrase("check_simulated", "{camera} is simulated at {address}", camera=camera.name, address=camera.address)
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind((camera.address, _GVCP_PORT))
    except OSError as error:
        why = os.strerror(error.errno) if error.errno else str(error)
        what = "{said}, which cannot be taken: {why}"
        return failure(Topic.CAMERAS, "check_simulated_taken", what, remedy, said=where, why=why)
    return judged(Level.PASS, Topic.CAMERAS, where, remedy)
