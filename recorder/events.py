"""Events of a recording: arm, start, stop, fault, recovery; in the log, on ZeroMQ and for people."""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from foxglove_schemas_protobuf.Log_pb2 import Log

from rig.clocks import UtcNs


class Level(StrEnum):
    """How much an event matters, in the words of `foxglove.Log`."""

    DEBUG = "debug"
    INFO = "info"
    WARNING = "warning"
    ERROR = "error"
    FATAL = "fatal"


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened to the recording.

    Attributes:
        time: when, UTC.
        name: who or what it is about, e.g. "recorder" or "K2".
        message: one line for people.
    """

    time: UtcNs
    level: Level
    name: str
    message: str

    @classmethod
    def now(cls, level: Level, name: str, message: str) -> "Event":
        """Something that happens now."""
        return cls(UtcNs(time.time_ns()), level, name, message)

    def to_json(self) -> dict[str, Any]:
        """The form of the ZeroMQ message; the 64-bit time is a string."""
        return {
            "time_ns": str(self.time),
            "level": self.level.value,
            "name": self.name,
            "message": self.message,
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "Event":
        """Read what `to_json` wrote.

        Raises:
            KeyError, ValueError: the data is no event.
        """
        return cls(UtcNs(int(data["time_ns"])), Level(data["level"]), data["name"], data["message"])

    def to_protobuf(self) -> bytes:
        """The form of the log, a serialized `foxglove.Log`."""
        log = Log(level=Log.Level.Value(self.level.name), name=self.name, message=self.message)
        log.timestamp.FromNanoseconds(self.time)
        data: bytes = log.SerializeToString()
        return data

    @classmethod
    def from_protobuf(cls, data: bytes | memoryview) -> "Event":
        """Read what `to_protobuf` wrote.

        Raises:
            google.protobuf.message.DecodeError, ValueError, KeyError: the data is no event.
        """
        log = Log.FromString(bytes(data))
        return cls(UtcNs(log.timestamp.ToNanoseconds()), Level[Log.Level.Name(log.level)], log.name, log.message)
