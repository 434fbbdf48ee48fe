"""The program of the analysis process: measures the jumper from the triplets that the recorder publishes.

It is nice to the others: recorder and grabbers come first, and what it misses can be analyzed from the log.
"""

import os
import re
import time
from pathlib import Path
from typing import Final

from analysis.cameras.oriented_scene import OrientedScene
from analysis.worker.findings import Findings, MeasuredJump
from analysis.worker.live import LiveAnalysis
from analysis.worker.stream import Source, Stream, connected
from recorder.publishing.keys import load_keys
from rig.clocks import UtcNs
from rig.errors import StorageError, SvevError
from rig.events import Event, Level
from rig.jumper import JumperState
from rig.phrase import Phrase
from rig.pulse import PulseNumber
from rig.settings.model import AnalysisSettings, NetworkSettings, RigSettings
from rig.settings.region import calibration_unfit
from rig.topics import JUMPER, JUMPER_CAMERAS, JUMPER_SCENE
from rig.transport.analysis_messages import AnalysisConfig, AnalysisReport, AnalysisTold, JumpMeasured, Measuring
from rig.transport.channel import ControlChannel
from rig.transport.child import ChildContext, begin
from rig.transport.message import Quit
from rig.transport.recorder_commands import TellResult
from service.aiming.kept import keep
from service.processes import live_jumps

#: It holds nothing that could be lost.
_GRACE_S: Final = 2.0
_NICE: Final = 10
_WAKE_S: Final = 0.2


class _Reports(Findings):
    """Sends what the analysis finds to the service."""

    def __init__(self, control: ControlChannel[AnalysisReport], rig: RigSettings, folder: Path) -> None:
        self._control, self._rig, self._folder = control, rig, folder
        self._folders = [folder, *filter(None, (rig.recorder.fallback_directory,))]

    def state(self, state: JumperState) -> None:
        """A measured pulse."""
        self._control.send(
            TellResult(
                recording=state.recording, topic=JUMPER.name, pulse=state.pulse, time=state.time, data=state.encode()
            )
        )

    def scene(self, recording: str, pulse: PulseNumber, time: UtcNs, scene: bytes) -> None:
        """The scene in 3D at a pulse."""
        self._control.send(TellResult(recording=recording, topic=JUMPER_SCENE.name, pulse=pulse, time=time, data=scene))

    def cameras(self, recording: str, pulse: PulseNumber, time: UtcNs, frames: bytes) -> None:
        """Where the cameras stand from a pulse on."""
        name = JUMPER_CAMERAS.name
        self._control.send(TellResult(recording=recording, topic=name, pulse=pulse, time=time, data=frames))

    def oriented(self, recording: str, time: UtcNs, scene: OrientedScene) -> None:
        """The cameras were oriented: whoever aims them sees from now on where they showed the balls."""
        if not scene.given:  # by poses, which say that better
            return
        try:
            keep(scene, recording, time, self._rig, self._folder)
        except StorageError as error:
            self.message(Level.WARNING, error.said)

    def jump(self, jump: MeasuredJump) -> None:
        """A whole jump: also kept beside its log, which may be closed already."""
        try:
            live_jumps.keep(jump, self._folders)
        except StorageError as error:
            self.message(Level.ERROR, error.said)
        self._control.send(JumpMeasured(jump=jump.summary))

    def message(self, level: Level, said: Phrase) -> None:
        """Something that people should know."""
        self._control.send(AnalysisTold(event=Event.now(level, "analysis", said)))


def main() -> None:
    """Measure until told to quit."""
    child = begin(AnalysisConfig, Quit, _GRACE_S)
    os.nice(_NICE)
    rig = child.config.rig
    if rig.analysis is None:
        raise SystemExit("analysis: the rig file has no [analysis] table")
    reports = _Reports(child.control, rig, child.config.directory)
    for camera in rig.cameras:
        if (unfit := calibration_unfit(camera)) is not None:
            reports.message(Level.WARNING, unfit)
    if (analysis := _opened(child, rig, rig.analysis, reports)) is not None:
        with analysis, connected(_source(rig.network)) as stream:
            _measure(child, stream, analysis)


def _opened(
    child: ChildContext[AnalysisConfig], rig: RigSettings, settings: AnalysisSettings, reports: _Reports
) -> LiveAnalysis | None:
    """The analysis with survey or poses; while their file is wrong, says so and looks at it again and again.

    Returns:
        None if the process was told to quit meanwhile.
    """
    exposures = {camera.name: camera.exposure_us / 1e6 for camera in rig.cameras}
    said = None
    while not child.stopping():
        try:
            analysis = LiveAnalysis(settings.survey, settings.calibration, reports, exposures)
        except SvevError as error:
            if str(error) != said:
                said = str(error)
                child.control.send(Measuring(refused=error.said))
            time.sleep(_WAKE_S)
        else:
            child.control.send(Measuring())
            return analysis
    return None


def _source(network: NetworkSettings) -> Source:
    """Where the recorder of this computer publishes."""
    address = network.publish_ipc or re.sub(r"^tcp://(\*|0\.0\.0\.0):", "tcp://127.0.0.1:", network.publish)
    keys = None if network.curve_key_file is None else load_keys(network.curve_key_file)
    return Source(address, public_key=None if keys is None else keys.public)


def _measure(child: ChildContext[AnalysisConfig], stream: Stream, analysis: LiveAnalysis) -> None:
    quiet_s = 0.0
    while not child.stopping():
        received = stream.next(_WAKE_S)
        quiet_s = quiet_s + _WAKE_S if received is None else 0.0
        analysis.idle(quiet_s) if received is None else analysis.take(received)


if __name__ == "__main__":
    main()
