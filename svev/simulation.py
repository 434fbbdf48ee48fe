"""Starts the simulated hill's cameras where the rig file asks for them."""

import ipaddress
from contextlib import AbstractContextManager, nullcontext

from rig.clocks import HostNs
from rig.errors import BadInputError
from rig.settings import CameraSettings, RigSettings
from simrig.simulated_hill import SimulatedHill
from simrig.world.scenario import load_scenario


def simulated_hill(
    rig: RigSettings, epoch: HostNs, *, prerendered: int = 0, link_mbit_s: float = 1000.0
) -> AbstractContextManager[SimulatedHill | None]:
    """The simulated GigE Vision cameras of a rig with a `[simulation]` table; nothing for any other rig.

    Args:
        rig: the rig.
        epoch: host time of hill pulse 0.
        prerendered: for load tests: draw so many images once and only stamp them anew.
        link_mbit_s: pace of each camera's packets; 0: as fast as possible.

    Raises:
        BadInputError: the scenario is broken or lacks a camera; an address is not on loopback, or in use.
    """
    if rig.simulation is None:
        return nullcontext()
    scenario = load_scenario(rig.simulation.scenario)
    for camera in rig.cameras:
        scenario.camera_index(camera.name)
    cameras = [camera for camera in rig.cameras if camera.backend == "aravis"]
    if not cameras:
        return nullcontext()
    for camera in cameras:
        _check_loopback(camera)
    region = cameras[0].region
    return SimulatedHill(
        rig.simulation.scenario,
        {camera.name: camera.address for camera in cameras},
        rig.trigger.rate_hz,
        epoch=epoch,
        size=(region.width, region.height),
        prerendered=prerendered,
        link_mbit_s=link_mbit_s,
    )


def _check_loopback(camera: CameraSettings) -> None:
    """Simulated cameras may only ever be bound to this machine."""
    try:
        loopback = ipaddress.ip_address(camera.address).is_loopback
    except ValueError:
        loopback = False
    if not loopback:
        raise BadInputError(
            f"simulated camera {camera.name} has address {camera.address}: "
            "give it one on loopback, e.g. 127.0.0.11, or remove the [simulation] table for real cameras"
        )
