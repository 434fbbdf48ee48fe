"""Runs the processes of one rig: rings, one grabber process per camera, one recorder process, one for the analysis.

Where svev makes the pulses, one more process sends the action commands, drives the trigger box,
or makes the pulses of a line.

The owner calls `turn` again and again; it passes on the recorder's reports, keeps track of the cameras, and starts dead
grabbers again. The owner decides what happens when the recorder dies.
"""

import os
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import replace
from types import TracebackType
from typing import Final, Self

from rig.clocks import HostNs, host_now
from rig.doctor_call import doctor_call
from rig.errors import ProcessDiedError
from rig.events import Event, Level
from rig.phrase import Phrase, phrase
from rig.settings.model import RigSettings
from rig.settings.trigger import ActionTrigger
from rig.transport.analysis_messages import AnalysisTold, JumpMeasured, Measuring
from rig.transport.message import Quit
from rig.transport.process_table import Child, ProcessTable
from rig.transport.recorder_commands import (
    GrabberDied,
    PulsesFired,
    RecorderCommand,
    RecorderOptions,
    TellActions,
    TellPulses,
    TellResult,
)
from rig.transport.recorder_reports import (
    CameraChanged,
    RecorderEvent,
    RecorderHealth,
    RecorderReport,
)
from rig.transport.ring import CameraRing
from rig.transport.trigger_messages import (
    CamerasSeen,
    LetPulses,
    TriggerTold,
)
from service.processes.backends import check_backends
from service.processes.memory import ring_slots
from service.processes.restarts import Restarts
from service.processes.rig_programs import ANALYSIS, RECORDER, TRIGGER, RigPrograms
from service.processes.seen import Processes, Seen

#: What the processes of a rig tell the service.
RigReport = RecorderReport | JumpMeasured | Measuring
#: Reports that are dealt with here.
_FORWARDED: Final = TellResult | AnalysisTold | TellActions | TellPulses | PulsesFired | TriggerTold


