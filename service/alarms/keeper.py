"""Keeps the alarms of the running rig for the status, and tells of each when it begins and when it ends."""

import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from typing import Final

from rig.api.statement import Level, Statement
from rig.api.status import Alarm
from rig.errors import UnknownAlarmError
from rig.events import Event
from rig.events import Level as EventLevel
from rig.health import Health
from rig.phrase import Phrase, phrase
from rig.settings.model import RigSettings
from service.status.statements import not_measured, pairing_alarm
from triggering.alarms.watch import AlarmWatch

_LEVELS: Final = {EventLevel.WARNING: Level.WARNING, EventLevel.ERROR: Level.ERROR}
#: The alarm that jumps cannot be measured, which the analysis tells.
_MEASURING: Final = "measuring"
#: The alarm that a jump may not be recorded.
_UNRECORDED: Final = "unrecorded"


class AlarmKeeper:
    """Only one thread may use it.

    Args:
        rig: the rig.
        tell: takes an event for the live log and for the log of a recording.

    Attributes:
        present: the alarms at present, the worst first, those that somebody has seen last.
    """

    def __init__(self, rig: RigSettings, tell: Callable[[Event], None]) -> None:
        self._rig, self._tell = rig, tell
        self._watch: AlarmWatch | None = None
        self._numbers = 0
        self._known: dict[str, Alarm] = {}

    @property
    def present(self) -> tuple[Alarm, ...]:
        """The alarms at present, the worst first, and of these the latest; those that somebody has seen last."""

        def order(alarm: Alarm) -> tuple[bool, bool, int]:
            return alarm.acknowledged, alarm.statement.level is not Level.ERROR, -alarm.number

        return tuple(sorted(self._known.values(), key=order))

    def look(self, health: Health, overloaded: Sequence[int], *, still: bool = False) -> None:
        """Enter a health record.

        Args:
            health: the record.
            overloaded: indices of the cameras that suffer from a computer that is too slow.
            still: pulses come on request only, so that they stop is no alarm.
        """
        self._watch = self._watch or AlarmWatch(self._rig)
        if still:
            self._watch.expect_pauses()
        begun, over = self._watch.look(health, overloaded, time.monotonic())
        for alarm in begun:
            self._enter(alarm.topic, pairing_alarm(alarm.said, _LEVELS[alarm.level]))
            self._tell(Event.now(alarm.level, alarm.name, alarm.said))
        for alarm in over:
            del self._known[alarm.topic]
            self._tell(Event.now(EventLevel.INFO, alarm.name, alarm.over))
        for alarm in self._watch.present:
            self._renew(alarm.topic, pairing_alarm(alarm.said, _LEVELS[alarm.level]))

    def acknowledge(self, number: int) -> None:
        """Note that somebody has seen an alarm; it stays until it is over.

        Raises:
            UnknownAlarmError: it is over, or there never was one of this number.
        """
        for topic, alarm in self._known.items():
            if alarm.number == number:
                self._known[topic] = alarm.model_copy(update={"acknowledged": True})
                return
        raise UnknownAlarmError(
            phrase(
                "alarm_gone",
                "there is no alarm {number} any more: it is over, or has got worse and a new number",
                number=number,
            )
        )

    def measuring(self, refused: Phrase | None) -> None:
        """Enter whether jumps can be measured; that they cannot stays whatever becomes of the recorder.

        Args:
            refused: why not.
        """
        statement = None if refused is None else not_measured(refused)
        known = self._known.get(_MEASURING)
        if statement == (known and known.statement):
            return  # the process began anew
        self._known.pop(_MEASURING, None)
        if refused is not None and statement is not None:
            self._enter(_MEASURING, statement)
            text = "no jump is measured before this is put right: {why}"
            self._tell(Event.now(EventLevel.ERROR, "analysis", phrase("event_no_analysis", text, why=refused)))
        else:
            said = phrase("event_analysis_again", "what was wrong is put right: jumps are measured from now on")
            self._tell(Event.now(EventLevel.INFO, "analysis", said))

    def unrecorded(self, statement: Statement | None) -> None:
        """Enter which jump may not be recorded; None: none, or a recording has begun since."""
        known = self._known.get(_UNRECORDED)
        if statement == (known and known.statement):
            return
        self._known.pop(_UNRECORDED, None)
        if statement is not None:
            self._enter(_UNRECORDED, statement)
            self._tell(Event.now(EventLevel.WARNING, "service", statement.said))

    def use(self, rig: RigSettings) -> None:
        """Judge by other exposures or another rate from now on."""
        self._rig = rig
        self.forget()

    def forget(self) -> None:
        """Start anew: there is no recorder any more. That nobody watches any more does not end what was wrong."""
        self._watch = None
        self._known = {topic: alarm for topic, alarm in self._known.items() if topic in {_MEASURING, _UNRECORDED}}

    def end(self) -> None:
        """Forget everything: no process of the rig is left."""
        self._watch = None
        self._known.clear()

    def _renew(self, topic: str, statement: Statement) -> None:
        """Say an alarm with the figures of now."""
        if self._known[topic].statement != statement:
            self._known[topic] = self._known[topic].model_copy(update={"statement": statement})

    def _enter(self, topic: str, statement: Statement) -> None:
        self._numbers += 1
        self._known[topic] = Alarm(number=self._numbers, topic=topic, since=datetime.now(UTC), statement=statement)
