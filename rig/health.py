"""The health record (`svev.Health`): the recorder's rates, queues and drops once a second, in the log and on ZeroMQ.

The JSON schema that stands in every log comes from these types.
"""

from typing import Annotated, Final

import msgspec
from msgspec import Meta

from rig.action import ActionCounts
from rig.clocks import DecimalNs
from rig.frame import FrameStatus
from rig.topics import HEALTH
from rig.transport import wire


class CameraHealth(msgspec.Struct, frozen=True):
    """One camera, in the order left to right; counts are since its grabber process was started."""

    name: str
    connected: bool
    frames_per_s: Annotated[int, Meta(description="whole frames of the last second")]
    clock_offset_us: Annotated[
        float | None, Meta(description="trigger time minus the pulse's, median of the last 30 pulses")
    ]
    temperature_c: Annotated[float | None, Meta(description="of the camera, null where it does not tell")]
    frames: Annotated[int, Meta(description="whole frames")]
    damaged: Annotated[int, Meta(description="damaged frames")]
    underruns: Annotated[int, Meta(description="frames that found no free slot in the ring")]
    resent_packets: Annotated[int, Meta(description="packets that the camera sent again")]
    missing_packets: Annotated[int, Meta(description="packets that never came")]
    reconnects: Annotated[int, Meta(description="connections after the first")]
    temperature_mdeg: Annotated[int, Meta(description="thousandths of a degree, 0 where the camera does not tell")]
    queue_overflows: Annotated[int, Meta(description="records that found their queue full")]
    slots_queued: Annotated[int, Meta(description="slots of the ring that wait for the recorder")]
    actions: Annotated[ActionCounts | None, Meta(description="answers to action commands; null: it gets none")] = None


class CameraCounters(msgspec.Struct):
    """Counts of the pairing for one camera: outcomes of pulses, and everything that should not happen."""

    ok: int = 0
    lost: int = 0
    missed: int = 0
    damaged: int = 0
    absent: int = 0
    late: Annotated[int, Meta(description="whole frames whose pulse was decided already")] = 0
    duplicate: Annotated[int, Meta(description="whole frames that came twice, or a second one for a pulse")] = 0
    unanchored: Annotated[int, Meta(description="whole frames before the camera's clock was known well enough")] = 0
    implausible: Annotated[int, Meta(description="whole frames with impossible device time, treated as damaged")] = 0
    stale: Annotated[int, Meta(description="records of an epoch that is over")] = 0
    restarts: Annotated[int, Meta(description="times the ids began anew without a new epoch")] = 0
    clock_steps: Annotated[int, Meta(description="times the device clock was set without a new epoch")] = 0
    silences: Annotated[int, Meta(description="times the camera fell silent while others delivered")] = 0
    overruns: Annotated[int, Meta(description="pulses that the camera saw but could not follow")] = 0
    presumed: Annotated[int, Meta(description="pulses decided as lost at their deadline, before the ids told")] = 0
    contradicted: Annotated[int, Meta(description="those of them that the ids later told to have been missed")] = 0
    unexplained: Annotated[int, Meta(description="frames that the ids tell of but for which there was no pulse")] = 0
    unassigned: Annotated[int, Meta(description="damaged arrivals for which there was no pulse")] = 0

    def count(self, outcome: FrameStatus) -> None:
        """Count the outcome of one pulse."""
        setattr(self, outcome.value, getattr(self, outcome.value) + 1)

    @property
    def outcomes(self) -> dict[FrameStatus, int]:
        """Number of decided pulses by outcome."""
        return {status: getattr(self, status.value) for status in FrameStatus}


class CameraPairing(CameraCounters, kw_only=True):
    """One camera's clock on the common time line, and its counters since the recorder was started."""

    connected: bool
    silent: bool
    clock_known: bool
    clock_offset_ns: Annotated[DecimalNs, Meta(description="host time minus device time")]
    clock_drift_ppm: Annotated[float, Meta(description="how much faster than the host the device clock runs")]
    clock_uncertainty_us: float | None
    latency_ms: Annotated[float, Meta(description="from the trigger to the frame in memory")]
    clock_set: Annotated[bool, Meta(description="the device clock was set in the last ten seconds")] = False
    clock_from_zero: Annotated[
        bool, Meta(description="it began at zero then: it ran over, or the camera restarted")
    ] = False
    doubted: Annotated[
        int,
        Meta(description="frames not used since its numbers, times and arrivals contradict each other; 0: they agree"),
    ] = 0
    exposure_subtracted_us: Annotated[
        float, Meta(description="the camera notes the end of so long an exposure; 0: its beginning, or it is not known")
    ] = 0.0


class SourcePairing(msgspec.Struct, frozen=True):
    """What the source of the pulses says it has fired, against what the cameras saw, since the recorder was started."""

    fired: Annotated[int, Meta(description="pulses that the source says it has fired")]
    unseen: Annotated[int, Meta(description="of them, no camera delivered a frame; they have tags")]
    untagged: Annotated[int, Meta(description="of them, so many have no tag, since the source told of them too late")]
    unfired: Annotated[int, Meta(description="pulses that cameras saw, and that the source did not fire")]
    period_us: Annotated[float | None, Meta(description="between pulses, on the host's clock, as the source tells")]
    uncertainty_us: Annotated[float, Meta(description="largest error of the source's times")]
    unseen_lately: Annotated[bool, Meta(description="unseen or untagged ones in the last ten seconds")]
    unfired_lately: Annotated[bool, Meta(description="unfired ones in the last ten seconds")]


