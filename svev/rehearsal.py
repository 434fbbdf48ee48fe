"""Rehearses a recording: some seconds through the whole chain, read back from the real disk, judged and deleted.

The doctor examines parts at rest. A rehearsal has the cameras, their processes, the pairing, the recorder and the disk
work together as in a recording, and then asks the log itself what came of it.
"""

import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from ipaddress import IPv4Address
from pathlib import Path
from statistics import median
from typing import Final

from recorder.checking.verify import VerifyReport, verify
from recorder.reading.items import Chunk
from recorder.reading.log_reader import LogReader
from recorder.reading.triplets import tag_of
from rig.clocks import NS_PER_US
from rig.frame import FrameStatus
from rig.host.disk import free_bytes
from rig.host.endings import Asks, heed
from rig.host.interfaces import interface_to
from rig.phrase import phrase
from rig.settings.model import RigSettings
from rig.tag import TripletTag
from rig.topics import TAG
from service.headless import HeadlessRig, Progress, record
from service.recordings.storage import new_log_path, room_for
from svev.doctor.cameras.exposure import exposes_on
from svev.doctor.disk import look_at_disk
from svev.doctor.finding import Finding, Level, Topic, failure, judged, passed, warning
from svev.doctor.network import gige_cameras, look_at_interfaces
from triggering.sources.choice import trigger_source

#: A spread of the trigger times within a pulse of more than this share of the period is odd, or an alarm.
_ODD_SPREAD, _WRONG_SPREAD = 0.05, 0.25
#: Of each packet of `network.packet_size` bytes, IP, UDP and GVSP headers; and on the wire, beside it: preamble,
#: Ethernet header, checksum, gap between packets.
_HEADERS, _FRAMING = 20 + 8 + 8, 8 + 14 + 4 + 12
_SET_UP_ONLY: Final = "check_set_up_only"
#: Folder of a rehearsal in that of the recordings, with the number of its process behind it.
_FOLDER: Final = ".rehearsal-"


@dataclass(frozen=True, slots=True)
class Rehearsed:
    """What a rehearsal showed.

    Attributes:
        pulses, complete: of the recording that was made.
        causes: missing frames by status.
        headroom: speed of disk and links over the speed needed, by name, as far as known.
        jumps: how many jumps fit on the disk.
        spread_us: from the first to the last camera's trigger time within a pulse: median and maximum; None: unknown.
        latency_ms: from trigger to frame in memory by camera: exposure, readout and transfer; median.
        findings: everything that was examined.
    """

    pulses: int
    complete: int
    causes: dict[str, int]
    headroom: dict[str, float]
    jumps: int
    spread_us: dict[str, float] | None
    latency_ms: dict[str, float]
    findings: tuple[Finding, ...]

    @property
    def ready(self) -> bool:
        """Whether nothing speaks against recording like this."""
        return all(finding.level is not Level.FAIL for finding in self.findings)

    @property
    def verdict(self) -> str:
        """The verdict in one line: figures if it is ready, otherwise the first thing to do."""
        if wrong := next((finding for finding in self.findings if finding.level is Level.FAIL), None):
            return f"not ready: {wrong.what}; {wrong.remedy}"
        narrow = min(self.headroom, key=lambda name: self.headroom[name], default="")
        parts = [f"headroom {self.headroom[narrow]:.1f}x ({narrow})"] if narrow else []
        parts.append(f"room for {self.jumps} jumps")
        if self.spread_us is not None:
            parts.append(f"spread within a pulse {self.spread_us['median']:.0f} us")
        if any(finding.code == _SET_UP_ONLY for finding in self.findings):
            parts.append("for set-up only")
        return ", ".join(parts)

    def to_json(self) -> dict[str, object]:
        """The rehearsal as one JSON object."""
        return {"ready": self.ready, "verdict": self.verdict} | asdict(self)


