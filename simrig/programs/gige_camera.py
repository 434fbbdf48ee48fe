"""The process of one simulated GigE Vision camera: `python -m simrig.programs.gige_camera`, started by its owner."""

import sys

from simrig.gige.camera import Camera
from simrig.gige.imaging.sensor import watch_for_freezes
from simrig.programs.messages import Answer, AskStatistics, CameraCommand, Done, GigeCamera, Inject, Statistics
from simrig.programs.simulator import run


class CameraProgram(Camera):
    """See `simrig.programs.simulator.Program`."""

    def obey(self, command: Inject | AskStatistics) -> Answer:
        """Carry out a command."""
        if isinstance(command, Inject):
            self.inject(command.fault)
            return Done()
        return Statistics(statistics=self.statistics())


def main() -> None:
    """Be one camera until told to stop."""
    watch_for_freezes()
    sys.exit(run(GigeCamera, CameraCommand, lambda first: CameraProgram(first.config)))


if __name__ == "__main__":
    main()
