"""Runs the doctor for the panel: one examination at a time, which disturbs no armed rig and no rehearsal."""

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

from rig.api import status as models
from rig.api.status import CameraState, State, Status
from rig.settings.model import RigSettings
from svev.doctor.examination import probes, run_probe
from svev.doctor.finding import Finding, Level, Topic, failure, judged, passed

_KEPT_S: Final = 10.0
#: Names of probes that would disturb an armed rig (disk, cameras) or find its own sockets in the way.
_ONLY_IDLE: Final = frozenset({"disk", "publication", "cameras", "FireWire", "discovery"})
_RANK: Final = tuple(Level)


class PanelDoctor:
    """Examines what a recording stands on. May be asked from any thread.

    Args:
        rig: gives the rig as it is in use.
        data: folder of the recordings.
    """

    def __init__(self, rig: Callable[[], RigSettings], data: Path) -> None:
        self._rig, self._data = rig, data
        self._lock = threading.Lock()
        self._report: models.DoctorReport | None = None
        self._key: tuple[bool, float] = (False, 0.0)

    def report(self, status: Status, interrupted: bool | None = None) -> models.DoctorReport:
        """Examine everything that may be examined in this state; give the last report while it is fresh.

        Args:
            status: present status of the service.
            interrupted: whether the beam of the light barrier is, as the service sees it; None: it does not.
        """
        with self._lock:
            idle = status.state is State.IDLE and status.rehearsal is None
            kept_idle, until = self._key
            if self._report is not None and kept_idle == idle and time.monotonic() < until:
                return self._report
            findings = list(self._look(status, interrupted, idle=idle))
            worst = max((finding.level for finding in findings), key=_RANK.index)
            self._report = models.DoctorReport(worst=worst.value, findings=tuple(shown(each) for each in findings))
            self._key = (idle, time.monotonic() + _KEPT_S)
            return self._report

    def _look(self, status: Status, interrupted: bool | None, *, idle: bool) -> Iterator[Finding]:
        for probe in probes(self._rig(), self._data, interrupted):
            if idle or probe.name not in _ONLY_IDLE:
                yield from run_probe(probe)
            elif probe.name == "cameras" and status.rehearsal is None:
                yield from look_at_armed_cameras(status)
            elif probe.name == "disk":
                yield _room_of(status)
        if status.rehearsal is not None:
            what = "what would disturb the rehearsal is not examined while it runs"
            yield passed(Topic.CAMERAS, "check_rehearsing", what)
        elif not idle:
            what = "what would disturb the rig is not examined while it is armed: disarm for that"
            yield passed(Topic.CAMERAS, "check_armed", what)


def look_at_armed_cameras(status: Status) -> Iterator[Finding]:
    """Findings on the cameras of an armed rig, which knows them better than any probe, and on the computer for them.

    Args:
        status: of the service, whose words are given: *Check* and the live view name the same cause.
    """
    if status.statement.code.endswith("_overloaded"):
        yield judged(Level.WARN, Topic.PROCESSOR, status.statement.said, status.statement.advice)
    for camera in status.cameras:
        said = camera.statement
        waits = said.code == "camera_waits" and status.pulses.running  # stopped pulses are nobody's fault
        level = Level.WARN if waits or camera.state is CameraState.SILENT else Level.PASS
        level = Level.FAIL if camera.state is CameraState.ABSENT else level
        yield judged(level, Topic.CAMERAS, said.said, said.advice)


def _room_of(status: Status) -> Finding:
    disk = status.disk
    gb, jumps, jump_s = disk.free_gb, disk.jumps_left, disk.jump_s
    if jumps < 1:
        what = "{gb:g} GB free, room for {jumps} jumps of {jump_s:g} s"
        remedy = "empty the trash; delete recordings and empty it again, or move them to another disk"
        return failure(Topic.DISK, "check_disk_full", what, remedy, gb=gb, jumps=jumps, jump_s=jump_s)
    what = "{gb:g} GB free, room for {jumps} jumps of {jump_s:g} s; disarm to have its speed examined"
    return passed(Topic.DISK, "check_room_armed", what, gb=gb, jumps=jumps, jump_s=jump_s)


def shown(finding: Finding) -> models.Finding:
    """A finding as the REST API has it."""
    return models.Finding(
        level=finding.level.value,
        topic=finding.topic.value,
        code=finding.code,
        what=finding.what,
        remedy=finding.remedy,
        values=finding.values,
    )
