"""One moment's picture of the service for the panel, from what the supervisor knows."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any, Final

from rig.control import Message
from rig.settings import RigSettings
from svev.rig_processes import CameraPresence
from svev.room import Room
from svev.service.pulse_rate import PulseRate
from svev.service.state_machine import Phase
from svev.service.statements import about_camera, about_state, camera_state, process_restarted
from webpanel.models import (
    CameraStatus,
    DiskStatus,
    PrerollStatus,
    ProcessStatus,
    PulseStatus,
    Recording,
    State,
    Statement,
    Status,
)

_NO_REPORT: Message = {}
_VERSION: Final = version("svev")


@dataclass(frozen=True, slots=True)
class Facts:
    """What the supervisor knows at one moment.

    Attributes:
        phase: the state and its beginning.
        notice: what is to be said instead of the usual words for this state.
        heard: what was last heard of each camera; None while nothing runs.
        health: the recorder's last report of that name, empty if there is none.
        warm: whether whole triplets have come.
        pulses: rate of the pulses.
        room: on the disk.
        preroll_s: what is to be held in memory.
        pids: process ids by row of the process table.
        restarts: how often each row was started again.
    """

    phase: Phase
    notice: Statement | None
    heard: Sequence[CameraPresence] | None
    health: Message
    warm: bool
    pulses: PulseRate
    room: Room
    preroll_s: float
    recording: Recording | None
    last_recording: str | None
    pids: dict[str, int]
    restarts: dict[str, int]


def picture(rig: RigSettings, facts: Facts) -> Status:
    """The status for the panel."""
    cameras = _cameras(rig, facts)
    states = [camera.state for camera in cameras]
    state, pulses = facts.phase.state, facts.pulses
    arriving = facts.heard is not None and (pulses.arriving or (facts.warm and not facts.health))
    rate = pulses.rate_hz if arriving else None
    usual = about_state(state, rig.cameras, states, arriving, rate) if state is not State.FAULT else None
    statement = facts.notice or usual
    if statement is None:
        raise RuntimeError("a fault without words")
    room, reserve = facts.room, rig.recorder.reserve_gb
    return Status(
        state=state,
        since=facts.phase.since,
        statement=statement,
        rig=rig.name,
        version=_VERSION,
        cameras=cameras,
        pulses=PulseStatus(
            arriving=arriving,
            rate_hz=rate and round(rate, 2),
            spread_us=facts.health.get("pairing", _NO_REPORT).get("spread_median_us"),
            number=facts.health.get("pairing", _NO_REPORT).get("pulses", 0),
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
        processes=tuple(_process(name, pid, facts.restarts.get(name, 0)) for name, pid in facts.pids.items()),
    )


def _cameras(rig: RigSettings, facts: Facts) -> tuple[CameraStatus, ...]:
    trying = facts.heard is not None or facts.phase.state is State.ARMING
    heard = facts.heard or [CameraPresence()] * len(rig.cameras)
    reported: list[dict[str, Any]] = facts.health.get("cameras") or [{}] * len(rig.cameras)
    found = []
    for camera, presence, report, columns in zip(rig.cameras, heard, reported, rig.columns(), strict=True):
        state = camera_state(trying, presence)
        found.append(
            CameraStatus(
                name=camera.name,
                backend=camera.backend,
                address=camera.address,
                state=state,
                statement=about_camera(camera, state, presence.text),
                columns=columns,
                frames_per_s=report.get("frames_per_s"),
                frames=report.get("frames", 0),
                damaged=report.get("damaged", 0),
                resent_packets=report.get("resent_packets", 0),
                reconnects=report.get("reconnects", 0),
                temperature_c=report.get("temperature_c"),
                clock_offset_us=report.get("clock_offset_us"),
            )
        )
    return tuple(found)


def _preroll(facts: Facts) -> PrerollStatus:
    report = facts.health.get("preroll", _NO_REPORT)
    return PrerollStatus(
        seconds=report.get("seconds", 0.0),
        limit_s=report.get("limit_s", facts.preroll_s),
        memory_mb=report.get("memory_mb", 0.0),
    )


def _process(name: str, pid: int, restarts: int) -> ProcessStatus:
    statement = process_restarted(name, restarts) if restarts else None
    return ProcessStatus(name=name, pid=pid, restarts=restarts, statement=statement)
