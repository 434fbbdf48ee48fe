"""One GigE Vision camera's process: `python -m simrig.gige`.

Spoken to as `simrig.camera_program` says, configured by `simrig.gige.config`, with these commands:

    {"command": "inject", "fault": {...}}   -> {}
    {"command": "statistics"}               -> {"statistics": {...}}
    {"command": "stop"}                     -> {}, and the process ends
"""

import sys
from dataclasses import asdict

from rig.errors import BadInputError
from rig.rigfile import validate
from simrig.camera_program import Message, run
from simrig.faults import Fault
from simrig.gige.camera import Camera
from simrig.gige.config import CameraConfig


class _CameraProgram(Camera):
    """A camera that obeys."""

    def obey(self, command: Message) -> Message:
        """See `simrig.camera_program.Program`."""
        match command:
            case {"command": "inject", "fault": dict() as fault}:
                self.inject(validate(Fault, fault, "fault"))
                return {}
            case {"command": "statistics"}:
                return {"statistics": asdict(self.statistics())}
            case _:
                raise BadInputError(f"command {command}: give inject, statistics or stop")


if __name__ == "__main__":
    sys.exit(run(lambda data: _CameraProgram(validate(CameraConfig, data, "camera process"))))
