"""The JSON schema of a health record (`svev.Health`)."""

from typing import Any

from recorder.latency import BUCKETS_S
from rig.topics import HEALTH


def _object(description: str, properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "object", "description": description, "properties": properties}


def _number(description: str, *, whole: bool = False, nullable: bool = False) -> dict[str, Any]:
    kind = "integer" if whole else "number"
    return {"type": [kind, "null"] if nullable else kind, "description": description}


_CAMERA = _object(
    "one camera, left to right; counts are since its process was started",
    {
        "name": {"type": "string"},
        "connected": {"type": "boolean"},
        "frames_per_s": _number("whole frames of the last second", whole=True),
        "clock_offset_us": _number("trigger time minus the pulse's, median of the last 30 pulses", nullable=True),
        "temperature_c": _number("of the camera, null where it does not tell", nullable=True),
        "temperature_mdeg": _number("the same in thousandths of a degree, 0 where it does not tell", whole=True),
        "frames": _number("whole frames", whole=True),
        "damaged": _number("damaged frames", whole=True),
        "underruns": _number("frames that found no free slot in the ring", whole=True),
        "resent_packets": _number("packets that the camera sent again", whole=True),
        "missing_packets": _number("packets that never came", whole=True),
        "reconnects": _number("connections after the first", whole=True),
        "queue_overflows": _number("records that found their queue full", whole=True),
        "slots_queued": _number("slots of the ring that wait for the recorder", whole=True),
    },
)

_PAIRING = _object(
    "the pulses and the cameras' clocks",
    {
        "pulses": _number("decided since the recorder was started", whole=True),
        "proven_by_ids": _number("of them, no camera delivered so many, but their numbers prove them", whole=True),
        "open": _number("pulses that are not decided yet", whole=True),
        "period_us": _number("between pulses, tracked"),
        "spread_median_us": _number("of trigger times within a pulse"),
        "spread_max_us": _number("likewise, the largest of late"),
        "alarm": {"description": "whether the spread is larger than the pairing allows for"},
        "cameras": {"type": "array", "items": {"type": "object"}, "description": "clock and counters of each camera"},
    },
)

_PREROLL = _object(
    "triplets that are held in memory for a recording that begins in the past",
    {
        "seconds": _number("held at the moment"),
        "limit_s": _number("held at most"),
        "triplets": _number("held at the moment", whole=True),
        "memory_mb": _number("memory set aside for it, 10^6 bytes"),
    },
)

_LATENCY = _object(
    "from a triplet's last frame in memory until it is handed to disk and subscribers, since the recorder was started",
    {
        "buckets_s": {
            "type": "object",
            "description": f"triplets that took so many seconds at most: {', '.join(f'{b:g}' for b in BUCKETS_S)}",
            "additionalProperties": {"type": "integer"},
        },
        "sum_s": _number("sum of all times"),
        "count": _number("triplets", whole=True),
    },
)

_RECORDING = {
    **_object(
        "how writing goes, null without a recording",
        {
            "bytes_written": _number("so far", whole=True),
            "queued": _number("chunks that wait for the disk", whole=True),
            "slowest_write_ms": _number("since the log was opened"),
            "slowest_sync_ms": _number("since the log was opened"),
            "direct": {"type": "boolean", "description": "the file is written past the page cache"},
        },
    ),
    "type": ["object", "null"],
}

HEALTH_SCHEMA: dict[str, Any] = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "title": HEALTH.schema,
    **_object(
        "State of the recorder, about once a second: rates, queues, drops, clocks, temperature, disk.",
        {
            "cameras": {"type": "array", "items": _CAMERA},
            "pairing": _PAIRING,
            "free_triplets": _number("triplet buffers that nobody holds", whole=True),
            "unpublished": _number("triplets that were wanted and that no subscriber got", whole=True),
            "preroll": _PREROLL,
            "recording": _RECORDING,
            "disk": _object("the disk that recordings go to", {
                "free_bytes": _number("free, null while its directory is not there", whole=True, nullable=True),
            }),
            "latency": _LATENCY,
        },
    ),
}  # fmt: skip
