"""Events (arm, start, stop, fault, camera connected, ...): one form for the log, ZeroMQ and people."""

import time
from enum import StrEnum

import msgspec
from foxglove_schemas_protobuf.Log_pb2 import Log

from rig.clocks import UtcNs


class Level(StrEnum):
    """Severity of an event, in the words of `foxglove.Log`."""

    DEBUG = "debug"
    INFO = "info"
    WARNING = "warning"
    ERROR = "error"
    FATAL = "fatal"


class Event(msgspec.Struct, frozen=True, rename={"time": "time_ns"}):
    """Something that happened to the rig or a recording.

    Attributes:
        time: when it happened, UTC.
        level: severity.
        name: which part it is about, e.g. "recorder" or "K2".
        message: one line for people.
    """

    time: UtcNs
    level: Level
    name: str
    message: str

    @classmethod
    def now(cls, level: Level, name: str, message: str) -> "Event":
        """An event of the present moment."""
        return cls(UtcNs(time.time_ns()), level, name, message)

    def to_protobuf(self) -> bytes:
        """The event as it stands in the log: a serialized `foxglove.Log`."""
        log = Log(level=Log.Level.Value(self.level.name), name=self.name, message=self.message)
        log.timestamp.FromNanoseconds(self.time)
        data: bytes = log.SerializeToString()
        return data

    @classmethod
    def from_protobuf(cls, data: bytes | memoryview) -> "Event":
        """Read what `to_protobuf` wrote.

        Raises:
            google.protobuf.message.DecodeError, ValueError, KeyError: the data is not an event.
        """
        log = Log.FromString(bytes(data))
        return cls(UtcNs(log.timestamp.ToNanoseconds()), Level[Log.Level.Name(log.level)], log.name, log.message)
