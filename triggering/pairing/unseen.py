"""Finds the pulses of which no camera delivered a frame.

The source may report that it fired them (`triggering.timeline.fired`), or the frame ids may prove it (`undelivered`).
Pulses that were due while no camera was there, and no source reports its pulses, follow from the rhythm: the train goes
on in its last rhythm. This holds only from its last pulse to the next one that a camera sees, and only if the train was
running when the last camera left: a camera that answered, but took no frame, shows that it had paused.
"""

from collections.abc import Sequence
from typing import Final

from rig.clocks import NS_PER_S, HostNs
from triggering.pairing.camera.track import CameraTrack
from triggering.pairing.deadlines import Deadlines
from triggering.pairing.held import HeldFrames
from triggering.pairing.outcomes import OpenPulse
from triggering.pairing.undelivered import undelivered_times
from triggering.timeline.fired import FiredPulses
from triggering.timeline.pulse_train import PulseTrain

#: A pulse that nobody saw waits so long for readings of the cameras' clocks, four times a second, after it.
_ANSWER_NS: Final = 600_000_000
#: And so long for a reading of every clock: the computer may be busy. A camera that does not answer then was not there.
_PATIENCE_NS: Final = 3 * NS_PER_S


class UnseenPulses:
    """Finds them, in the order of time.

    Args:
        tracks: the cameras.
        held: the frames that wait.
        train: the rhythm of the pulses.
        fired: the pulses that the source reports.
        deadlines: how long after a pulse its frames may come.
    """

    def __init__(
        self,
        tracks: Sequence[CameraTrack],
        held: HeldFrames,
        train: PulseTrain,
        fired: FiredPulses,
        deadlines: Deadlines,
    ) -> None:
        self._tracks, self._held, self._train, self._fired = tracks, held, train, fired
        self._deadlines = deadlines
        self._examined: OpenPulse | None = None

    def before(self, waiting: Sequence[OpenPulse], now: HostNs, *, due: bool, ask_source: bool) -> list[OpenPulse]:
        """Find the pulses without a frame before the first open one.

        Args:
            waiting: the open pulses in the order of time.
            now: present time.
            due: whether the first open pulse can be decided: frames of earlier ones cannot come any more.
            ask_source: whether a pulse that the source reports may be decided now.

        Returns:
            The pulses in the order of time; the first of them can be decided.
        """
        head = waiting[0] if waiting else None
        if ask_source and (time := self._fired_time(head, now, due=due)) is not None:
            return [OpenPulse(len(self._tracks), time, fired=True)]
        if head is not None and due:
            if not self._fired.covers(head.time) and (proven := self._proven(head, waiting)):
                return proven
            if head.proven_by_ids or head.fired:
                return []
        if self._fired.tells(now):
            return []
        # Frames of an unwatched pulse cannot come any more at the end of its hold, or when those of a later one cannot.
        time = unwatched_time(self._train, self._tracks, None if head is None else head.time)
        if time is None or not (due or now >= time + self._deadlines.hold_ns):
            return []
        return [OpenPulse(len(self._tracks), time, unwatched=True)]

    def _fired_time(self, head: OpenPulse | None, now: HostNs, *, due: bool) -> HostNs | None:
        """Time of a pulse before the first open one that the source has fired and no camera saw; None: none yet."""
        time = self._fired.next_unseen(None if head is None else head.time)
        if time is None or not (due or (not self._held.count and self._are_heard(time, now))):
            return None
        if self._train.last is None and not any(track.presence.was_there(time) for track in self._tracks):
            self._fired.skip()  # the rig is being set up
            return None
        return time

    def _are_heard(self, time: HostNs, now: HostNs) -> bool:
        """Whether a pulse that nobody saw has waited long enough, and each camera has shown if it was there."""
        if now < time + max(self._deadlines.hold_ns, _ANSWER_NS):
            return False
        mute = [track for track in self._tracks if track.is_awaited(time)]
        if mute and now < time + _PATIENCE_NS:
            return False
        for track in mute:
            track.fall_silent()
        return True

    def _proven(self, head: OpenPulse, waiting: Sequence[OpenPulse]) -> list[OpenPulse]:
        """The pulses proven by frame ids before the first open one, which is about to be decided."""
        if head.proven_by_ids or head.fired or head is self._examined:
            return []
        self._examined = head
        times = undelivered_times(waiting, self._tracks, self._train)
        return [OpenPulse(len(self._tracks), time, proven_by_ids=True) for time in times]


def unwatched_time(train: PulseTrain, tracks: Sequence[CameraTrack], following: HostNs | None) -> HostNs | None:
    """Time of the pulse after the last decided one, if no camera was there at that time; None otherwise.

    Args:
        train: the rhythm of the pulses.
        tracks: the cameras.
        following: time of the next pulse that a camera saw; None if there is none yet.
    """
    if train.last is None or any(track.watches() for track in tracks):
        return None
    rhythm = train.rhythm.usual_ns
    if rhythm is None:
        return None
    step = rhythm
    if following is not None:
        steps = round((following - train.last) / rhythm)
        if steps <= 1:
            return None
        even = (following - train.last) / steps  # a period that is slightly off adds up to nothing
        step = even if abs(even - rhythm) * steps < rhythm / 2 else rhythm
    time = HostNs(train.last + round(step))
    return time if all(track.was_away(time) for track in tracks) else None
