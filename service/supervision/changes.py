"""Changes of a rig while it runs: its pulses, exposure, calibration, rate, and regions, which a camera may refuse."""

from dataclasses import replace
from typing import Final

from rig.api.statement import Statement
from rig.api.status import State
from rig.errors import BadInputError, StateForbidsError
from rig.events import TRIGGER, Level
from rig.phrase import Phrase, phrase
from rig.settings.light import camera_of
from rig.settings.region import named
from service.processes.seen import Processes, Seen
from service.status.forbidden import FORBIDDEN
from service.supervision.messages import (
    Answer,
    Burst,
    ChangeCalibration,
    ChangeCamera,
    ChangeParts,
    ChangeRate,
    ChangeRegion,
    Do,
    LetPulses,
    Refuse,
    RenewCamera,
    RunTrain,
    Say,
    UseRig,
)
from service.supervision.phases import arm_anew
from service.supervision.situation import WARM_S, Moment, RigInUse, Situation, Trial

#: Longest wait for complete triplets with another region, if they came before: a busy computer may be slow to begin.
TRIED_S: Final = 10.0


def change_train(now: Situation, command: RunTrain, _: Moment, do: Do) -> Situation:
    """Start or stop the train of pulses.

    Raises:
        StateForbidsError: not armed, or a recording runs.
    """
    _check_pulses(now)
    do(Answer(command.answer, None))
    return run_train(now, do, running=command.running) if command.running == now.seen.still else now


def run_train(now: Situation, do: Do, *, running: bool) -> Situation:
    """Start or stop the train of pulses, which is not so yet."""
    do(LetPulses(None if running else 0))
    started = phrase("event_train_started", "the pulses are started again")
    stopped = phrase("event_train_stopped", "the pulses are stopped on request; a recording starts them again")
    do(Say(Level.INFO, TRIGGER, started if running else stopped))
    return now


def burst(now: Situation, command: Burst, _: Moment, do: Do) -> Situation:
    """Make a number of pulses.

    Raises:
        StateForbidsError: the train runs, the rig is not armed, or a recording runs.
    """
    _check_pulses(now)
    if not now.seen.still:
        raise StateForbidsError(phrase("pulses_run", "the pulses run: stop them, then ask for a number of pulses"))
    do(LetPulses(command.pulses))
    do(Say(Level.INFO, TRIGGER, phrase("event_burst", "is to make {pulses} pulses", pulses=command.pulses)))
    do(Answer(command.answer, None))
    return now


def change_camera(now: Situation, command: ChangeCamera, _: Moment, do: Do) -> Situation:
    """Use another exposure or gain of a camera.

    Raises:
        StateForbidsError: a recording runs, or processes are being started or stopped.
    """
    if now.recordings.current is not None or now.seen.busy:
        raise StateForbidsError(FORBIDDEN["expose", now.state])
    now = _use(now, command.new, do)
    do(RenewCamera(command.camera))
    do(Answer(command.answer, None))
    return now


def change_calibration(now: Situation, command: ChangeCalibration, _: Moment, do: Do) -> Situation:
    """Use another calibration.

    Raises:
        StateForbidsError: a recording runs, or the rig is being armed or disarmed.
    """
    _check_change(now, "calibrate")
    do(Answer(command.answer, None))
    return _use(now, command.new, do)


def change_parts(now: Situation, command: ChangeParts, _: Moment, do: Do) -> Situation:
    """Use other limits for the parts of a recording: each recording has those of its begin."""
    do(Answer(command.answer, None))
    return _use(now, command.new, do)


def change_rate(now: Situation, command: ChangeRate, at: Moment, do: Do) -> Situation:
    """Use another rate of the pulses.

    Raises:
        StateForbidsError: a recording runs, or the rig is being armed or disarmed.
    """
    _check_change(now, "rate")
    do(Answer(command.answer, None))
    now = _use(now, command.new, do)
    return now if now.seen.processes is Processes.NONE else arm_anew(now, at, do, keep_hill=False)


