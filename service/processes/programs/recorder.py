"""The program of the recorder process: opens the rings and runs the recorder's main loop."""

from typing import Final

from recorder.live.main_loop import RecorderLoop
from rig.errors import SvevError
from rig.transport.child import begin
from rig.transport.recorder_commands import RecorderCommand, RecorderConfig
from rig.transport.recorder_reports import RecorderFailed

#: Time to write the triplets that wait for the disk, and the log's index.
_GRACE_S: Final = 20.0


def main() -> None:
    """Record until told to quit."""
    child = begin(RecorderConfig, RecorderCommand, _GRACE_S)
    try:
        loop = RecorderLoop(child.config, child.control)
    except SvevError as error:
        child.control.send(RecorderFailed.of(error))
        raise SystemExit(error.exit_code) from None
    loop.run()


if __name__ == "__main__":
    main()
