"""Watches the train of pulses: does it stop, does its rate drift, do the cameras' times within a pulse move apart?

All is measured in pulses, not in seconds, because a rig may have one pulse in a second or 200.
"""

from collections.abc import Sequence
from statistics import median
from typing import Final

from rig.events import TRIGGER, Level
from rig.health import Health, PairingHealth
from rig.phrase import phrase
from triggering.alarms.alarm import RATE, SPREAD, STOPPED, Alarm

#: Pulses that came in a rhythm may stop only after so many: a hand does not keep one for so long.
_RHYTHM_PULSES: Final = 64
#: They have stopped when so many are overdue, and are back when so many have come.
_OVERDUE: Final = 10
#: Two records in a row have to lack pulses: a record may come a moment before the pulses that it should count.
_EMPTY_RECORDS: Final = 2
#: The rate is known after so many pulses and records; what it is then is its history.
_KNOWN_PULSES: Final = 256
_KNOWN_RECORDS: Final = 5
#: A rate that leaves its history by this share has drifted: half of what contradicts the rig file. Quartz generators
#: keep 0.0001, so this is a hand at a knob, or a generator that fails.
_DRIFT: Final = 0.01
#: Where the rate scatters, so many times its scatter instead (normal errors: one record in 1.7 million).
_SIGMAS: Final = 5.0
#: Median deviation from the median to standard deviation, of normal errors.
_MAD: Final = 1.4826
#: What has drifted is back when it is within this share of the limit.
_BACK: Final = 0.5
#: A spread of this share of the period is a warning: nothing that one edge exposes lies so far apart.
_SPREAD_SHARE: Final = 0.05
#: So many pulses are needed to judge the spread.
_SPREAD_PULSES: Final = 24


class Stopped:
    """Notices when pulses stop that came in a rhythm.

    Args:
        commanded: this computer commands each camera; there is no cable that may be cut.
    """

    def __init__(self, *, commanded: bool) -> None:
        self._commanded = commanded
        self._seen = self._in_rhythm = self._again = self._empty = 0
        self._rate_hz: float | None = None
        self._since = 0.0
        self._present: Alarm | None = None

    def look(self, pairing: PairingHealth, now: float) -> Alarm | None:
        """Enter a record.

        Args:
            pairing: the record.
            now: its time, s.

        Returns:
            The alarm that they have stopped, until they are back; None: they have not.
        """
        new, self._seen = pairing.seen - self._seen, pairing.seen
        if new > 0:
            self._since, self._empty = now, 0
            self._rate_hz = pairing.rate_hz
            self._in_rhythm = 0 if pairing.rate_hz is None else self._in_rhythm + new
            self._again += new
            if self._again >= _OVERDUE:
                self._present = None
            return self._present
        self._empty += 1
        watched = any(camera.connected for camera in pairing.cameras)
        if self._present is None and watched and self._rate_hz is not None and self._in_rhythm >= _RHYTHM_PULSES:
            overdue = (now - self._since) * self._rate_hz
            if overdue >= _OVERDUE and self._empty >= _EMPTY_RECORDS:
                self._present, self._again = self._stopped(self._rate_hz), 0
        return self._present

    def _stopped(self, rate_hz: float) -> Alarm:
        text = (
            "the pulses have stopped (there were {rate_hz} a second): see whether what makes them runs, then check "
            "the cable from it to the cameras"
        )
        said = phrase("alarm_stopped", text, rate_hz=round(rate_hz, 1))
        if self._commanded:
            text = "no camera answers the commands to expose any more ({rate_hz} a second): disarm, and arm again"
            said = phrase("alarm_stopped_commands", text, rate_hz=round(rate_hz, 1))
        return Alarm(STOPPED, Level.ERROR, TRIGGER, said)


class Drift:
    """Finds that the rate leaves its own history."""

    def __init__(self) -> None:
        self._seen = 0
        self._pulses = 0
        self._rates: list[float] = []
        self._usual_hz: float | None = None
        self._limit = _DRIFT
        self._present: Alarm | None = None

    def look(self, pairing: PairingHealth) -> Alarm | None:
        """Enter a record; gives the alarm that the rate has drifted, until it is back."""
        new, self._seen = pairing.seen - self._seen, pairing.seen
        rate = pairing.rate_hz
        if rate is None or new <= 0:
            return self._present
        if self._usual_hz is None:
            self._learn(rate, new)
            return None
        off = abs(rate / self._usual_hz - 1)
        if off > self._limit and self._present is None:
            text = (
                "the pulses' rate has changed from {before_hz} to {rate_hz} Hz: check what makes them; if it is meant "
                "so, disarm and arm"
            )
            said = phrase("alarm_drift", text, before_hz=round(self._usual_hz, 2), rate_hz=round(rate, 2))
            self._present = Alarm(RATE, Level.WARNING, TRIGGER, said)
        elif off < _BACK * self._limit:
            self._present = None
        return self._present

    def _learn(self, rate: float, new: int) -> None:
        self._rates.append(rate)
        self._pulses += new
        if self._pulses < _KNOWN_PULSES or len(self._rates) < _KNOWN_RECORDS:
            return
        self._usual_hz = usual = median(self._rates)
        scatter = _MAD * median([abs(known - usual) for known in self._rates])
        self._limit = max(_DRIFT, _SIGMAS * scatter / usual)
        self._rates.clear()


def spread(health: Health, names: Sequence[str]) -> Alarm | None:
    """The alarm that the cameras' times within a pulse lie farther apart than edge and clocks explain.

    Args:
        health: the record.
        names: of the cameras.
    """
    pairing = health.pairing
    if pairing.seen < _SPREAD_PULSES:
        return None
    clocks = sorted(camera.clock_uncertainty_us or 0.0 for camera in pairing.cameras)
    limit_us = max(_SPREAD_SHARE * pairing.period_us, sum(clocks[-2:]))
    if pairing.spread_usual_us <= limit_us:
        return None
    share = round(100 * pairing.spread_usual_us / pairing.period_us)
    offsets = [abs(camera.clock_offset_us or 0.0) for camera in health.cameras]
    # Of two cameras either may be off.
    camera = names[offsets.index(max(offsets))] if len(names) > 2 else ", ".join(names)
    text = (
        "the frames of one pulse lie {spread_ms} ms apart, {share} % of the period, {camera} farthest off: check its "
        "trigger delay, its trigger edge and its cable"
    )
    spread_ms = round(pairing.spread_usual_us / 1000, 2)
    said = phrase("alarm_spread", text, spread_ms=spread_ms, share=share, camera=camera)
    return Alarm(SPREAD, Level.WARNING, TRIGGER, said)
