"""The account of action commands: the cameras' answers, and the news in them for people.

The class is pure: what was sent, what came and the time go in, counts and words come out.
"""

from collections import deque
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final

from rig.action import ActionCounts
from rig.clocks import NS_PER_S, HostNs
from rig.phrase import Phrase, phrase
from triggering.sources.action_command import Acknowledge, ActionStatus

#: A camera answers within this time, or its answer counts as lost (GVCP's usual time for an acknowledge).
DEADLINE_NS: Final = NS_PER_S // 5
#: So many commands in a row without an answer are told: one answer may get lost, and costs nothing.
_UNANSWERED: Final = 3
#: A trouble that was gone for so long is told again.
_AGAIN_NS: Final = 10 * NS_PER_S


class _Trouble(Enum):
    LATE = "late"
    NO_REFERENCE_TIME = "no_reference_time"
    OVERFLOW = "overflow"
    REFUSED = "refused"
    UNANSWERED = "unanswered"


_NAMED: Final[dict[int, _Trouble]] = {
    ActionStatus.NO_REFERENCE_TIME: _Trouble.NO_REFERENCE_TIME,
    ActionStatus.OVERFLOW: _Trouble.OVERFLOW,
}


@dataclass(slots=True)
class _Command:
    """A command whose answers are not all there."""

    request_id: int
    sent: HostNs
    cameras: set[int]


class ActionAccount:
    """Counts the answers of all cameras.

    Args:
        cameras: names of the cameras by their addresses, in the order of the rig.

    Attributes:
        counts: of each camera.
    """

    def __init__(self, cameras: Sequence[tuple[str, str]]) -> None:
        self._names = [name for _, name in cameras]
        self._of_address = {address: index for index, (address, _) in enumerate(cameras)}
        self.counts = [ActionCounts() for _ in cameras]
        self._open: deque[_Command] = deque()
        self._unanswered = [0] * len(cameras)  # in a row
        self._happened: dict[tuple[int, _Trouble], HostNs] = {}
        self._told: list[Phrase] = []

    def sent(self, request_id: int, now: HostNs, cameras: Collection[int]) -> None:
        """Enter a command.

        Args:
            request_id: its number.
            now: when it was sent.
            cameras: indices of the cameras that have to answer it.
        """
        self._open.append(_Command(request_id, now, set(cameras)))

    def answered(self, address: str, answer: Acknowledge, now: HostNs) -> None:
        """Enter an answer; an answer of a stranger, a repeated or a late one is not counted."""
        camera = self._of_address.get(address)
        # The last command comes first: an id that was used again belongs to it.
        command = next((each for each in reversed(self._open) if each.request_id == answer.request_id), None)
        if command is None or camera is None or camera not in command.cameras:
            return
        command.cameras.remove(camera)
        self._unanswered[camera] = 0
        counts = self.counts[camera]
        match answer.status:
            case ActionStatus.SUCCESS:
                counts.acknowledged += 1
            case ActionStatus.LATE:
                counts.late += 1
                self._tell(camera, _Trouble.LATE, now, answer.status)
            case status:
                counts.refused += 1
                self._tell(camera, _NAMED.get(status, _Trouble.REFUSED), now, status)

    def expire(self, now: HostNs) -> None:
        """Give up answers that have not come in time."""
        while self._open and self._open[0].sent + DEADLINE_NS <= now:
            for camera in sorted(self._open.popleft().cameras):
                self.counts[camera].unanswered += 1
                self._unanswered[camera] += 1
                if self._unanswered[camera] >= _UNANSWERED:
                    self._tell(camera, _Trouble.UNANSWERED, now, 0)

    def told(self) -> list[Phrase]:
        """What has begun to go wrong since the last call, each with the camera's name and what to do."""
        told, self._told = self._told, []
        return told

    def _tell(self, camera: int, trouble: _Trouble, now: HostNs, status: int) -> None:
        before = self._happened.get((camera, trouble))
        self._happened[camera, trouble] = now
        if before is None or now > before + _AGAIN_NS:
            self._told.append(_WORDS[trouble](self._names[camera], status))


_WORDS: Final[dict[_Trouble, Callable[[str, int], Phrase]]] = {
    _Trouble.LATE: lambda camera, _: phrase(
        "action_late",
        "{camera} gets action commands after their time: raise trigger.lead_ms in the rig file, close other programs",
        camera=camera,
    ),
    _Trouble.NO_REFERENCE_TIME: lambda camera, _: phrase(
        "action_no_reference_time",
        "{camera} has no reference time, so it does not expose: check the PTP master and the switch",
        camera=camera,
    ),
    _Trouble.OVERFLOW: lambda camera, _: phrase(
        "action_overflow",
        "{camera} holds no more scheduled action commands: lower trigger.lead_ms in the rig file",
        camera=camera,
    ),
    _Trouble.REFUSED: lambda camera, status: phrase(
        "action_refused",
        "{camera} refuses action commands (status {status}): see its manual for what they need, or use another source",
        camera=camera,
        status=f"{status:#06x}",
    ),
    _Trouble.UNANSWERED: lambda camera, _: phrase(
        "action_unanswered",
        "{camera} does not answer action commands: check trigger.broadcast in the rig file and the firewall; if its "
        "frames come all the same, it only does not answer",
        camera=camera,
    ),
}