def change_region(now: Situation, command: ChangeRegion, at: Moment, do: Do) -> Situation:
    """Use another region of a camera; while the rig is armed it is tried, and may be given back.

    Raises:
        StateForbidsError: a recording runs, or the rig is being armed or disarmed.
    """
    _check_change(now, "region")
    before, seen, name = now.in_use, now.seen, command.camera
    now = _use(now, command.new, do)
    if seen.processes is not Processes.NONE and now.state is State.ARMED:
        heard = zip(command.new.rig.cameras, seen.cameras or (), strict=True)
        present = tuple(index for index, (camera, there) in enumerate(heard) if there.present or camera.name == name)
        said = named(camera_of(command.new.rig, name).region)
        warm = seen.warm and not seen.still
        now = replace(now, trial=Trial(before, name, said, present, warm, command.answer))
    else:
        do(Answer(command.answer, None))
    return now if seen.processes is Processes.NONE else arm_anew(now, at, do, keep_hill=True)


def patience_s(now: Situation) -> float:
    """How long to wait for complete triplets after arming."""
    return TRIED_S if now.trial is not None and now.trial.warm else WARM_S


def lacks_cameras(now: Situation) -> bool:
    """Whether a camera that is needed for what is being tried has failed to be set up."""
    cameras = now.seen.cameras
    if now.trial is None or cameras is None:
        return False
    return any(cameras[index].tried and not cameras[index].present for index in now.trial.present)


def refusal(now: Situation, fault: Statement | None) -> Phrase | None:
    """Why what is being tried cannot be used, now that arming is done; None: it can, or nothing is being tried.

    Args:
        now: the situation.
        fault: why the rig cannot be armed.
    """
    trial, seen = now.trial, now.seen
    if trial is None or seen.cameras is None:
        return None
    gone = next((seen.cameras[index] for index in trial.present if not seen.cameras[index].present), None)
    if gone is not None:
        return gone.said if gone.tried else phrase("why_region_silent", "a camera that answered before does not")
    if fault is not None:
        return fault.said
    return _no_triplets(trial, seen)


def keep_trial(now: Situation, do: Do) -> Situation:
    """Go on with what was being tried."""
    if now.trial is None:
        return now
    do(Answer(now.trial.answer, None))
    return replace(now, trial=None)


def go_back(now: Situation, why: Phrase, at: Moment, do: Do) -> Situation:
    """Take what was in use before what is being tried, and arm anew."""
    return arm_anew(drop_trial(now, why, do), at, do, keep_hill=True)


def drop_trial(now: Situation, why: Phrase, do: Do) -> Situation:
    """Take what was in use before, if something is being tried."""
    if (trial := now.trial) is None:
        return now
    now = _use(replace(now, trial=None), trial.before, do)
    text = "{camera} does not read out {region}: {why}; it goes back to {before}"
    before = named(camera_of(trial.before.rig, trial.camera).region)
    said = phrase("event_region_refused", text, camera=trial.camera, region=trial.said, why=why, before=before)
    do(Say(Level.ERROR, trial.camera, said))
    do(Refuse(trial.answer, BadInputError(said)))
    return now


def _use(now: Situation, new: RigInUse, do: Do) -> Situation:
    do(UseRig(new.rig))
    return replace(now, in_use=new)


def _no_triplets(trial: Trial, seen: Seen) -> Phrase | None:
    if seen.warm or not trial.warm:
        return None
    text = (
        "no complete triplets came within {seconds:g} s: exposure and readout may take longer than from pulse to "
        "pulse, or the pulses have stopped"
    )
    return phrase("why_region_no_triplets", text, seconds=TRIED_S)


def _check_pulses(now: Situation) -> None:
    if now.state is not State.ARMED or now.recordings.current is not None:
        raise StateForbidsError(FORBIDDEN["pulses", State.RECORDING if now.state is State.ARMED else now.state])


def _check_change(now: Situation, what: str) -> None:
    changing = now.seen.busy or now.state in {State.ARMING, State.DISARMING}
    if now.recordings.current is not None or changing:
        raise StateForbidsError(FORBIDDEN[what, now.state])
