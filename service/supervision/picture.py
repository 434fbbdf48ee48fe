"""One moment's picture of the service for the panel, from what the supervisor knows."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import Final

import msgspec

from rig.action import ActionCounts
from rig.api.jump import LastJump
from rig.api.recordings import NextJumper, Recording
from rig.api.statement import Level, Statement
from rig.api.status import (
    ActionAnswers,
    Alarm,
    CameraStatus,
    DiskStatus,
    MadePulses,
    PrerollStatus,
    ProcessStatus,
    PulseStatus,
    State,
    Status,
)
from rig.health import Health, PulsesMade
from rig.settings.model import RigSettings
from service.processes.rig_processes import CameraPresence
from service.recordings.storage import Room
from service.status.statements import about_camera, about_state, camera_state, pairing_alarm, process_restarted
from service.supervision.state_machine import Phase
from service.supervision.tap_guard import tap_guard
from service.supervision.watching import PulseRate
from triggering.alarms.notices import set_up_only
from triggering.sources.choice import trigger_source

#: What the status of a camera takes from its health record.
_MEASURED: Final = (
    "frames_per_s", "frames", "damaged", "resent_packets", "reconnects", "temperature_c", "clock_offset_us",
)  # fmt: skip
_VERSION: Final = version("svev")


@dataclass(frozen=True, slots=True)
class Facts:
    """What the supervisor knows at one moment.

    Attributes:
        phase: the state and its beginning.
        fault: the fault in words; None in any other state.
        notice: what befell the last recording.
        heard: what was last heard of each camera; None while nothing runs.
        health: the recorder's last health record, None if there is none.
        warm: whether whole triplets have come.
        pulses: rate of the pulses.
        still: whether pulses are made on request only.
        alarms: what is wrong with pulses, clocks and cameras.
        overloaded: indices of the cameras whose frames come late or get lost because the computer is too slow.
        room: on the disk.
        preroll_s: what is to be held in memory.
        holding_s: for how long the present past has been held, s; the health record may be of before.
        pids: process ids by row of the process table.
        restarts: how often each row was started again.
    """

    phase: Phase
    fault: Statement | None
    notice: Statement | None
    heard: Sequence[CameraPresence] | None
    health: Health | None
    warm: bool
    pulses: PulseRate
    still: bool
    alarms: tuple[Alarm, ...]
    overloaded: Sequence[int]
    room: Room
    preroll_s: float
    holding_s: float
    recording: Recording | None
    last_recording: str | None
    last_jump: LastJump | None
    next_jumper: NextJumper
    pids: dict[str, int]
    restarts: dict[str, int]


@dataclass(frozen=True, slots=True)
class WarmUp:
    """How far a rig has come since it was armed, for a command that waits for it.

    Attributes:
        state: the state of the service.
        cameras: presence of each camera; None while there are no processes.
        warm: whether complete triplets have come.
        fault: why the rig is not armed; None in any other state.
    """

    state: State
    cameras: tuple[CameraPresence, ...] | None
    warm: bool
    fault: Statement | None


def picture(rig: RigSettings, facts: Facts) -> Status:
    """The status for the panel."""
    cameras = _cameras(rig, facts)
    states = [camera.state for camera in cameras]
    state, pulses = facts.phase.state, facts.pulses
    arriving = facts.heard is not None and (pulses.arriving or (facts.warm and not facts.health))
    rate = pulses.rate_hz if arriving else None
    if state is not State.FAULT:
        made = None if facts.health is None else facts.health.made
        closed = made is not None and made.gate_open is False
        statement = about_state(
            state, rig.cameras, states, arriving, rate, facts.overloaded, still=facts.still, gate_closed=closed
        )
        if facts.notice is not None and statement.level is Level.GOOD:  # what is wrong now matters more than what was
            statement = facts.notice
        if statement.level is Level.GOOD and (wrong := _wrong(rig, facts)) is not None:
            statement = wrong
    elif facts.fault is not None:
        statement = facts.fault
    else:
        raise RuntimeError("a fault without words")
    room, reserve = facts.room, rig.recorder.reserve_gb
    pairing = None if facts.health is None else facts.health.pairing
    return Status(
        state=state,
        since=facts.phase.since,
        statement=statement,
        notice=facts.notice,
        alarms=facts.alarms,
        guard=tap_guard(facts.phase),
        rig=rig.name,
        version=_VERSION,
        cameras=cameras,
        pulses=PulseStatus(
            arriving=arriving,
            running=not facts.still,
            rate_hz=rate and round(rate, 2),
            spread_us=None if pairing is None else pairing.spread_median_us,
            number=0 if pairing is None else pairing.seen,
            fired=None if facts.health is None else _fired(facts.health),
            made=None if facts.health is None else _made(facts.health.made),
        ),
        preroll=_preroll(facts),
        disk=DiskStatus(
            free_gb=round(room.free_bytes / 1e9, 2),
            reserve_gb=reserve,
            seconds_left=round(room.seconds),
            jumps_left=room.jumps,
            jump_s=rig.recorder.jump_s,
        ),
        recording=facts.recording,
        last_recording=facts.last_recording,
        last_jump=facts.last_jump,
        next_jumper=facts.next_jumper,
        processes=tuple(_process(name, pid, facts.restarts.get(name, 0)) for name, pid in facts.pids.items()),
    )


def _wrong(rig: RigSettings, facts: Facts) -> Statement | None:
    """The worst alarm, or that the trigger is for set-up only; None: nothing."""
    if facts.alarms:
        return facts.alarms[0].statement
    if facts.health is None:
        return None
    said = set_up_only(trigger_source(rig.trigger), facts.health.pairing)
    return None if said is None else pairing_alarm(said)


def _cameras(rig: RigSettings, facts: Facts) -> tuple[CameraStatus, ...]:
    trying = facts.heard is not None or facts.phase.state is State.ARMING
    heard = facts.heard or [CameraPresence()] * len(rig.cameras)
    reported = [None] * len(rig.cameras) if facts.health is None else facts.health.cameras
    found = []
    for camera, presence, report, columns in zip(rig.cameras, heard, reported, rig.columns(), strict=True):
        state = camera_state(trying, presence)
        idle = report is not None and report.frames_per_s == 0
        found.append(
            CameraStatus(
                name=camera.name,
                backend=camera.backend,
                address=camera.address,
                state=state,
                statement=about_camera(camera, state, presence.said, overloaded=bool(facts.overloaded), idle=idle),
                columns=columns,
                actions=None if report is None else _answers(report.actions),
                **({} if report is None else {name: getattr(report, name) for name in _MEASURED}),
            )
        )
    return tuple(found)


def _answers(counts: ActionCounts | None) -> ActionAnswers | None:
    return None if counts is None else ActionAnswers(**msgspec.structs.asdict(counts))


def _fired(health: Health) -> int | None:
    """How many pulses the source says it made; what a line has made is known before the pairing has heard of it."""
    if health.made is not None:
        return health.made.made
    return None if health.pairing.source is None else health.pairing.source.fired


def _made(pulses: PulsesMade | None) -> MadePulses | None:
    return None if pulses is None else MadePulses(**msgspec.structs.asdict(pulses))


def _preroll(facts: Facts) -> PrerollStatus:
    if facts.health is None:
        return PrerollStatus(seconds=0.0, limit_s=facts.preroll_s, memory_mb=0.0)
    held = facts.health.preroll
    seconds = min(held.seconds, round(facts.holding_s, 3))
    return PrerollStatus(seconds=seconds, limit_s=held.limit_s, memory_mb=held.memory_mb)


def _process(name: str, pid: int, restarts: int) -> ProcessStatus:
    statement = process_restarted(name, restarts) if restarts else None
    return ProcessStatus(name=name, pid=pid, restarts=restarts, statement=statement)
