"""Events (arm, start, stop, fault, camera connected, ...): one form for the log, ZeroMQ and people."""

import time
from enum import StrEnum
from typing import Final

import msgspec
from foxglove_schemas_protobuf.Log_pb2 import Log

from rig.clocks import UtcNs
from rig.phrase import Phrase, Value

#: Name of events that say what is wrong with clocks, trigger or rate.
PAIRING: Final = "pairing"
#: Name of events that say whether the computer is fast enough.
COMPUTER: Final = "computer"
#: Name of events that say what the source of the pulses is good for.
TRIGGER: Final = "trigger"


class Level(StrEnum):
    """Severity of an event, in the words of `foxglove.Log`."""

    DEBUG = "debug"
    INFO = "info"
    WARNING = "warning"
    ERROR = "error"
    FATAL = "fatal"


class Event(msgspec.Struct, frozen=True, omit_defaults=True, rename={"time": "time_ns"}):
    """Something that happened to the rig or a recording.

    Attributes:
        time: when it happened, UTC.
        level: severity.
        name: which part it is about, e.g. "recorder" or "K2".
        message: one line for people, in English.
        code: stable name of the message, by which the panel translates it; empty: it is said in English only.
        values: names and numbers in the message, for translation.
    """

    time: UtcNs
    level: Level
    name: str
    message: str
    code: str = ""
    values: dict[str, Value] = {}

    @classmethod
    def now(cls, level: Level, name: str, said: Phrase) -> "Event":
        """An event of the present moment."""
        return cls.at(UtcNs(time.time_ns()), level, name, said)

    @classmethod
    def at(cls, moment: UtcNs, level: Level, name: str, said: Phrase) -> "Event":
        """An event of another moment."""
        return cls(moment, level, name, said.text, said.code, said.values)

    def to_protobuf(self) -> bytes:
        """The event as it stands in the log: a serialized `foxglove.Log`."""
        log = Log(level=Log.Level.Value(self.level.name), name=self.name, message=self.message)
        log.timestamp.FromNanoseconds(self.time)
        data: bytes = log.SerializeToString()
        return data

    @classmethod
    def from_protobuf(cls, data: bytes | memoryview) -> "Event":
        """Read what `to_protobuf` wrote. Codes and values are not in the log.

        Raises:
            google.protobuf.message.DecodeError, ValueError, KeyError: the data is not an event.
        """
        log = Log.FromString(bytes(data))
        return cls(UtcNs(log.timestamp.ToNanoseconds()), Level[Log.Level.Name(log.level)], log.name, log.message)
