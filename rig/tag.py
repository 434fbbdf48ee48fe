"""The triplet tag: what became of one pulse in every camera (`svev.TripletTag`).

The JSON form is a contract: 64-bit integers are strings, so that JavaScript reads them whole.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rig.clocks import DeviceNs, UtcNs
from rig.frame import FrameStatus

TAG_SCHEMA_NAME = "svev.TripletTag"

_INT64_TEXT = {"type": "string", "pattern": "^-?[0-9]+$"}

TAG_SCHEMA: dict[str, Any] = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "title": TAG_SCHEMA_NAME,
    "description": "What became of one trigger pulse in every camera; one per pulse, also where no frame came.",
    "type": "object",
    "required": ["pulse", "time_ns", "complete", "session", "recording", "shape", "dtype", "cameras"],
    "properties": {
        "pulse": {"type": "integer", "minimum": 1, "description": "number of the trigger pulse in this recording"},
        "time_ns": {**_INT64_TEXT, "description": "time of the pulse, UTC, ns"},
        "complete": {"type": "boolean", "description": "every camera delivered its frame"},
        "session": {"type": "string"},
        "recording": {"type": "string"},
        "shape": {"type": "array", "items": {"type": "integer"}, "minItems": 2, "maxItems": 2,
                  "description": "rows, columns of the triplet"},
        "dtype": {"type": "string"},
        "cameras": {
            "type": "array",
            "items": {
                "type": "object",
                "required": ["name", "columns", "status", "frame_id", "trigger_count", "device_time_ns",
                             "host_time_ns", "offset_us"],
                "properties": {
                    "name": {"type": "string"},
                    "columns": {"type": "array", "items": {"type": "integer"}, "minItems": 2, "maxItems": 2},
                    "status": {"enum": [s.value for s in FrameStatus]},
                    "frame_id": {"type": ["integer", "null"]},
                    "trigger_count": {"type": ["integer", "null"]},
                    "device_time_ns": {"oneOf": [_INT64_TEXT, {"type": "null"}]},
                    "host_time_ns": {"oneOf": [_INT64_TEXT, {"type": "null"}],
                                     "description": "UTC time at which the frame was in the host's memory, ns"},
                    "offset_us": {"type": ["number", "null"],
                                  "description": "trigger time of this frame minus the pulse's, common time line, us"},
                    "stamped_pixels": {"type": "array", "items": {"type": "integer"}, "minItems": 3, "maxItems": 3,
                                       "description": "pixels that are a signature of the camera, no picture: row and "
                                                      "first column in the triplet, count; left out if there are none"},
                },
            },
        },
    },
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class CameraTag:
    """One camera's part of a tag; ids and times are None unless `status` is ok.

    Attributes:
        columns: first column and one past the last column of the camera's block in the triplet.
        host_time: UTC at which the frame stood in the host's memory.
        offset_us: the frame's trigger time on the common time line minus the pulse's.
        stamped: row and first column in the triplet, and number, of pixels that are no picture but a signature.
    """

    name: str
    columns: tuple[int, int]
    status: FrameStatus
    frame_id: int | None = None
    trigger_count: int | None = None
    device_time: DeviceNs | None = None
    host_time: UtcNs | None = None
    offset_us: float | None = None
    stamped: tuple[int, int, int] | None = None

    def to_json(self) -> dict[str, Any]:
        """The contract's form."""
        entry = {
            "name": self.name,
            "columns": list(self.columns),
            "status": self.status.value,
            "frame_id": self.frame_id,
            "trigger_count": self.trigger_count,
            "device_time_ns": None if self.device_time is None else str(self.device_time),
            "host_time_ns": None if self.host_time is None else str(self.host_time),
            "offset_us": None if self.offset_us is None else round(self.offset_us, 3),
        }
        return entry if self.stamped is None else entry | {"stamped_pixels": list(self.stamped)}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "CameraTag":
        """Read the contract's form.

        Raises:
            KeyError, ValueError, TypeError: the data is not a tag.
        """
        first, end = data["columns"]
        device, host = data["device_time_ns"], data["host_time_ns"]
        stamped = data.get("stamped_pixels")
        return cls(
            data["name"],
            (int(first), int(end)),
            FrameStatus(data["status"]),
            data["frame_id"],
            data["trigger_count"],
            None if device is None else DeviceNs(int(device)),
            None if host is None else UtcNs(int(host)),
            data["offset_us"],
            None if stamped is None else (int(stamped[0]), int(stamped[1]), int(stamped[2])),
        )


@dataclass(frozen=True, slots=True)
class TripletTag:
    """What became of pulse number `pulse` in every camera.

    Attributes:
        pulse: number of the trigger pulse, counted from 1 in each recording.
        time: time of the pulse, UTC.
        shape: rows and columns of the whole triplet.
    """

    pulse: int
    time: UtcNs
    session: str
    recording: str
    shape: tuple[int, int]
    cameras: tuple[CameraTag, ...]

    @property
    def complete(self) -> bool:
        """Whether every camera delivered its frame."""
        return all(camera.status is FrameStatus.OK for camera in self.cameras)

    def to_json(self) -> dict[str, Any]:
        """The contract's form."""
        return {
            "pulse": self.pulse,
            "time_ns": str(self.time),
            "complete": self.complete,
            "session": self.session,
            "recording": self.recording,
            "shape": list(self.shape),
            "dtype": "uint8",
            "cameras": [camera.to_json() for camera in self.cameras],
        }

    def encode(self) -> bytes:
        """The contract's form as UTF-8 JSON."""
        return json.dumps(self.to_json(), separators=(",", ":")).encode()

    @classmethod
    def decode(cls, text: bytes | memoryview) -> "TripletTag":
        """Read what `encode` wrote.

        Raises:
            ValueError, KeyError, TypeError: the bytes are not a tag.
        """
        data = json.loads(bytes(text))
        rows, columns = data["shape"]
        return cls(
            int(data["pulse"]),
            UtcNs(int(data["time_ns"])),
            data["session"],
            data["recording"],
            (int(rows), int(columns)),
            tuple(CameraTag.from_json(camera) for camera in data["cameras"]),
        )
