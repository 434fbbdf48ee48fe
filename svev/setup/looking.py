"""Child process that finds the cameras of both kinds, and takes a picture with each one that nobody uses.

A process of its own, so that a bus or a camera that hangs does not hang the questions.
"""

from contextlib import closing
from ipaddress import IPv4Address, IPv4Network
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from capture.aravis.camera import AravisCamera
from capture.iidc.bus import Bus, guid_text
from capture.iidc.camera import IidcCamera
from capture.seam import Camera, Commanded
from rig.clocks import NS_PER_S, host_now
from rig.errors import CameraError, SvevError
from rig.frame import FrameRecord
from rig.settings.camera import Backend, CameraSettings, Region
from rig.settings.model import NetworkSettings
from rig.settings.trigger import SoftwareTrigger
from rig.transport.child import begin
from rig.transport.message import Message, Quit
from rig.transport.ring import CameraRing
from svev.gige.features import features
from svev.gige.gvcp import GigeCamera, ask_camera, find_cameras
from svev.gige.path_probe import SMALL, largest_packet

_SLOTS: Final = 4
_PICTURE_NS: Final = 5 * NS_PER_S
_TURN_S: Final = 0.5
_ANSWER_S: Final = 1.0
_JUMBO: Final = 9000
_RATE_HZ: Final = 2.0
_EXPOSURE_US: Final = 2000.0


class Search(Message):
    """Configuration of the process.

    Attributes:
        folder: for the pictures.
        network: look for GigE Vision cameras in this network only; "": everywhere.
        addresses: ask these GigE Vision cameras; None: look for all.
        firewire: whether to look for FireWire cameras.
    """

    folder: str
    network: str
    addresses: tuple[str, ...] | None
    firewire: bool


class Seen(Message):
    """A camera that answered.

    Attributes:
        what: maker, model and number, for people.
        picture: file of its picture; "": there is none, and `why` says why.
        inputs: of its trigger; empty: they have the same name in all cameras of this kind.
        width, height: of its whole sensor, px; 0: not known.
        packet_size: the largest packets that come from it, bytes; 0: not known.
    """

    backend: Backend
    address: str
    what: str
    picture: str = ""
    why: str = ""
    inputs: tuple[str, ...] = ()
    width: int = 0
    height: int = 0
    packet_size: int = 0


class NoFireWire(Message):
    """Why there is no FireWire camera."""

    why: str


def main() -> None:
    """Find the cameras, and report each one."""
    child = begin(Search, Quit, grace_s=0.0)
    search, number = child.config, 0
    for camera in _gige(search):
        number += 1
        child.control.send(_look_at_gige(camera, Path(search.folder) / f"{number}.png"))
    if not search.firewire:
        return
    try:
        with Bus() as bus:
            guids = [guid_text(found.guid) for found in bus.cameras()]
    except SvevError as error:
        child.control.send(NoFireWire(why=str(error)))
        return
    for guid in guids:
        number += 1
        child.control.send(_look_at_firewire(guid, Path(search.folder) / f"{number}.png"))


def _gige(search: Search) -> list[GigeCamera]:
    if search.addresses is not None:
        return [answer[0] for answer in map(_asked, search.addresses) if answer is not None]
    network = IPv4Network(search.network) if search.network else None
    found = [each.camera for each in find_cameras() if each.reachable]
    return [camera for camera in found if network is None or IPv4Address(camera.address) in network]


def _asked(address: str) -> tuple[GigeCamera, bool] | None:
    try:
        return ask_camera(address, _ANSWER_S)
    except (OSError, ValueError):
        return None  # no way there, or no camera: it does not answer


def _look_at_gige(camera: GigeCamera, file: Path) -> Seen:
    seen = Seen(
        backend="aravis",
        address=camera.address,
        what=f"{camera.vendor} {camera.model}, serial {camera.serial}, at {camera.address}",
    )
    try:
        there = {each.name: each for each in features(camera.address)}
        sensor = [int(there[name].value) for name in ("SensorWidth", "SensorHeight") if name in there]
        sensor = sensor or [int(there[name].value) for name in ("WidthMax", "HeightMax") if name in there]
        seen.width, seen.height = sensor if len(sensor) == 2 else (0, 0)
        sources = there["TriggerSource"].allowed.split(", ") if "TriggerSource" in there else []
        seen.inputs = tuple(source for source in sources if source.startswith("Line"))
        seen.packet_size = largest_packet(camera.address, _JUMBO) or 0
        region = Region(width=seen.width, height=seen.height) if seen.width else Region()
        settings = CameraSettings(
            name="camera", backend="aravis", address=camera.address, region=region, exposure_us=_EXPOSURE_US
        )
        network = NetworkSettings(packet_size=seen.packet_size or SMALL)
        trigger = SoftwareTrigger(source="software", rate_hz=_RATE_HZ)
        with (
            closing(CameraRing.create("picture", settings.frame_bytes, _SLOTS)) as ring,
            closing(AravisCamera(settings, network, ring, trigger.period_ns, trigger)) as opened,
        ):
            seen.picture = _take(opened, ring, settings, file)
    except (SvevError, OSError) as error:
        seen.why = str(error)
    return seen


def _look_at_firewire(guid: str, file: Path) -> Seen:
    seen = Seen(backend="iidc", address=guid, what=f"FireWire camera {guid}")
    settings = CameraSettings(name="camera", backend="iidc", address=guid, exposure_us=_EXPOSURE_US)
    try:
        with (
            closing(CameraRing.create("picture", settings.frame_bytes, _SLOTS)) as ring,
            closing(IidcCamera(settings, ring, _RATE_HZ, software=True)) as opened,
        ):
            seen.what = opened.description.partition(",")[0]
            seen.picture = _take(opened, ring, settings, file)
    except SvevError as error:
        seen.why = str(error)
    return seen


def _take(camera: Camera, ring: CameraRing, settings: CameraSettings, file: Path) -> str:
    """Take one picture.

    Returns:
        Its file.

    Raises:
        CameraError: none comes, or the camera fails.
    """
    camera.start()
    deadline = host_now() + _PICTURE_NS
    while host_now() < deadline:
        if isinstance(camera, Commanded):
            camera.fire()
        arrival = camera.receive(_TURN_S)
        if isinstance(arrival, FrameRecord):
            rows, columns = settings.region.height, settings.region.width
            pixels = ring.frame(arrival.slot).reshape(rows, columns).copy()
            ring.return_slot(arrival.slot)
            # OpenCV itself dies of a name that is no UTF-8
            file.write_bytes(cv2.imencode(file.suffix, _stretched(pixels))[1].tobytes())
            return str(file)
    raise CameraError("the camera answers, but sends no picture; check cable, MTU and firewall")


def _stretched(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The picture with its greys from black to white, so that dark ones show what they are of; (rows, columns)."""
    low, high = np.percentile(picture, (1, 99))
    stretched = np.clip((picture - low) * (255 / max(high - low, 1)), 0, 255)
    return np.asarray(stretched, np.uint8)


if __name__ == "__main__":
    main()
