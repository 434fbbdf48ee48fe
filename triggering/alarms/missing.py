"""Finds the cameras that begin to miss pulses, and the likely cause.

Page's test (Biometrika 41, 1954): every frame that came or failed adds the logarithm of how much likelier it is in a
failing camera than in a sound one, and the sum never falls below zero. If it exceeds `ln T`, the camera fails; a good
camera exceeds it once in `T` pulses at most (Lorden, Ann. Math. Stat. 42, 1971). The alarm ends by the same test the
other way round. So a camera that loses every second frame causes an alarm after 16 pulses, one that loses 2 % after
some hundred, and no number of clean pulses does.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from math import log
from typing import Final

from rig.events import COMPUTER, TRIGGER, Level
from rig.health import Health
from rig.phrase import Phrase, phrase
from triggering.alarms.alarm import Alarm

#: Share of frames that fail in a good camera, and in one that is to cause an alarm.
_GOOD: Final = 0.001
_BAD: Final = 0.02
#: A false alarm of some camera in a thousand half hours of 8 cameras at 200 Hz, at most.
_PULSES: Final = 1000 * 30 * 60 * 200 * 8
_LIMIT: Final = log(_PULSES)
_FAILED: Final = log(_BAD / _GOOD)
_CAME: Final = log((1 - _BAD) / (1 - _GOOD))
#: With a longer exposure than this share of the period there is hardly time to read a frame out.
_LONG_EXPOSURE: Final = 0.8
#: The figures of an alarm are of so many records, about as many seconds.
_RECORDS: Final = 10

#: Counts of a camera's pairing and of its grabber that tell of causes.
_PAIRED: Final = ("ok", "missed", "lost", "damaged", "late", "overruns", "silences")
_FETCHED: Final = ("missing_packets", "underruns", "queue_overflows", "reconnects")


class Cause(Enum):
    """Why cameras miss pulses."""

    COMPUTER = "computer"
    BANDWIDTH = "bandwidth"
    ALIKE = "missed alike"
    EXPOSURE = "exposure"
    MISSED = "missed"
    SLOW_LINK = "slow link"
    LINK = "link"


#: Causes that cameras share: one alarm names all of them.
_SHARED: Final = frozenset({Cause.COMPUTER, Cause.BANDWIDTH, Cause.ALIKE})
#: What looked like a camera's own trouble, until others had it too.
_OWN: Final = {Cause.LINK: Cause.BANDWIDTH, Cause.SLOW_LINK: Cause.BANDWIDTH, Cause.MISSED: Cause.ALIKE}


@dataclass(slots=True)
class _Camera:
    """The test of one camera.

    Attributes:
        counts: of the last record.
        lately: what the last records counted, since the sum was zero.
        against: sum for a camera that fails.
        for_it: sum for one that does not, while there is an alarm.
        cause: why it fails; None: it does not.
    """

    counts: dict[str, int] | None = None
    lately: deque[dict[str, int]] = field(default_factory=lambda: deque(maxlen=_RECORDS))
    against: float = 0.0
    for_it: float = 0.0
    cause: Cause | None = None

    def counted(self, *names: str) -> int:
        """How often any of these was counted lately."""
        return sum(record[name] for record in self.lately for name in names)


class Missing:
    """Judges all cameras.

    Args:
        names: of the cameras.
        exposures_us: their exposures.
    """

    def __init__(self, names: Sequence[str], exposures_us: Sequence[float]) -> None:
        self._names, self._exposures_us = names, exposures_us
        self._cameras = [_Camera() for _ in names]

    def look(self, health: Health, overloaded: Sequence[int]) -> list[Alarm]:
        """Enter a record.

        Args:
            health: the record.
            overloaded: indices of the cameras that suffer from a computer that is too slow.

        Returns:
            An alarm for each cause of missed pulses, with figures of the last records; its topic stays the same.
        """
        for camera in range(len(self._cameras)):
            self._enter(camera, health)
        for camera, test in enumerate(self._cameras):
            if test.cause is None and test.against > _LIMIT:
                test.cause, test.for_it = self._cause(camera, health, overloaded), 0.0
            elif test.cause is not None and self._starved(camera, overloaded):
                test.cause = Cause.COMPUTER  # not the cable
        causes = {test.cause for test in self._cameras}
        found: dict[str, list[int]] = {}
        for camera, test in enumerate(self._cameras):
            if test.cause is not None:
                shared = _OWN.get(test.cause)
                test.cause = shared if shared in causes and shared is not None else test.cause
                topic = test.cause.value if test.cause in _SHARED else f"camera {self._names[camera]}"
                found.setdefault(topic, []).append(camera)
        return [Alarm(topic, Level.ERROR, self._about(cameras), self._say(cameras)) for topic, cameras in found.items()]

    def _about(self, cameras: list[int]) -> str:
        """Which part the events of an alarm are about."""
        if self._cameras[cameras[0]].cause is Cause.COMPUTER:
            return COMPUTER
        return self._names[cameras[0]] if len(cameras) == 1 else TRIGGER

    def _enter(self, camera: int, health: Health) -> None:
        test, paired, fetched = self._cameras[camera], health.pairing.cameras[camera], health.cameras[camera]
        if not paired.connected or paired.silent or not paired.clock_known:
            test.counts = None  # a silent or disconnected camera has an alarm of its own
            return
        counts = {name: getattr(paired, name) for name in _PAIRED} | {name: getattr(fetched, name) for name in _FETCHED}
        before, test.counts = test.counts, counts
        if before is None:
            return
        new = {name: counts[name] - before[name] for name in counts}
        if new["silences"] or new["reconnects"] or min(new.values()) < 0:
            return
        failed = new["missed"] + new["lost"] + new["damaged"]
        evidence = failed * _FAILED + new["ok"] * _CAME
        test.against = max(0.0, test.against + evidence)
        test.lately.append(new)
        if test.cause is not None:
            test.for_it = max(0.0, test.for_it - evidence)
            if test.for_it > _LIMIT:
                test.cause, test.against = None, 0.0
        if not test.against:
            test.lately.clear()

    def _starved(self, camera: int, overloaded: Sequence[int]) -> bool:
        """Whether this computer did not fetch the frames of a camera in time."""
        return camera in overloaded or self._cameras[camera].counted("underruns", "queue_overflows") > 0

    def _cause(self, camera: int, health: Health, overloaded: Sequence[int]) -> Cause:
        test = self._cameras[camera]
        missed, lost = test.counted("missed"), test.counted("lost", "damaged")
        others = any(other.against > _LIMIT / 2 for index, other in enumerate(self._cameras) if index != camera)
        if self._starved(camera, overloaded):
            return Cause.COMPUTER
        if missed >= lost:  # the camera did not take the frames: it was busy, or did not see the pulses
            busy = 2 * test.counted("overruns") >= missed
            if busy or self._exposures_us[camera] > _LONG_EXPOSURE * health.pairing.period_us:
                return Cause.EXPOSURE
            return Cause.ALIKE if others else Cause.MISSED
        if others:
            return Cause.BANDWIDTH
        return Cause.SLOW_LINK if test.counted("late") > (missed + lost) / 2 else Cause.LINK

    def _say(self, cameras: list[int]) -> Phrase:
        """The fault of cameras of one cause, in words."""
        tests = [self._cameras[camera] for camera in cameras]
        names = ", ".join(self._names[camera] for camera in cameras)
        failed = sum(test.counted("missed", "lost", "damaged") for test in tests)
        pulses = failed + sum(test.counted("ok") for test in tests)
        cause = tests[0].cause
        if cause in {Cause.ALIKE, Cause.EXPOSURE, Cause.MISSED}:
            return _missed(cause, names, failed, pulses)
        return _lost(cause, names, failed, pulses)


def _missed(cause: Cause | None, camera: str, failed: int, pulses: int) -> Phrase:
    """Cameras did not take the frames."""
    if cause is Cause.ALIKE:
        text = "{camera} miss pulses, {failed} of {pulses}: check what makes the pulses, and the cable that they share"
        return phrase("alarm_missed_alike", text, camera=camera, failed=failed, pulses=pulses)
    if cause is Cause.EXPOSURE:
        text = (
            "{camera} cannot follow the pulses, {failed} of {pulses} missed: make its exposure shorter, or lower "
            "trigger.rate_hz"
        )
        return phrase("alarm_exposure", text, camera=camera, failed=failed, pulses=pulses)
    text = "{camera} misses pulses, {failed} of {pulses}: check its trigger cable and the plug"
    return phrase("alarm_missed", text, camera=camera, failed=failed, pulses=pulses)


def _lost(cause: Cause | None, camera: str, failed: int, pulses: int) -> Phrase:
    """Cameras took the frames, which did not arrive."""
    if cause is Cause.COMPUTER:
        text = (
            "frames of {camera} get lost, {failed} of {pulses}, since this computer is too slow: close other programs "
            "on it, or lower trigger.rate_hz"
        )
        return phrase("alarm_computer", text, camera=camera, failed=failed, pulses=pulses)
    if cause is Cause.BANDWIDTH:
        text = (
            "frames of {camera} get lost, {failed} of {pulses}, since the link that they share is too slow or bad: "
            "check its cable and switch, lower trigger.rate_hz or make regions smaller"
        )
        return phrase("alarm_bandwidth", text, camera=camera, failed=failed, pulses=pulses)
    if cause is Cause.SLOW_LINK:
        text = (
            "frames of {camera} come too late, {failed} of {pulses}, since its link is too slow: look for a port of "
            "lower speed, or make its region smaller"
        )
        return phrase("alarm_slow_link", text, camera=camera, failed=failed, pulses=pulses)
    text = (
        "frames of {camera} get lost on their way, {failed} of {pulses}: check the cable and the plug that they come "
        "by, and the port of the switch"
    )
    return phrase("alarm_link", text, camera=camera, failed=failed, pulses=pulses)
