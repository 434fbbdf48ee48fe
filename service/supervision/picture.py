"""The status for the panel, derived from the situation."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import Final

import msgspec

from rig.action import ActionCounts
from rig.api.jump import LastJump
from rig.api.recordings import NextJumper
from rig.api.statement import Level, Statement
from rig.api.status import (
    ActionAnswers,
    Alarm,
    CameraState,
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
from service.processes.rig_programs import RECORDER
from service.processes.seen import CameraPresence
from service.recordings.storage import room_for
from service.status.statements import about_camera, about_state, camera_state, pairing_alarm, process_restarted
from service.supervision.situation import Moment, Situation
from service.supervision.tap_guard import tap_guard
from triggering.alarms.notices import set_up_only
from triggering.sources.choice import trigger_source

#: What the status of a camera takes from its health record.
_MEASURED: Final = (
    "frames_per_s", "frames", "damaged", "resent_packets", "reconnects", "temperature_c", "clock_offset_us",
)  # fmt: skip
_VERSION: Final = version("svev")


@dataclass(frozen=True, slots=True)
class Beside:
    """What the status shows beside the situation.

    Attributes:
        at: the present moment.
        alarms: what is wrong with pulses, clocks and cameras.
        overloaded: indices of the cameras whose frames come late or get lost because the computer is too slow.
        free_bytes: on the disk.
        preroll_s: what is to be held in memory.
        last_jump: the jump that was measured last.
        next_jumper: whom the next recording is of.
    """

    at: Moment
    alarms: tuple[Alarm, ...]
    overloaded: Sequence[int]
    free_bytes: int
    preroll_s: float
    last_jump: LastJump | None
    next_jumper: NextJumper


def picture(now: Situation, beside: Beside) -> Status:
    """The status for the panel."""
    rig, seen, current = now.in_use.rig, now.seen, now.recordings.current
    cameras, pulses = _cameras(now, beside), now.heard.pulses
    arriving = seen.cameras is not None and (pulses.arriving or (seen.warm and not seen.health))
    rate = pulses.rate_hz if arriving else None
    pairing = None if seen.health is None else seen.health.pairing
    room = room_for(rig, beside.free_bytes)
    return Status(
        state=now.state,
        since=now.phase.since,
        statement=_statement(now, beside, [camera.state for camera in cameras], rate, arriving=arriving),
        notice=_notice(now),
        alarms=beside.alarms,
        guard=tap_guard(now.phase, beside.at.s),
        rig=rig.name,
        version=_VERSION,
        cameras=cameras,
        pulses=PulseStatus(
            arriving=arriving,
            running=not seen.still,
            rate_hz=rate and round(rate, 2),
            spread_us=None if pairing is None else pairing.spread_median_us,
            number=0 if pairing is None else pairing.seen,
            fired=None if seen.health is None else _fired(seen.health),
            made=None if seen.health is None else _made(seen.health.made),
        ),
        preroll=_preroll(now, beside),
        disk=DiskStatus(
            free_gb=round(room.free_bytes / 1e9, 2),
            reserve_gb=rig.recorder.reserve_gb,
            seconds_left=round(room.seconds),
            jumps_left=room.jumps,
            jump_s=rig.recorder.jump_s,
        ),
        recording=None if current is None or current.opening else current.view(beside.at.utc),
        last_recording=now.recordings.last,
        last_jump=beside.last_jump,
        next_jumper=beside.next_jumper,
        processes=tuple(_processes(now)),
    )


def _notice(now: Situation) -> Statement | None:
    return now.recordings.notice if now.state in {State.ARMED, State.RECORDING} else None


def _statement(
    now: Situation, beside: Beside, states: Sequence[CameraState], rate: float | None, *, arriving: bool
) -> Statement:
    """The state in words, or what is wrong; what is wrong now matters more than what befell the last recording."""
    if now.state is State.FAULT:
        if now.fault.statement is None:
            raise RuntimeError("a fault without words")
        return now.fault.statement
    made = None if now.seen.health is None else now.seen.health.made
    closed = made is not None and made.gate_open is False
    said = about_state(
        now.state, now.in_use.rig.cameras, states, arriving, rate, beside.overloaded,
        still=now.seen.still, gate_closed=closed,
    )  # fmt: skip
    if said.level is Level.GOOD and (notice := _notice(now)) is not None:
        said = notice
    if said.level is Level.GOOD and (wrong := _wrong(now, beside)) is not None:
        said = wrong
    return said


def _wrong(now: Situation, beside: Beside) -> Statement | None:
    """The worst alarm, or that the trigger is for set-up only; None: nothing."""
    if beside.alarms:
        return beside.alarms[0].statement
    if now.seen.health is None:
        return None
    said = set_up_only(trigger_source(now.in_use.rig.trigger), now.seen.health.pairing)
    return None if said is None else pairing_alarm(said)


def _cameras(now: Situation, beside: Beside) -> tuple[CameraStatus, ...]:
    rig, health = now.in_use.rig, now.seen.health
    trying = now.seen.cameras is not None or now.state is State.ARMING
    heard = now.seen.cameras or [CameraPresence()] * len(rig.cameras)
    reported = [None] * len(rig.cameras) if health is None else health.cameras
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
                statement=about_camera(camera, state, presence.said, overloaded=bool(beside.overloaded), idle=idle),
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


def _preroll(now: Situation, beside: Beside) -> PrerollStatus:
    """What memory holds; the health record may be of before the last recording took it."""
    if now.seen.health is None:
        return PrerollStatus(seconds=0.0, limit_s=beside.preroll_s, memory_mb=0.0)
    held = now.seen.health.preroll
    seconds = min(held.seconds, round(beside.at.s - now.recordings.emptied_at, 3))
    return PrerollStatus(seconds=seconds, limit_s=held.limit_s, memory_mb=held.memory_mb)


def _processes(now: Situation) -> Iterator[ProcessStatus]:
    restarts = {RECORDER: now.fault.back_off.deaths, **now.seen.restarts}
    for name, pid in now.seen.pids.items():
        times = restarts.get(name, 0)
        statement = process_restarted(name, times) if times else None
        yield ProcessStatus(name=name, pid=pid, restarts=times, statement=statement)