class RigProcesses:
    """All processes of one rig; a context manager that stops them whatever happens.

    Args:
        rig: the rig.
        on_event: called for each camera that comes or goes and each process that is started again.
        epoch: host time of pulse 0 of the simulated hill, the replayed log or the commands; now if left out.
        recorder: what the recorder does beside recording.
        environment: what simulated devices are found by: variables for who uses FireWire cameras, `TRIGGER_PORT`.

    Raises:
        BadInputError: libdc1394 is missing, or a log that is to be replayed does not fit.
    """

    def __init__(
        self,
        rig: RigSettings,
        on_event: Callable[[Event], None],
        *,
        epoch: HostNs | None = None,
        recorder: RecorderOptions | None = None,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        check_backends(rig)
        options = recorder or RecorderOptions(directory=rig.recorder.directory)
        self._programs = RigPrograms(rig, host_now() if epoch is None else epoch, options, dict(environment or {}))
        self._on_event = on_event
        self._processes = ProcessTable()
        self._exit = ExitStack()
        self._restarts = Restarts(self._programs.helpers)
        self._seen = Seen.begun(len(rig.cameras))

    def __enter__(self) -> Self:
        rig = self._programs.rig
        with ExitStack() as stack:
            doorbell = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
            stack.callback(os.close, doorbell)
            rings = []
            for camera in rig.cameras:
                ring = CameraRing.create(camera.name, camera.frame_bytes, ring_slots(rig))
                stack.callback(ring.close)
                rings.append(ring.fd)
            self._programs = replace(self._programs, rings=tuple(rings), doorbell=doorbell)
            stack.callback(self._processes.stop)
            for name in (RECORDER, *self._programs.helpers):
                self._start(name)
            self._exit = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._exit.close()

    @property
    def pids(self) -> dict[str, int]:
        """Process ids by row of the process table."""
        return {name: self._processes[name].pid for name in (*self._programs.helpers, RECORDER)}

    @property
    def seen(self) -> Seen:
        """All that is known of the processes now."""
        started = self._processes[RECORDER].started
        return replace(self._seen, started=started, pids=self.pids, restarts=self._restarts.deaths)

    @property
    def _recorder_died(self) -> bool:
        return self._seen.processes is Processes.NO_RECORDER

    def tell(self, command: RecorderCommand) -> None:
        """Send a command to the recorder, without waiting for it to read."""
        control = self._processes[RECORDER].control
        dropped = control.dropped
        control.send(command)
        if dropped == 0 < control.dropped:  # said once: a recorder that does not read for long is ended
            text = "does not read its commands, and some are dropped; it is started again if it stays so"
            self._on_event(Event.now(Level.ERROR, RECORDER, phrase("event_commands_dropped", text)))

    def kill_recorder(self) -> None:
        """Kill a recorder that does not answer; the next `turn` raises ProcessDiedError."""
        self._processes[RECORDER].kill()

    def change_camera(self, rig: RigSettings, name: str) -> None:
        """Let a camera's grabber begin anew with its settings in `rig`, and the analysis, which reads them too.

        Args:
            rig: the rig; only this camera's exposure and gain are others than before.
            name: of the camera.
        """
        self._programs = replace(self._programs, rig=rig)
        for helper in (name, *([] if rig.analysis is None else [ANALYSIS])):
            self._restarts.renew(helper)
            self._processes[helper].control.send(Quit())

    def let_pulses(self, pulses: int | None) -> None:
        """Have the process that makes the pulses make so many from now on; None: without end."""
        self._seen = replace(self._seen, still=pulses is not None)
        self._processes[TRIGGER].control.send(LetPulses(pulses=pulses))

    def turn(self, timeout_s: float, wake: tuple[int, ...] = ()) -> list[RigReport]:
        """Wait for reports of the recorder, note what they say of the cameras, and start dead grabbers again.

        Results of the analysis, answers to action commands, and what pulses were made, go on to the recorder.

        Args:
            timeout_s: longest wait for the first report, s.
            wake: descriptors that end the wait when they become readable.

        Returns:
            The reports, the jumps that were measured, and whether jumps can be measured.

        Raises:
            ProcessDiedError: the recorder died; raised once, after all its reports have been returned.
        """
        reports = [message for _, message in self._processes.receive(timeout_s, wake)]
        for report in reports:
            self._seen = self._seen.heard(report)
            match report:
                case TellResult() | TellActions() | TellPulses() | PulsesFired():
                    if not self._recorder_died:
                        self.tell(report)
                case AnalysisTold() | TriggerTold() | RecorderEvent():
                    self._on_event(report.event)
                case CameraChanged():
                    self._on_event(report.event(self._programs.cameras[report.camera]))
                case RecorderHealth() if isinstance(self._programs.rig.trigger, ActionTrigger):
                    self._processes[TRIGGER].control.send(CamerasSeen.of(report.health))
        self._tend()
        return [report for report in reports if not isinstance(report, _FORWARDED)]

    def restart_recorder(self) -> None:
        """Start a recorder in place of the dead one; it takes over cameras that are still streaming at once."""
        self._seen = replace(self._seen, processes=Processes.ALL)
        self._start(RECORDER)

    def _tend(self) -> None:
        """Start dead grabbers again, after a wait that grows; raise if the recorder died."""
        for child in self._processes.dead():
            if child.spec.name != RECORDER:
                self._tend_helper(child)
            elif child.control.ended and not self._recorder_died:
                self._seen = self._seen.without_recorder()
                text = "the recorder process ended ({how}): if it recurs, run {doctor}"
                how = child.ending() or ""
                raise ProcessDiedError(phrase("why_recorder_ended", text, how=how, doctor=doctor_call()))

    def _tend_helper(self, child: Child) -> None:
        name, restart = child.spec.name, self._restarts.ended(child)
        if restart.renewed:
            self._camera_gone(name, phrase("why_other_settings", "it gets other settings, and is back at once"))
        elif restart.wait_s is not None:
            how = child.ending() or ""
            if name in self._programs.cameras:
                reason = phrase("why_grabber_ended", "grabber process ended ({how})", how=how)
            else:
                reason = phrase("why_process_ended", "process ended ({how})", how=how)
            text = "{why}; starting it again in {seconds:g} s"
            said = phrase("event_process_again", text, why=reason, seconds=restart.wait_s)
            self._on_event(Event.now(Level.ERROR, name, said))
            self._camera_gone(name, reason)
        if restart.start:
            self._start(name)

    def _camera_gone(self, name: str, reason: Phrase) -> None:
        """The recorder learns of a grabber that ended; of another process it need not."""
        if name in self._programs.cameras:
            self.tell(GrabberDied(camera=self._programs.cameras.index(name), reason=reason))

    def _start(self, name: str) -> None:
        self._processes.start(self._programs.program(name, still=self._seen.still))
