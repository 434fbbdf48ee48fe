"""The alarms of a running rig, from the health records: each begins once, and ends once.

A fault that a single record shows (`momentary`) lasts until pulses have come for a while without it. Stopped pulses, a
drift and cameras that miss pulses have tests with a memory of their own.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from rig.events import Level
from rig.health import Health
from rig.settings.model import RigSettings
from triggering.alarms.alarm import RATE, SPREAD, STOPPED, Alarm
from triggering.alarms.missing import Cause, Missing
from triggering.alarms.momentary import momentary
from triggering.alarms.train import Drift, Stopped, spread
from triggering.sources.choice import trigger_source

#: A fault that a single record showed is over when so many pulses have come without it.
_CALM_PULSES: Final = 128
#: Frames that arrive late contradict their times, and a camera that needs no restart is not to be restarted.
_DOUBT: Final = "pairing_doubt"


def _is_doubtful(alarm: Alarm) -> bool:
    """Whether a slow computer causes such a warning too: one cause is one alarm. An error stays: frames may mix."""
    return (alarm.topic in {RATE, SPREAD} or alarm.said.code == _DOUBT) and alarm.level is not Level.ERROR


@dataclass(slots=True)
class _Present:
    alarm: Alarm
    pulses: int  # when it was seen last


class AlarmWatch:
    """Judges one health record after the other of one run of the recorder.

    Args:
        rig: the rig.

    Attributes:
        present: the alarms at present, the oldest first.
    """

    def __init__(self, rig: RigSettings) -> None:
        source = trigger_source(rig.trigger)
        self._names = [camera.name for camera in rig.cameras]
        self._rate_hz, self._one_edge = rig.trigger.rate_hz, not source.set_up_only
        self._commanded = source.set_up_only
        self._stopped = None if rig.trigger.pauses else Stopped(commanded=self._commanded)
        self._drift = Drift()
        self._missing = Missing(self._names, [camera.exposure_us for camera in rig.cameras])
        self._present: dict[str, _Present] = {}
        self._remembered = {STOPPED}  # topics of tests with a memory: without a new alarm the fault is over

    @property
    def present(self) -> list[Alarm]:
        """The alarms at present, the oldest first."""
        return [found.alarm for found in self._present.values()]

    def expect_pauses(self) -> None:
        """Note that pulses may have stopped on purpose since the last record: their rhythm is forgotten."""
        self._stopped = self._stopped and Stopped(commanded=self._commanded)

    def look(self, health: Health, overloaded: Sequence[int], now: float) -> tuple[list[Alarm], list[Alarm]]:
        """Enter a record.

        Args:
            health: the record.
            overloaded: indices of the cameras that suffer from a computer that is too slow.
            now: time of the record, s.

        Returns:
            The alarms that begin, or become worse; those that end.
        """
        found, ended = dict[str, Alarm](), self._remembered
        for alarm in self._judge(health, overloaded, now):
            found.setdefault(alarm.topic, alarm)
        if overloaded or Cause.COMPUTER.value in found:  # it reads clocks late, and loses what tells of rates
            found = {topic: alarm for topic, alarm in found.items() if not _is_doubtful(alarm)}
            ended = ended | {topic for topic, known in self._present.items() if _is_doubtful(known.alarm)}
        begun, pulses = [], health.pairing.seen
        for topic, alarm in found.items():
            known = self._present.get(topic)
            if known is None:
                self._present[topic] = _Present(alarm, pulses)
                begun.append(alarm)
                continue
            known.pulses = pulses
            if alarm.level is Level.ERROR and known.alarm.level is not Level.ERROR:
                begun.append(alarm)
            if alarm.level is known.alarm.level or alarm in begun:  # with the figures of now
                known.alarm = alarm
        over = [
            topic for topic, known in self._present.items()
            if topic not in found and (topic in ended or pulses >= known.pulses + _CALM_PULSES)
        ]  # fmt: skip
        return begun, [self._present.pop(topic).alarm for topic in over]

    def _judge(self, health: Health, overloaded: Sequence[int], now: float) -> Iterator[Alarm]:
        """The alarms of this record, the worse one of a topic first."""
        if self._stopped is not None and (stopped := self._stopped.look(health.pairing, now)) is not None:
            yield stopped
        yield from momentary(health.pairing, self._names, self._rate_hz, one_edge=self._one_edge)
        if (drifted := self._drift.look(health.pairing)) is not None:
            yield drifted
        if self._one_edge and (apart := spread(health, self._names)) is not None:
            yield apart
        for alarm in self._missing.look(health, overloaded):
            self._remembered.add(alarm.topic)
            yield alarm
