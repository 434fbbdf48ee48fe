"""The alarms of a running rig, from the health records: each begins once, and ends once.

What pulses and clocks say at one moment (`triggering.pairing.alarms`) becomes an alarm that lasts until pulses have
come for a while without it. Stopped pulses, a drift and cameras that miss pulses have tests with a memory of their own.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from rig.events import PAIRING, TRIGGER, Level
from rig.health import Health
from rig.settings.model import RigSettings
from triggering.alarms.alarm import Alarm
from triggering.alarms.missing import Cause, Missing
from triggering.alarms.train import Drift, Stopped, spread
from triggering.pairing.alarms import alarms
from triggering.sources.choice import trigger_source

#: What has been seen at one moment is over when so many pulses have come without it.
_CALM_PULSES: Final = 128
_STOPPED: Final = "stopped"
_RATE, _SPREAD = "rate", "spread"
#: What an overloaded computer gives as well: one cause is one alarm.
_FOLLOWING: Final = frozenset({_RATE, _SPREAD})
#: With a larger spread frames may be paired wrongly (`triggering.timeline.pulse_train`).
_WRONG: Final = "pairing_spread"
#: What an alarm is about, by the code of what is said; other codes are topics of their own.
_TOPICS: Final = {"pairing_rate": _RATE, "alarm_drift": _RATE, _WRONG: _SPREAD, "alarm_spread": _SPREAD}


def _is_doubtful(alarm: Alarm) -> bool:
    """Whether a computer that is too slow gives such a warning too; that frames may be paired wrongly counts anyhow."""
    return alarm.topic in _FOLLOWING and alarm.level is not Level.ERROR


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
        self._remembered = {_STOPPED}  # topics of tests with a memory of their own: what they say no more is over

    @property
    def present(self) -> list[Alarm]:
        """The alarms at present, the oldest first."""
        return [found.alarm for found in self._present.values()]

    def expect_pauses(self) -> None:
        """Note that pulses may have stopped on purpose since the last record: what was their rhythm is over."""
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
        """What is wrong by this record, the worse one of a topic first."""
        if self._stopped is not None and (said := self._stopped.look(health.pairing, now)) is not None:
            yield Alarm(_STOPPED, Level.ERROR, TRIGGER, said)
        for said in alarms(health.pairing, self._names, self._rate_hz, one_edge=self._one_edge):
            level = Level.ERROR if said.code == _WRONG else Level.WARNING
            topic = _TOPICS.get(said.code, f"{said.code} {said.values.get('camera', '')}")
            yield Alarm(topic, level, PAIRING, said)
        drifted = self._drift.look(health.pairing)
        if drifted is not None:
            yield Alarm(_RATE, Level.WARNING, TRIGGER, drifted)
        if self._one_edge and (apart := spread(health, self._names)) is not None:
            yield Alarm(_SPREAD, Level.WARNING, TRIGGER, apart)
        for topic, name, missed in self._missing.look(health, overloaded):
            self._remembered.add(topic)
            yield Alarm(topic, Level.ERROR, name, missed)