class PairingHealth(msgspec.Struct, frozen=True):
    """The pulses and the cameras' clocks."""

    pulses: Annotated[int, Meta(description="decided since the recorder was started")]
    proven_by_ids: Annotated[
        int, Meta(description="of them, no camera delivered so many, but the cameras' frame numbers prove them")
    ]
    unwatched: Annotated[
        int, Meta(description="of them, so many were due by the rhythm of the others while no camera was there")
    ]
    open: Annotated[int, Meta(description="pulses that are not decided yet")]
    period_us: Annotated[float, Meta(description="between pulses, tracked")]
    spread_median_us: Annotated[float, Meta(description="of trigger times within a pulse")]
    spread_max_us: Annotated[float, Meta(description="likewise, the largest of late")]
    alarm: Annotated[bool, Meta(description="whether the spread is larger than the pairing allows for")]
    cameras: tuple[CameraPairing, ...]
    spread_usual_us: Annotated[float, Meta(description="spread that nine in ten of the recent pulses keep")] = 0.0
    rate_hz: Annotated[float | None, Meta(description="measured; null where the pulses have no rhythm")] = None
    split_us: Annotated[
        float | None,
        Meta(description="distance of two pulses of the last ten seconds of which no camera has both; null: none"),
    ] = None
    source: Annotated[SourcePairing | None, Meta(description="null where the source does not tell of its pulses")] = (
        None
    )

    @property
    def seen(self) -> int:
        """Pulses of which some camera told."""
        return self.pulses - self.unwatched


class PulsesMade(msgspec.Struct, frozen=True):
    """The pulses that a line of the computer has made since arming; how late they were against even times."""

    made: Annotated[int, Meta(description="pulses")]
    skipped: Annotated[int, Meta(description="pulses that were left out, since they would have come late")]
    late_median_us: Annotated[float | None, Meta(description="of the last thousand pulses; null: none was made yet")]
    late_p99_us: Annotated[float | None, Meta(description="likewise; 1 of 100 was later")]
    late_max_us: Annotated[float | None, Meta(description="the latest of all")]
    realtime: Annotated[bool, Meta(description="whether the thread that makes them has a real-time priority")]
    gate_open: Annotated[
        bool | None,
        Meta(description="whether the gate let the last pulse pass that was due; null: no gate, or no pulse"),
    ] = None


class ToldPulses(msgspec.Struct, frozen=True):
    """Pulses of which the source told at once, on this computer's monotonic clock."""

    first: Annotated[int, Meta(description="number of the first one, as the source counts")]
    times_ns: Annotated[tuple[DecimalNs, ...], Meta(description="when they fired; none: there were no more")]
    uncertainty_us: Annotated[float, Meta(description="largest error of the times")]
    until_ns: Annotated[DecimalNs, Meta(description="all pulses up to this time have been told")]


class PrerollHealth(msgspec.Struct, frozen=True):
    """Triplets that are held in memory for a recording that begins in the past."""

    seconds: Annotated[float, Meta(description="held at the moment")]
    limit_s: Annotated[float, Meta(description="held at most")]
    triplets: Annotated[int, Meta(description="held at the moment")]
    memory_mb: Annotated[float, Meta(description="memory set aside for it, 10^6 bytes")]


class WritingHealth(msgspec.Struct, frozen=True):
    """The writing of a log since it was opened."""

    bytes_written: int
    queued: Annotated[int, Meta(description="chunks that wait for the disk")]
    slowest_write_ms: float
    slowest_sync_ms: float
    direct: Annotated[bool, Meta(description="the file is written past the page cache")]


class DiskHealth(msgspec.Struct, frozen=True):
    """The disk that recordings go to."""

    free_bytes: Annotated[int | None, Meta(description="free, null while its directory is not there")]


class Latency(msgspec.Struct, frozen=True):
    """Times from a triplet's last frame in memory to disk and subscribers, since the recorder was started."""

    buckets_s: Annotated[
        dict[str, int], Meta(description="triplets that took so many seconds at most, cumulative, by the bound")
    ]
    sum_s: Annotated[float, Meta(description="sum of all times")]
    count: Annotated[int, Meta(description="triplets")]


class Health(msgspec.Struct, frozen=True):
    """State of the recorder, about once a second: rates, queues, drops, clocks, temperature, disk."""

    cameras: tuple[CameraHealth, ...]
    pairing: PairingHealth
    free_triplets: Annotated[int, Meta(description="triplet buffers that nobody holds")]
    unpublished: Annotated[int, Meta(description="triplets that were wanted and that no subscriber got")]
    preroll: PrerollHealth
    recording: Annotated[WritingHealth | None, Meta(description="null without a recording")]
    disk: DiskHealth
    latency: Latency
    made: Annotated[PulsesMade | None, Meta(description='null: trigger.source is not "gpio" or "iidc-broadcast"')] = (
        None
    )
    host_time_ns: Annotated[
        DecimalNs | None, Meta(description="this computer's monotonic clock when the record was made")
    ] = None
    fired: Annotated[
        tuple[ToldPulses, ...] | None,
        Meta(description="what the source told since the last record; null: it does not tell of its pulses"),
    ] = None


#: The JSON schema of a health record.
HEALTH_SCHEMA: Final[dict[str, object]] = wire.schema(Health, HEALTH.schema)
