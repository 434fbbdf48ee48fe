"""Which programs the processes of a rig run, and with which configuration. Nothing is started here."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from rig.clocks import HostNs
from rig.settings.model import RigSettings
from rig.settings.trigger import ActionTrigger, GpioTrigger, IidcBroadcastTrigger, TriggerBoxTrigger
from rig.transport.analysis_messages import AnalysisConfig, AnalysisReport
from rig.transport.grabber_messages import GrabberConfig
from rig.transport.process_table import ProcessSpec
from rig.transport.recorder_commands import RecorderConfig, RecorderOptions
from rig.transport.recorder_reports import RecorderReport
from rig.transport.trigger_messages import TriggerBoxConfig, TriggerConfig, TriggerReport
from service.processes.simulation import TRIGGER_PORT

RECORDER: Final = "recorder"
ANALYSIS: Final = "analysis"
TRIGGER: Final = "trigger"
#: Sources whose pulses a process of its own makes.
_MADE_BY_A_PROCESS: Final = ActionTrigger | IidcBroadcastTrigger | TriggerBoxTrigger | GpioTrigger
_PROGRAMS: Final = "service.processes.programs"


@dataclass(frozen=True, slots=True)
class RigPrograms:
    """The programs of one rig.

    Attributes:
        rig: the rig.
        epoch: host time of pulse 0 of the simulated hill, the replayed log or the commands.
        options: what the recorder does beside recording.
        environment: what simulated devices are found by: variables for who uses FireWire cameras, `TRIGGER_PORT`.
        rings: descriptors of the cameras' rings.
        doorbell: descriptor by which grabbers wake the recorder.
    """

    rig: RigSettings
    epoch: HostNs
    options: RecorderOptions
    environment: Mapping[str, str]
    rings: tuple[int, ...] = ()
    doorbell: int = -1

    @property
    def cameras(self) -> list[str]:
        """Names of the grabbers, in the order of the rig."""
        return [camera.name for camera in self.rig.cameras]

    @property
    def helpers(self) -> list[str]:
        """Names of all processes but the recorder."""
        making = [TRIGGER] if isinstance(self.rig.trigger, _MADE_BY_A_PROCESS) else []
        return [*self.cameras, *making, *([] if self.rig.analysis is None else [ANALYSIS])]

    def program(self, name: str, *, still: bool) -> ProcessSpec:
        """What a process runs.

        Args:
            name: RECORDER, or one of the helpers.
            still: whether the process that makes the pulses makes none until it is told to.
        """
        if name == RECORDER:
            return self._recorder()
        if name == ANALYSIS:
            config = AnalysisConfig(rig=self.rig, directory=self.options.directory)
            return ProcessSpec(ANALYSIS, f"{_PROGRAMS}.analysis", config, reports=AnalysisReport)
        return self._trigger(still=still) if name == TRIGGER else self._grabber(name)

    def _recorder(self) -> ProcessSpec:
        config = RecorderConfig(
            rig=self.rig, rings=self.rings, doorbell=self.doorbell, options=self.options, epoch=self.epoch
        )
        preview = () if self.options.preview is None else (self.options.preview,)
        inherit = (*self.rings, self.doorbell, *preview)
        return ProcessSpec(RECORDER, f"{_PROGRAMS}.recorder", config, inherit=inherit, reports=RecorderReport)

    def _trigger(self, *, still: bool) -> ProcessSpec:
        trigger = self.rig.trigger
        if isinstance(trigger, TriggerBoxTrigger):
            port = self.environment.get(TRIGGER_PORT, trigger.port)
            box = TriggerBoxConfig(rig=self.rig, port=port, still=still)
            return ProcessSpec(TRIGGER, f"{_PROGRAMS}.triggerbox", box, reports=TriggerReport)
        at_times = isinstance(trigger, GpioTrigger | IidcBroadcastTrigger)
        config = TriggerConfig(rig=self.rig, epoch=self.epoch, still=still)
        # As for grabbers: libdc1394 needs them to see the emulated bus.
        more = self.environment if isinstance(trigger, IidcBroadcastTrigger) else {}
        program = f"{_PROGRAMS}.even_pulses" if at_times else f"{_PROGRAMS}.actions"
        return ProcessSpec(TRIGGER, program, config, reports=TriggerReport, environment=more)

    def _grabber(self, name: str) -> ProcessSpec:
        index = self.cameras.index(name)
        ring = self.rings[index]
        config = GrabberConfig(rig=self.rig, camera=index, ring=ring, doorbell=self.doorbell, epoch=self.epoch)
        # Only libdc1394 needs variables, to see the emulated bus.
        more = self.environment if self.rig.cameras[index].backend == "iidc" else {}
        inherit = (ring, self.doorbell)
        return ProcessSpec(name, f"{_PROGRAMS}.grabber", config, inherit=inherit, environment=more)
