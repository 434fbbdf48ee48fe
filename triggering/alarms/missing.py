"""Finds the cameras that begin to miss pulses, and the likely cause.

Page's test (Biometrika 41, 1954): every frame that came or failed adds the logarithm of how much likelier it is in a
camera that fails than in one that does not, and the sum never falls below zero. If it exceeds `ln T`, the camera fails;
a good camera exceeds it once in `T` pulses at most (Lorden, Ann. Math. Stat. 42, 1971). The alarm ends by the same test
the other way round. So a camera that loses every second frame is told of after 16 pulses, one that loses 2 % after
some hundred, and no number of clean pulses gives an alarm.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import log
from typing import Final

from rig.health import Health
from rig.phrase import Phrase, phrase

#: Of a good camera one frame in a thousand may fail; one of which every fiftieth fails is to be told of.
_GOOD: Final = 0.001
_BAD: Final = 0.02
#: A false alarm of some camera in a thousand half hours of 8 cameras at 200 Hz, at most.
_PULSES: Final = 1000 * 30 * 60 * 200 * 8
_LIMIT: Final = log(_PULSES)
_FAILED: Final = log(_BAD / _GOOD)
_CAME: Final = log((1 - _BAD) / (1 - _GOOD))
#: With a longer exposure than this share of the period there is hardly time to read a frame out.
_LONG_EXPOSURE: Final = 0.8

#: Counts of a camera's pairing and of its grabber that tell of causes.
_PAIRED: Final = ("ok", "missed", "lost", "damaged", "late", "overruns", "silences")
_FETCHED: Final = ("missing_packets", "underruns", "queue_overflows", "reconnects")


@dataclass(slots=True)
class _Camera:
    """The test of one camera.

    Attributes:
        counts: of the last record.
        evidence: what was counted since the sum was last zero.
        against: sum for a camera that fails.
        for_it: sum for one that does not, while there is an alarm.
        said: the alarm.
    """

    counts: dict[str, int] | None
    evidence: dict[str, int]
    against: float = 0.0
    for_it: float = 0.0
    said: Phrase | None = None


class Missing:
    """Judges all cameras.

    Args:
        names: of the cameras.
        exposures_us: their exposures.
    """

    def __init__(self, names: Sequence[str], exposures_us: Sequence[float]) -> None:
        self._names, self._exposures_us = names, exposures_us
        self._cameras = [_Camera(None, {}) for _ in names]

    def look(self, health: Health, overloaded: Sequence[int]) -> list[Phrase | None]:
        """Enter a record.

        Args:
            health: the record.
            overloaded: indices of the cameras that suffer from a computer that is too slow.

        Returns:
            For each camera, that it fails and why, until it is good again; None: it is good.
        """
        for camera in range(len(self._cameras)):
            self._enter(camera, health)
        for camera, test in enumerate(self._cameras):
            if test.said is None and test.against > _LIMIT:
                test.said, test.for_it = self._say(camera, health, overloaded), 0.0
        return [test.said for test in self._cameras]

    def _enter(self, camera: int, health: Health) -> None:
        test, paired, fetched = self._cameras[camera], health.pairing.cameras[camera], health.cameras[camera]
        if not paired.connected or paired.silent or not paired.clock_known:
            test.counts = None  # it is told of as a camera that is silent or away
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
        test.evidence = {name: test.evidence.get(name, 0) + new[name] for name in new} if test.against else {}
        if test.said is not None:
            test.for_it = max(0.0, test.for_it - evidence)
            if test.for_it > _LIMIT:
                test.said, test.against, test.evidence = None, 0.0, {}

    def _say(self, camera: int, health: Health, overloaded: Sequence[int]) -> Phrase:
        evidence, name = self._cameras[camera].evidence, self._names[camera]
        failed = evidence["missed"] + evidence["lost"] + evidence["damaged"]
        pulses = failed + evidence["ok"]
        others = [
            other for index, other in enumerate(self._names)
            if index != camera and self._cameras[index].against > _LIMIT / 2
        ]  # fmt: skip
        if camera in overloaded or evidence["underruns"] or evidence["queue_overflows"]:
            text = (
                "frames of {camera} get lost, {failed} of {pulses}, since this computer is too slow: close other "
                "programs on it, or lower trigger.rate_hz"
            )
            return phrase("alarm_computer", text, camera=name, failed=failed, pulses=pulses)
        if evidence["missed"] >= evidence["lost"] + evidence["damaged"]:
            return self._missed(camera, health.pairing.period_us, failed, pulses, others)
        if others:
            text = (
                "frames of {camera} get lost, {failed} of {pulses}, like those of {others}, since the link that they "
                "share is too slow or bad: check its cable and switch, lower trigger.rate_hz or make regions smaller"
            )
            return phrase("alarm_bandwidth", text, camera=name, failed=failed, pulses=pulses, others=", ".join(others))
        if evidence["late"] > failed / 2:
            text = (
                "frames of {camera} come too late, {failed} of {pulses}, since its link is too slow: look for a port "
                "of lower speed, or make its region smaller"
            )
            return phrase("alarm_slow_link", text, camera=name, failed=failed, pulses=pulses)
        text = (
            "frames of {camera} get lost on their way, {failed} of {pulses}: check the cable and the plug that they "
            "come by, and the port of the switch"
        )
        return phrase("alarm_link", text, camera=name, failed=failed, pulses=pulses)

    def _missed(self, camera: int, period_us: float, failed: int, pulses: int, others: list[str]) -> Phrase:
        """The camera did not take the frames: it was busy, or did not see the pulses."""
        name, evidence = self._names[camera], self._cameras[camera].evidence
        busy = 2 * evidence["overruns"] >= evidence["missed"]
        if busy or self._exposures_us[camera] > _LONG_EXPOSURE * period_us:
            text = (
                "{camera} cannot follow the pulses, {failed} of {pulses} missed: make its exposure shorter, or lower "
                "trigger.rate_hz"
            )
            return phrase("alarm_exposure", text, camera=name, failed=failed, pulses=pulses)
        if others:
            text = (
                "{camera} misses pulses, {failed} of {pulses}, like {others}: check what makes the pulses, and the "
                "cable that they share"
            )
            return phrase(
                "alarm_missed_alike", text, camera=name, failed=failed, pulses=pulses, others=", ".join(others)
            )
        text = "{camera} misses pulses, {failed} of {pulses}: check its trigger cable and the plug"
        return phrase("alarm_missed", text, camera=name, failed=failed, pulses=pulses)