def rehearse(
    rig: RigSettings,
    rig_toml: str,
    directory: Path,
    seconds: float,
    say: Callable[[str], None],
    progress: Progress,
    asks: Asks,
) -> Rehearsed:
    """Record into `directory`, read back, judge, delete.

    Args:
        rig: the rig.
        rig_toml: the rig file's text.
        directory: folder of the recordings; made if missing.
        seconds: how much is recorded.
        say: prints a line about cameras that come or go.
        progress: shows how many pulses are recorded.
        asks: tells how often it was told to end.

    Raises:
        SvevError: a camera does not answer, no pulses come, the disk has no room, is too slow or fails, a process died.
        KeyboardInterrupt: it was to end before its time; what was recorded is deleted.
    """
    name = new_log_path(directory).name
    # What fails here is to be seen, so nothing goes on elsewhere.
    here = rig.recorder.model_copy(update={"directory": directory, "fallback_directory": None})
    rig = rig.model_copy(update={"recorder": here})
    _clear_away(directory)
    findings = [*look_at_disk(rig, directory), *look_at_interfaces(rig)]
    with tempfile.TemporaryDirectory(prefix=f"{_FOLDER}{os.getpid()}-", dir=directory) as folder:
        log = Path(folder) / name
        with HeadlessRig(rig, rig_toml, say) as running:
            recorded = record(
                running, rig, log, seconds, session={"session": "rehearsal"}, progress=progress, asks=asks
            )
        if recorded.disk_error is not None:
            raise recorded.disk_error
        if recorded.stopped_early:
            raise KeyboardInterrupt  # what was recorded until then bears no verdict
        report, timing = verify(log, lambda _: heed(asks)), _Timing.of(log)
    findings += judge_pulses(rig, recorded.alarms, report)
    findings += judge_source(rig)
    findings += _judge_timing(rig, timing)
    return Rehearsed(
        pulses=report.ledger.pulses,
        complete=report.ledger.complete,
        causes=recorded.report.counts.causes.model_dump(),
        headroom={name: round(times, 2) for name, times in headroom_of(rig, findings)},
        jumps=room_for(rig, free_bytes(directory) or 0).jumps,
        spread_us=timing.spread_us,
        latency_ms=timing.latency_ms,
        findings=tuple(findings),
    )


def _clear_away(directory: Path) -> None:
    """Remove what rehearsals left whose process was killed."""
    for left in directory.glob(f"{_FOLDER}*"):
        pid = left.name.removeprefix(_FOLDER).partition("-")[0]
        if pid.isdecimal() and not _runs(int(pid)) and left.is_dir() and not left.is_symlink():
            shutil.rmtree(left)


