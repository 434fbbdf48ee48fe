"""Starts the simulated hill's cameras where the rig file asks for them."""

import ipaddress
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext

from rig.clocks import HostNs
from rig.errors import BadInputError
from rig.settings import CameraSettings, Region, RigSettings
from simrig.simulated_hill import SimulatedHill
from simrig.world.scenario import load_scenario


def simulated_hill(
    rig: RigSettings, epoch: HostNs, *, prerendered: int = 0, link_mbit_s: float = 1000.0
) -> AbstractContextManager[SimulatedHill | None]:
    """The simulated cameras of a rig with a `[simulation]` table, GigE Vision and FireWire; nothing for any other rig.

    Args:
        rig: the rig.
        epoch: host time of hill pulse 0.
        prerendered: for load tests: GigE Vision cameras draw so many images once and only stamp them anew.
        link_mbit_s: pace of each GigE Vision camera's packets; 0: as fast as possible.

    Raises:
        BadInputError: the scenario is broken or lacks a camera; an address is not on loopback, or in use, or no GUID.
    """
    if rig.simulation is None:
        return nullcontext()
    scenario = load_scenario(rig.simulation.scenario)
    for camera in rig.cameras:
        scenario.camera_index(camera.name)
    gige = [camera for camera in rig.cameras if camera.backend == "aravis"]
    firewire = [camera for camera in rig.cameras if camera.backend == "iidc"]
    if not gige and not firewire:
        return nullcontext()
    for camera in gige:
        _check_loopback(camera)
    region = gige[0].region if gige else Region()
    return SimulatedHill(
        rig.simulation.scenario,
        {camera.name: camera.address for camera in gige},
        rig.trigger.rate_hz,
        firewire={camera.name: camera.address for camera in firewire},
        epoch=epoch,
        size=(region.width, region.height),
        prerendered=prerendered,
        link_mbit_s=link_mbit_s,
    )


def environment(hill: SimulatedHill | None) -> Mapping[str, str]:
    """What grabber processes need in their environment to see the hill's FireWire cameras.

    Raises:
        BadInputError: there are some, but no C compiler for what makes them visible.
    """
    return {} if hill is None else hill.environment


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
