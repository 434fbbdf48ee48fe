"""Child process: one camera. Composes back end, ring and grabber."""

import os

from capture.grabber import Grabber
from capture.seam import Camera, OpenCamera
from rig.clocks import HostNs
from rig.errors import BadInputError
from rig.ring import CameraRing
from rig.settings import RigSettings
from svev.child import begin


def _opener(rig: RigSettings, index: int, ring: CameraRing, epoch: HostNs) -> OpenCamera:
    """The back end of one camera. SDKs are imported only where they are used."""
    settings = rig.cameras[index]

    def open_aravis() -> Camera:
        from capture.aravis_camera import AravisCamera  # noqa: PLC0415

        return AravisCamera(settings, rig.network, ring, rig.trigger.period_ns)

    def open_sim() -> Camera:
        from capture.sim_camera import SimCamera  # noqa: PLC0415
        from svev.sim_scene import SimScene  # noqa: PLC0415

        return SimCamera(settings, ring, SimScene(rig, index, epoch))

    match settings.backend:
        case "aravis":
            return open_aravis
        case "sim":
            return open_sim
        case other:
            raise BadInputError(f'backend "{other}" of camera {settings.name} is not built yet: use "aravis" or "sim"')


def main() -> None:
    """Grab until told to stop."""
    child = begin()
    rig = RigSettings.model_validate(child.config["rig"])
    ring = CameraRing(child.config["ring"])
    ring.prefault()
    opener = _opener(rig, child.config["camera"], ring, HostNs(child.config["epoch"]))
    Grabber(opener, ring, child.config["doorbell"], child.stopping, child.control.fileno()).run()
    os.close(child.config["doorbell"])


if __name__ == "__main__":
    main()