def _runs(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # it is somebody else's
        return True
    return True


@dataclass(frozen=True, slots=True)
class _Timing:
    """Times in a log: spread within a pulse, us, and the median time from trigger to memory by camera, ms."""

    spread_us: dict[str, float] | None
    latency_ms: dict[str, float]

    @classmethod
    def of(cls, log: Path) -> "_Timing":
        spreads: list[float] = []
        latencies: dict[str, list[int]] = {}
        for tag in _tags(log):
            offsets = [camera.offset_us for camera in tag.cameras if camera.offset_us is not None]
            if len(offsets) > 1:
                spreads.append(max(offsets) - min(offsets))
            for camera in tag.cameras:
                if camera.host_time is not None:
                    triggered = tag.time + round((camera.offset_us or 0.0) * NS_PER_US)
                    latencies.setdefault(camera.name, []).append(camera.host_time - triggered)
        latency = {name: round(median(times) / 1e6, 3) for name, times in latencies.items()}
        if not spreads:
            return cls(None, latency)
        return cls({"median": round(median(spreads), 1), "max": round(max(spreads), 1)}, latency)


def _tags(log: Path) -> Iterator[TripletTag]:
    with LogReader(log, skim=True) as reader:
        for item in reader.items(only=(TAG.name,)):
            if isinstance(item, Chunk):
                yield from (tag for message in item.messages if (tag := tag_of(message)) is not None)


def judge_pulses(rig: RigSettings, alarms: Sequence[str], report: VerifyReport) -> Iterator[Finding]:
    """Did every frame come, is the log on the disk what was written, does its ledger bear the tags out?

    Args:
        rig: the rig.
        alarms: what was wrong with clocks, trigger or rate.
        report: of the log.
    """
    ledger = report.ledger
    text = "{pulses} pulses recorded, {complete} complete"
    said = phrase("check_rehearsed", text, pulses=ledger.pulses, complete=ledger.complete)
    away = {name for name, states in ledger.failed.cameras.items() if states == {FrameStatus.ABSENT: ledger.pulses}}
    if ledger.whole:
        yield judged(Level.PASS, Topic.CAMERAS, said, "")
    elif (
        away
        and away == set(ledger.failed.cameras)
        and not ledger.pauses()
        and len(rig.cameras) - len(away) >= (rig.least_cameras)
    ):
        what, remedy = "{said}: without {missing}", "check its power and cable"
        missing = ", ".join(sorted(away))
        yield warning(Topic.CAMERAS, "check_rehearsed_without", what, remedy, said=said, missing=missing)
    else:
        what = "{said}: {missing}"
        remedy = "see docs/how-to/troubleshooting/pulses.md for what the causes point at"
        missing = ledger.summary_line().partition(", ")[2]
        yield failure(Topic.CAMERAS, "check_rehearsed_partly", what, remedy, said=said, missing=missing)
    for alarm in alarms:
        what, remedy = "clocks, trigger or rate are not right: {why}", "correct that, and rehearse again"
        yield failure(Topic.TIME, "check_rehearsed_alarm", what, remedy, why=alarm)
    if report.findings:
        what, remedy = "what was written cannot be read back: {why}", "look at `dmesg`, record to another disk"
        yield failure(Topic.DISK, "check_not_read_back", what, remedy, why=report.findings[0])
    else:
        yield passed(Topic.DISK, "check_read_back", "{mb:.1f} MB read back and checked", mb=report.bytes / 1e6)
    if not report.recounted.agrees:
        what = "the recomputed ledger does not agree: {why}"
        remedy = "look for a trigger input that bounces, and for clocks that are set while pulses come"
        why = next(report.recounted.in_words())
        yield failure(Topic.CAMERAS, "check_ledger", what, remedy, why=why)


def judge_source(rig: RigSettings) -> Iterator[Finding]:
    """Are the pulses good enough to measure with?"""
    if trigger_source(rig.trigger).set_up_only:
        what = "the cameras are triggered by software: for set-up only, not to measure in"
        remedy = 'to measure, connect a pulse generator and set source = "external" under [trigger] in the rig file'
        yield warning(Topic.TIME, "check_set_up_only", what, remedy)


def _judge_timing(rig: RigSettings, timing: _Timing) -> Iterator[Finding]:
    """Are the cameras ready for the next pulse, and are they triggered together?"""
    period_ms = rig.trigger.period_ns / 1e6
    for camera in rig.cameras:
        busy_ms = timing.latency_ms.get(camera.name)
        if (too_long := exposes_on(camera, rig)) is not None:
            yield too_long
        elif busy_ms is not None:
            said = phrase(
                "check_dead_time",
                "{camera}: exposure, readout and transfer take {busy:.1f} ms, pulses come every {period:.1f} ms",
                camera=camera.name, busy=busy_ms, period=period_ms,
            )  # fmt: skip
            remedy = (
                "it has to expose while it sends: if it misses pulses, shorten exposure_us or make its region smaller"
            )
            yield judged(Level.PASS if busy_ms < period_ms else Level.WARN, Topic.CAMERAS, said, remedy)
    if timing.spread_us is not None:
        said = phrase(
            "check_spread",
            "the trigger times within a pulse lie {typical:.0f} us apart, {largest:.0f} us at most",
            typical=timing.spread_us["median"], largest=timing.spread_us["max"],
        )  # fmt: skip
        share = timing.spread_us["median"] / (1000 * period_ms)
        level = Level.FAIL if share > _WRONG_SPREAD else Level.WARN if share > _ODD_SPREAD else Level.PASS
        yield judged(level, Topic.TIME, said, "look at trigger cables and inputs, and at trigger delays in the cameras")


def headroom_of(rig: RigSettings, findings: list[Finding]) -> Iterator[tuple[str, float]]:
    """Speed over speed needed, by name, of the disk and of each link whose speed is known.

    Args:
        rig: the rig.
        findings: among them, how fast the disk is.
    """
    for finding in findings:
        if finding.code == "check_disk_speed":
            yield "disk", float(str(finding.values["writes"])) / float(str(finding.values["needed"]))
    loads: dict[str, tuple[int, float]] = {}
    on_the_wire = (rig.network.packet_size + _FRAMING) / (rig.network.packet_size - _HEADERS)
    for camera in gige_cameras(rig):
        link = interface_to(str(IPv4Address(camera.address)))
        if link is not None and link.speed_mbps:
            mbps = camera.frame_bytes * 8 * rig.trigger.rate_hz / 1e6 * on_the_wire
            loads[link.name] = link.speed_mbps, loads.get(link.name, (0, 0.0))[1] + mbps
    yield from ((name, speed / load) for name, (speed, load) in loads.items())
