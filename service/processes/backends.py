"""Finds the back end that a rig file names for a camera; imports what drives a camera only if a camera needs it."""

from collections.abc import Callable, Sequence
from functools import cache
from typing import Final

from capture.seam import OpenCamera
from rig.clocks import HostNs
from rig.errors import BadInputError, CameraNotFoundError
from rig.settings.camera import Backend
from rig.settings.model import RigSettings
from rig.settings.trigger import IidcBroadcastTrigger, SoftwareTrigger
from rig.transport.launcher import launcher
from rig.transport.ring import CameraRing

_Opener = Callable[[RigSettings, int, CameraRing, HostNs], OpenCamera]


def _aravis(rig: RigSettings, index: int, ring: CameraRing, epoch: HostNs) -> OpenCamera:
    from capture.aravis.camera import AravisCamera  # noqa: PLC0415
    from capture.aravis.wire import Wire  # noqa: PLC0415

    camera, trigger = rig.cameras[index], rig.trigger
    addresses = [each.address for each in rig.cameras if each.backend == "aravis"]
    return lambda: AravisCamera(
        camera, rig.network, ring, trigger.period_ns, trigger, epoch, Wire.to(camera.address, addresses)
    )


def _iidc(rig: RigSettings, index: int, ring: CameraRing, _epoch: HostNs) -> OpenCamera:
    from capture.iidc.camera import IidcCamera  # noqa: PLC0415

    software = isinstance(rig.trigger, SoftwareTrigger | IidcBroadcastTrigger)
    return lambda: IidcCamera(rig.cameras[index], ring, rig.trigger.rate_hz, software=software)


def _sim(rig: RigSettings, index: int, ring: CameraRing, epoch: HostNs) -> OpenCamera:
    from capture.sim.camera import SimCamera  # noqa: PLC0415
    from service.processes.simulation import sim_scene  # noqa: PLC0415

    scene = sim_scene(rig, index, epoch)  # made once, since a real hill does not begin anew with each connection
    return lambda: SimCamera(rig.cameras[index], ring, scene)


def _replay(rig: RigSettings, index: int, ring: CameraRing, epoch: HostNs) -> OpenCamera:
    from capture.replay.camera import ReplayCamera  # noqa: PLC0415
    from capture.replay.timeline import Timeline  # noqa: PLC0415
    from service.processes.replayed_log import ReplayedLog  # noqa: PLC0415

    camera = rig.cameras[index]

    @cache
    def timeline() -> Timeline:
        """The log's tags, read at the first connection and kept for later ones."""
        try:
            return Timeline(ReplayedLog(rig, index), epoch)
        except BadInputError as error:
            raise CameraNotFoundError(f"camera {camera.name}: {error}") from None

    return lambda: ReplayCamera(camera, ring, timeline())


_PROGRAMS: Final = "service.processes.programs."
_DRIVERS: Final[dict[Backend, str]] = {
    "aravis": "capture.aravis.camera", "iidc": "capture.iidc.camera", "sim": "capture.sim.camera",
    "replay": "capture.replay.camera",
}  # fmt: skip
#: What draws the simulated hill for a back end.
_SIMULATORS: Final[dict[Backend, str]] = {
    "aravis": "simrig.programs.gige_camera", "iidc": "simrig.programs.firewire_bus", "sim": "simrig.programs.scene",
}  # fmt: skip
_BACKENDS: Final[dict[Backend, _Opener]] = {"aravis": _aravis, "iidc": _iidc, "sim": _sim, "replay": _replay}


def check_backends(rig: RigSettings) -> None:
    """Check that all cameras of a rig can be driven on this computer.

    Raises:
        BadInputError: Aravis or libdc1394 is missing, a FireWire bus has no room for its cameras, or a log that is to
            be replayed is missing or does not fit the rig file.
    """
    backends = {camera.backend for camera in rig.cameras}
    if "aravis" in backends:
        import capture.aravis.library  # noqa: F401, PLC0415 - it says what is missing
    if "iidc" in backends:
        from capture.iidc.bandwidth import check_bandwidth  # noqa: PLC0415
        from capture.iidc.library import load as load_libdc1394  # noqa: PLC0415

        load_libdc1394()
        check_bandwidth(rig)
    if "replay" in backends:
        from service.processes.replayed_log import check_replay  # noqa: PLC0415

        check_replay(rig)


def prepare_programs(rig: RigSettings) -> None:
    """Have the programs of a rig's processes imported in good time, so that arming does not wait for it."""
    backends = {camera.backend for camera in rig.cameras}
    launcher().prepare(*programs_of(sorted(backends), simulated=rig.simulation is not None))


def programs_of(backends: Sequence[Backend], *, simulated: bool) -> list[str]:
    """The modules that processes of such a rig run, in the order in which they are started."""
    simulators = [_SIMULATORS[backend] for backend in backends if backend in _SIMULATORS] if simulated else []
    return [*simulators, _PROGRAMS + "recorder", _PROGRAMS + "grabber", *(_DRIVERS[each] for each in backends)]


def camera_opener(rig: RigSettings, index: int, ring: CameraRing, epoch: HostNs) -> OpenCamera:
    """A function that connects one camera of the rig; the grabber calls it again after each loss of the camera.

    Args:
        rig: the rig.
        index: index of the camera.
        ring: ring for its frames.
        epoch: host time of the first pulse of the simulated hill or of the replayed log; the same for all cameras.
    """
    check_backends(rig)
    return _BACKENDS[rig.cameras[index].backend](rig, index, ring, epoch)
