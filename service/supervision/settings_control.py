"""Takes other settings of the rig while it runs. A region that a camera refuses is given back for the one before."""

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Final

from rig.api.statement import Statement
from rig.api.status import State
from rig.errors import BadInputError, StateForbidsError
from rig.events import Event, Level
from rig.phrase import Phrase, phrase
from rig.settings.light import camera_of
from rig.settings.model import RigSettings
from rig.settings.region import named
from rig.transport.recorder_commands import Calibration
from service.processes.rig_processes import RigProcesses
from service.processes.rig_session import RigSession
from service.status.forbidden import FORBIDDEN
from service.supervision.recording_control import RecordingControl
from service.supervision.state_machine import StateMachine

#: Longest wait for complete triplets with another region, if they came before: a busy computer may be slow to begin.
TRIED_S: Final = 10.0


@dataclass(frozen=True, slots=True)
class RigInUse:
    """The rig in use and the text of its file."""

    rig: RigSettings
    toml: str


@dataclass(frozen=True, slots=True)
class _Trial:
    """A region that is being tried.

    Attributes:
        before: what was in use.
        camera: whose region it is.
        said: the region in words.
        present: indices of the cameras that were connected, and of this one.
        warm: whether complete triplets came.
        answer: is answered when the rig is armed with the region, or begins to go back.
    """

    before: RigInUse
    camera: str
    said: Phrase
    present: tuple[int, ...]
    warm: bool
    answer: "Future[None]"


class SettingsControl:
    """Only the supervisor's thread uses it.

    Args:
        machine: the state machine.
        session: the rig and its processes.
        recordings: while one runs, nothing is changed.
        use: takes a rig from now on.
        begin_again: ends all processes and arms anew; told whether simulated cameras go on.
    """

    def __init__(
        self,
        machine: StateMachine,
        session: RigSession,
        recordings: RecordingControl,
        use: Callable[[RigInUse], None],
        begin_again: Callable[[bool], None],
    ) -> None:
        self._machine, self._session, self._recordings = machine, session, recordings
        self._use, self._begin_again = use, begin_again
        self._trial: _Trial | None = None

    @property
    def patience_s(self) -> float | None:
        """How long to wait for complete triplets after arming; None: as always."""
        return TRIED_S if self._trial is not None and self._trial.warm else None

    def change_camera(self, new: RigInUse, name: str) -> None:
        """Command: use a rig with another exposure or gain of a camera, which is away for a moment while armed."""
        if self._recordings.current is not None or self._session.busy:
            raise StateForbidsError(FORBIDDEN["expose", self._machine.state])
        self._use(new)
        self._session.change_camera(name)

    def change_calibration(self, new: RigInUse, calibration: Calibration | None) -> None:
        """Command: use a rig with another calibration, which the logs have from now on."""
        self._check("calibrate")
        self._use(new)
        self._recordings.calibrate(calibration)

    def change_rate(self, new: RigInUse) -> None:
        """Command: use a rig with another rate of its pulses; if it is armed, or has a fault, it is armed anew."""
        self._check("rate")
        self._use(new)
        if self._session.processes is not None:
            self._begin_again(False)

    def change_region(self, before: RigInUse, new: RigInUse, name: str, answer: "Future[None]") -> None:
        """Command: use a rig with another region of a camera; if it is armed, it is armed anew, or goes back.

        Args:
            before: what is in use.
            new: what is to be used.
            name: of the camera.
            answer: BadInputError if a camera or a check of arming refuses it.
        """
        self._check("region")
        self._use(new)
        processes = self._session.processes
        if processes is not None and self._machine.state is State.ARMED:
            heard = zip(new.rig.cameras, processes.cameras, strict=True)
            present = tuple(index for index, (camera, at) in enumerate(heard) if at.present or camera.name == name)
            warm = processes.warm and not processes.still
            said = named(camera_of(new.rig, name).region)
            self._trial = _Trial(before, name, said, present, warm, answer)
        else:
            answer.set_result(None)
        if processes is not None:
            self._begin_again(True)

    def lacks_cameras(self, processes: RigProcesses) -> bool:
        """Whether a camera that is needed for what is being tried has failed to be set up."""
        present = () if self._trial is None else self._trial.present
        return any(processes.cameras[index].tried and not processes.cameras[index].present for index in present)

    def stands(self, processes: RigProcesses, fault: Statement | None) -> bool:
        """Judge what is being tried, now that arming is done; False: it goes back and is armed anew.

        Args:
            processes: of the rig.
            fault: why the rig cannot be armed.
        """
        trial = self._trial
        if trial is None:
            return True
        if (why := _refusal(trial, processes, fault)) is not None:
            self.go_back(why)
            return False
        self._trial = None
        trial.answer.set_result(None)
        return True

    def go_back(self, why: Phrase) -> bool:
        """Take what was in use before, if something is being tried, and arm anew; whether that is so."""
        if not self.drop(why):
            return False
        self._begin_again(True)
        return True

    def drop(self, why: Phrase) -> bool:
        """Take what was in use before, if something is being tried; whether that is so."""
        trial, self._trial = self._trial, None
        if trial is None:
            return False
        self._use(trial.before)
        text = "{camera} does not read out {region}: {why}; it goes back to {before}"
        before = named(camera_of(trial.before.rig, trial.camera).region)
        said = phrase("event_region_refused", text, camera=trial.camera, region=trial.said, why=why, before=before)
        self._session.tell(Event.now(Level.ERROR, trial.camera, said))
        trial.answer.set_exception(BadInputError(said))
        return True

    def _check(self, what: str) -> None:
        state = self._machine.state
        if self._recordings.current is not None or self._session.busy or state in {State.ARMING, State.DISARMING}:
            raise StateForbidsError(FORBIDDEN[what, state])


def _refusal(trial: _Trial, processes: RigProcesses, fault: Statement | None) -> Phrase | None:
    """Why a region cannot be used; None: it can."""
    gone = next((index for index in trial.present if not processes.cameras[index].present), None)
    if gone is not None and processes.cameras[gone].tried:
        return processes.cameras[gone].said
    if gone is not None:
        return phrase("why_region_silent", "a camera that answered before does not")
    if fault is not None:
        return fault.said
    if trial.warm and not processes.warm:
        text = (
            "no complete triplets came within {seconds:g} s: exposure and readout may take longer than from pulse to "
            "pulse, or the pulses have stopped"
        )
        return phrase("why_region_no_triplets", text, seconds=TRIED_S)
    return None
