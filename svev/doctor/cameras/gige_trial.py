"""Child process of the doctor that opens GigE Vision cameras as a recording does, and sets them back."""

from collections.abc import Iterator
from contextlib import closing
from typing import Final

from capture.aravis.wire import Wire
from rig.clocks import host_now
from rig.errors import BadInputError, CameraError, CameraNotFoundError
from rig.settings.camera import CameraSettings
from rig.settings.model import RigSettings
from rig.transport.child import begin
from rig.transport.message import Quit
from rig.transport.ring import CameraRing
from svev.doctor.cameras.child import Found, Trial
from svev.doctor.finding import Finding, Topic, failure, passed, warning

_SLOTS: Final = 2


def try_camera(rig: RigSettings, settings: CameraSettings) -> Iterator[Finding]:
    """Would a recording open this camera, and what limits it? Afterwards it is as it was before."""
    name, trigger = settings.name, rig.trigger
    wire = Wire.to(settings.address, [each.address for each in rig.cameras if each.backend == "aravis"])
    with closing(CameraRing.create(name, settings.frame_bytes, _SLOTS)) as ring:
        try:
            from capture.aravis.camera import AravisCamera  # noqa: PLC0415 - it may be that Aravis is missing

            opened = AravisCamera(
                settings, rig.network, ring, trigger.period_ns, trigger, host_now(), wire, set_back=True
            )
        except (CameraError, BadInputError) as error:
            what, _, remedy = str(error).removeprefix("camera ").partition(": ")
            if isinstance(error, CameraNotFoundError):  # and yet it has just said who it is
                what = f"{name} answers, but its description of itself cannot be read"
                remedy = "update its firmware, or use another camera"
            remedy = remedy or "look at svev cameras show {address}"
            yield failure(
                Topic.CAMERAS, "check_would_be_refused", "would be refused: {what}", "{remedy}",
                what=what, remedy=remedy, address=settings.address,
            )  # fmt: skip
            return
        with closing(opened) as camera:
            what = "{camera} takes the settings of the rig file: {description}"
            yield passed(Topic.CAMERAS, "check_would_be_taken", what, camera=name, description=camera.description)
            for notice in camera.notices():
                remedy = "see svev cameras show {address}, and the camera's manual"
                said = notice.removeprefix("camera ")
                yield warning(
                    Topic.CAMERAS, "check_would_be_limited", "{what}", remedy, what=said, address=settings.address
                )
            if (steps := camera.gain_steps) is not None:
                what = "{camera} has its gain in steps: gain_raw goes from {least} to {most}"
                yield passed(Topic.CAMERAS, "check_gain_steps", what, camera=name, least=steps[0], most=steps[1])


def main() -> None:
    """Try the cameras, one after the other."""
    child = begin(Trial, Quit, grace_s=0.0)
    rig = child.config.rig
    for settings in rig.cameras:
        if settings.name in child.config.names:
            for finding in try_camera(rig, settings):
                child.control.send(Found(finding=finding))


if __name__ == "__main__":
    main()
