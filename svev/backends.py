"""The camera back ends by their names in the rig file. SDKs are imported only where they are used."""

from collections.abc import Callable
from typing import Final

from capture.iidc.bandwidth import check_bandwidth
from capture.iidc.library import load as load_libdc1394
from capture.seam import Camera, OpenCamera
from rig.clocks import HostNs
from rig.errors import BadInputError
from rig.ring import CameraRing
from rig.settings import Backend, RigSettings

_Open = Callable[[RigSettings, int, CameraRing, HostNs], Camera]


def _aravis(rig: RigSettings, index: int, ring: CameraRing, _epoch: HostNs) -> Camera:
    from capture.aravis_camera import AravisCamera  # noqa: PLC0415

    return AravisCamera(rig.cameras[index], rig.network, ring, rig.trigger.period_ns)


def _sim(rig: RigSettings, index: int, ring: CameraRing, epoch: HostNs) -> Camera:
    from capture.sim_camera import SimCamera  # noqa: PLC0415
    from svev.sim_scene import SimScene  # noqa: PLC0415

    return SimCamera(rig.cameras[index], ring, SimScene(rig, index, epoch))


def _iidc(rig: RigSettings, index: int, ring: CameraRing, _epoch: HostNs) -> Camera:
    from capture.iidc.iidc_camera import IidcCamera  # noqa: PLC0415

    return IidcCamera(rig.cameras[index], ring, rig.trigger.rate_hz)


_BACKENDS: Final[dict[Backend, _Open]] = {"aravis": _aravis, "iidc": _iidc, "sim": _sim}


def check_backends(rig: RigSettings) -> None:
    """Whether all cameras of a rig can be driven.

    Raises:
        BadInputError: a back end is not built yet, libdc1394 is missing, or a FireWire bus has no room for its cameras.
    """
    for camera in rig.cameras:
        if camera.backend not in _BACKENDS:
            known = " or ".join(f'"{name}"' for name in _BACKENDS)
            raise BadInputError(
                f'camera {camera.name}: backend "{camera.backend}" is not built yet: use {known} in the rig file'
            )
    if any(camera.backend == "iidc" for camera in rig.cameras):
        load_libdc1394()
        check_bandwidth(rig)


def camera_opener(rig: RigSettings, index: int, ring: CameraRing, epoch: HostNs) -> OpenCamera:
    """Connects one camera of the rig, again and again if need be.

    Args:
        rig: the rig.
        index: which camera.
        ring: where its frames go.
        epoch: host time of the simulated hill's pulse 0.
    """
    check_backends(rig)
    return lambda: _BACKENDS[rig.cameras[index].backend](rig, index, ring, epoch)
