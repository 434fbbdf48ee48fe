"""Child process: the recorder. Attaches the rings and runs the loop."""

from typing import Final

from recorder.main_loop import RecorderLoop
from rig.errors import SvevError
from rig.ring import CameraRing
from rig.settings import RigSettings
from svev.child import begin

#: Enough to write what waits for the disk and the index.
_GRACE_S: Final = 20.0


def main() -> None:
    """Record until told to quit."""
    child = begin(_GRACE_S)
    rig = RigSettings.model_validate(child.config["rig"])
    rings = [CameraRing(fd) for fd in child.config["rings"]]
    try:
        loop = RecorderLoop(rig, rings, child.config["doorbell"], child.control)
    except SvevError as error:
        child.control.send({"report": "failed", "kind": type(error).__name__, "message": str(error)})
        raise SystemExit(error.exit_code) from None
    loop.run(child.terminated)


if __name__ == "__main__":
    main()
