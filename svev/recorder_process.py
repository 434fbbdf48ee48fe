"""Child process: the recorder. Attaches the rings and runs the loop."""

from pathlib import Path
from typing import Final

from recorder.main_loop import RecorderLoop, RecorderOptions
from rig.control import Message
from rig.errors import SvevError
from rig.preview import PreviewSlot
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
        loop = RecorderLoop(rig, rings, child.config["doorbell"], child.control, _options(child.config, rig))
    except SvevError as error:
        child.control.send({"report": "failed", "kind": type(error).__name__, "message": str(error)})
        raise SystemExit(error.exit_code) from None
    loop.run(child.terminated)


def _options(config: Message, rig: RigSettings) -> RecorderOptions:
    preview = config.get("preview")
    return RecorderOptions(
        Path(config.get("directory", rig.recorder.directory)),
        config.get("preroll_s", 0.0),
        None if preview is None else PreviewSlot(preview),
    )


if __name__ == "__main__":
    main()
