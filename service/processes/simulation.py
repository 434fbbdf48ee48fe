"""Starts the simulated cameras of a rig file with a `[simulation]` table; no other module here imports `simrig`.

A rig of real cameras loads nothing of the simulated hill.
"""

import ipaddress
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Final

from capture.sim.camera import Scene
from rig.clocks import HostNs
from rig.errors import BadInputError
from rig.settings.camera import CameraSettings
from rig.settings.model import RigSettings
from rig.settings.trigger import ActionTrigger, IidcBroadcastTrigger, SoftwareTrigger, TriggerBoxTrigger
from service.recordings.truth import WriteTruth

if TYPE_CHECKING:
    from simrig.programs.simulated_hill import SimulatedHill

#: Variable in which the simulated hill names the port of its trigger box.
TRIGGER_PORT: Final = "SVEV_TRIGGER_PORT"


def simulated_hill(
    rig: RigSettings, epoch: HostNs, *, prerendered: int = 0, link_mbit_s: float = 1000.0
) -> AbstractContextManager["SimulatedHill | None"]:
    """The simulated GigE Vision and FireWire cameras of a rig with a `[simulation]` table; nothing for other rigs.

    Args:
        rig: the rig.
        epoch: host time of hill pulse 0.
        prerendered: for load tests: GigE Vision cameras draw so many images once and then only stamp them anew.
        link_mbit_s: rate at which each GigE Vision camera sends packets; 0: as fast as possible.

    Raises:
        BadInputError: the scenario is wrong or lacks a camera; an address is not on loopback, is in use, or is no GUID.
    """
    if rig.simulation is None:
        return nullcontext()
    from simrig.programs.recording_truth import gige_sensor  # noqa: PLC0415
    from simrig.programs.simulated_hill import SimulatedHill  # noqa: PLC0415
    from simrig.world.cable import cable_end  # noqa: PLC0415
    from simrig.world.scenario import load_scenario  # noqa: PLC0415

    scenario = load_scenario(rig.simulation.scenario)
    for camera in rig.cameras:
        scenario.camera_index(camera.name)
    gige = [camera for camera in rig.cameras if camera.backend == "aravis"]
    firewire = [camera for camera in rig.cameras if camera.backend == "iidc"]
    if not gige and not firewire:
        return nullcontext()
    for camera in gige:
        _check_loopback(camera)
    width, height = gige_sensor(rig)
    return SimulatedHill(
        rig.simulation.scenario,
        {camera.name: camera.address for camera in gige},
        rig.trigger.rate_hz,
        firewire={camera.name: camera.address for camera in firewire},
        cable=not isinstance(
            rig.trigger, SoftwareTrigger | IidcBroadcastTrigger
        ),  # GigE Vision cameras are told what to heed
        epoch=epoch,
        width=width,
        height=height,
        prerendered=prerendered,
        link_mbit_s=link_mbit_s,
        line=cable_end(rig.trigger),
        broadcast=next(iter(rig.trigger.broadcast), None) if isinstance(rig.trigger, ActionTrigger) else None,
    )


@contextmanager
def hill_environment(rig: RigSettings, epoch: HostNs) -> Iterator[Mapping[str, str]]:
    """Run the simulated cameras of a rig, if it has any, and its trigger box, if it has one.

    Yields:
        Environment variables that grabber processes need to see the FireWire cameras among them, and `TRIGGER_PORT`.

    Raises:
        BadInputError: as `simulated_hill`; or there is no C compiler for the shim that shows the FireWire cameras.
    """
    with ExitStack() as stack:
        hill = stack.enter_context(simulated_hill(rig, epoch))
        variables = {} if hill is None else hill.environment
        if rig.simulation is not None and isinstance(rig.trigger, TriggerBoxTrigger):
            from simrig.triggerbox.box import EmulatedBox  # noqa: PLC0415
            from simrig.triggerbox.timer import HillTimer  # noqa: PLC0415
            from simrig.world.pulses import PulseTrain  # noqa: PLC0415

            port = Path(stack.enter_context(TemporaryDirectory(prefix="svev-trigger-"))) / "box"
            stack.enter_context(EmulatedBox(port, HillTimer(PulseTrain(epoch, rig.trigger.rate_hz))))
            variables[TRIGGER_PORT] = str(port)
        yield variables


def sim_scene(rig: RigSettings, index: int, epoch: HostNs) -> Scene:
    """The simulated hill as one camera inside its grabber process sees it (back end "sim")."""
    from simrig.programs.scene import SimScene  # noqa: PLC0415

    return SimScene(rig, index, epoch)


def simulated_truth(rig: RigSettings, epoch: HostNs) -> WriteTruth | None:
    """What writes the truth of recordings of a simulated rig; None if not all of its cameras are simulated.

    Args:
        rig: the rig.
        epoch: host time of hill pulse 0.

    Raises:
        BadInputError: the scenario is wrong.
    """
    if rig.simulation is None or any(camera.backend == "replay" for camera in rig.cameras):
        return None
    from simrig.programs.recording_truth import RecordingTruth  # noqa: PLC0415

    return RecordingTruth(rig, rig.simulation.scenario, epoch).write


def _check_loopback(camera: CameraSettings) -> None:
    """Refuse addresses of simulated cameras that other computers could reach."""
    try:
        loopback = ipaddress.ip_address(camera.address).is_loopback
    except ValueError:
        loopback = False
    if not loopback:
        raise BadInputError(
            f"simulated camera {camera.name} has address {camera.address}: "
            "give it one on loopback, e.g. 127.0.0.11, or remove the [simulation] table for real cameras"
        )
