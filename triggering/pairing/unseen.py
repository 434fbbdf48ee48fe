"""Finds the pulses of which no camera delivered a frame, and puts them among the open ones.

The source of the pulses may say that it fired them (`triggering.timeline.fired`), the frame ids may prove it
(`undelivered`), and those that were due while no camera was there, and no source tells, follow from the rhythm: the
train goes on in the rhythm that it had. That holds only from its last pulse to the next one that a camera sees, and
only if it was running when the last camera left: a camera that answered, but took no frame, shows that it had paused.
"""

from collections.abc import Callable, Sequence
from typing import Final

from rig.clocks import NS_PER_S, HostNs
from triggering.pairing.camera_track import CameraTrack
from triggering.pairing.held import HeldFrames
from triggering.pairing.outcomes import OpenPulse
from triggering.pairing.silence import fall_silent
from triggering.pairing.undelivered import undelivered_times
from triggering.timeline.fired import FiredPulses
from triggering.timeline.pulse_train import PulseTrain

#: A pulse that nobody saw waits so long for readings of the cameras' clocks, four times a second, after it.
_ANSWER_NS: Final = 600_000_000
#: So long for a reading of each of them: a computer may be busy. A camera that does not answer then was not there.
_PATIENCE_NS: Final = 3 * NS_PER_S


class UnseenPulses:
    """Inserts them, in the order of time.

    Args:
        waiting: the open pulses in the order of time, which it changes.
        tracks: the cameras.
        held: the frames that wait to be believed.
        train: the rhythm of the pulses.
        fired: what the source says.
        deadline: when the first open pulse is decided at the latest.
        hold_ns: how long after a pulse its frames may come.
    """

    def __init__(
        self,
        waiting: list[OpenPulse],
        tracks: Sequence[CameraTrack],
        held: HeldFrames,
        train: PulseTrain,
        fired: FiredPulses,
        deadline: Callable[[], HostNs],
        hold_ns: Callable[[], int],
    ) -> None:
        self._open, self._tracks, self._held, self._train, self._fired = waiting, tracks, held, train, fired
        self._deadline, self._hold_ns = deadline, hold_ns
        self._examined: OpenPulse | None = None

    def insert(self, now: HostNs, *, due: bool) -> bool:
        """Insert what is missing before the first open pulse.

        Args:
            now: present time.
            due: whether the first open pulse can be decided: frames of earlier ones cannot come any more.

        Returns:
            Whether the pulse that is the first one now can be decided.
        """
        if self._fired.active:
            due = self._heed_source(now, due=due)
        if due and not self._fired.covers(self._open[0].time):
            self._insert_undelivered()
        if not (due and (self._open[0].proven_by_ids or self._open[0].fired)) and not self._fired.tells(now):
            self._insert_unwatched(now, due=due)
        return due or (bool(self._open) and self._open[0].unwatched)

    def _heed_source(self, now: HostNs, *, due: bool) -> bool:
        """Insert a pulse that the source has fired.

        Returns:
            Whether the first open pulse can be decided; not, if the source has not told yet of those before it.
        """
        head = self._open[0] if self._open else None
        if due and head is not None and now < self._deadline() and self._fired.waits(head.time, now):
            return False
        time = self._fired.next_unseen(None if head is None else head.time)
        if time is None or not (due or (not self._held.count and self._are_heard(time, now))):
            return due
        if self._train.last is None and not any(track.was_there(time) for track in self._tracks):
            self._fired.skip()  # the rig is being set up
            return due
        self._open.insert(0, OpenPulse(len(self._tracks), time, fired=True))
        return True

    def _are_heard(self, time: HostNs, now: HostNs) -> bool:
        """Whether a pulse that nobody saw has waited long enough, and each camera has shown if it was there."""
        if now < time + max(self._hold_ns(), _ANSWER_NS):
            return False
        mute = [track for track in self._tracks if track.is_awaited(time)]
        if mute and now < time + _PATIENCE_NS:
            return False
        for track in mute:
            fall_silent(track)
        return True

    def _insert_undelivered(self) -> None:
        """Insert the pulses that the frame ids prove before the one that is about to be decided."""
        pulse = self._open[0]
        if pulse.proven_by_ids or pulse.fired or pulse is self._examined:
            return
        self._examined = pulse
        times = undelivered_times(self._open, self._tracks, self._train)
        self._open[:0] = [OpenPulse(len(self._tracks), time, proven_by_ids=True) for time in times]

    def _insert_unwatched(self, now: HostNs, *, due: bool) -> None:
        """Insert the pulse that was expected before the next one, if no camera was there to see it.

        That is certain only when frames of it cannot come any more: like those of the next one, if it is `due`.
        """
        following = self._open[0] if self._open else None
        time = unwatched_time(self._train, self._tracks, None if following is None else following.time)
        if time is not None and (due or now >= time + self._hold_ns()):
            self._open.insert(0, OpenPulse(len(self._tracks), time, unwatched=True))


def unwatched_time(train: PulseTrain, tracks: Sequence[CameraTrack], following: HostNs | None) -> HostNs | None:
    """Time of the pulse after the last decided one, if no camera was there at that time; None otherwise.

    Args:
        train: the rhythm of the pulses.
        tracks: the cameras.
        following: time of the next pulse that a camera saw; None if there is none yet.
    """
    if train.last is None or any(track.watches for track in tracks):
        return None
    rhythm = train.rhythm_ns
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
