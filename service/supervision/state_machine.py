"""The state of the service: which may follow which, and which steps lead from a situation to the wanted one.

```
            arm                cameras answered            start
  idle ───────────► arming ───────────────────► armed ◄─────────────► recording
   ▲                  │  ▲                      │   ▲      stop           │
   │ all has ended    │  │ again, by itself     │   │ a camera is back    │
   │                  ▼  │ or by arm            ▼   │                     │
   └── disarming ◄── from all but recording     fault ◄──── from anywhere ┘
```

From arming a recording goes on at once whose recorder died. From armed the rig is armed anew if its pulses get another
rate.

Only the supervisor's thread moves the machine; any thread reads its phase. The decisions are pure functions
(`next_steps`, `state_by_cameras`); the supervisor carries them out.
"""

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import Enum
from types import MappingProxyType
from typing import Final

from rig.api.status import State

FOLLOWS: Final[Mapping[State, frozenset[State]]] = MappingProxyType(
    {
        State.IDLE: frozenset({State.ARMING}),
        State.ARMING: frozenset({State.ARMED, State.RECORDING, State.FAULT, State.DISARMING}),
        State.ARMED: frozenset({State.ARMING, State.RECORDING, State.FAULT, State.DISARMING}),
        State.RECORDING: frozenset({State.ARMED, State.FAULT}),
        State.DISARMING: frozenset({State.IDLE}),
        State.FAULT: frozenset({State.ARMING, State.ARMED, State.DISARMING}),
    }
)


@dataclass(frozen=True, slots=True)
class Phase:
    """A state.

    Attributes:
        state: the state.
        since: when it began, UTC.
        number: counts up with every change of state; higher than any number of an earlier run of the service.
        began: when it began, on the monotonic clock, s.
    """

    state: State
    since: datetime
    number: int
    began: float

    @classmethod
    def now(cls, state: State, number: int) -> "Phase":
        """A state that begins now."""
        return cls(state, datetime.now(UTC), number, time.monotonic())

    @property
    def age_s(self) -> float:
        """How long the state has lasted, s."""
        return time.monotonic() - self.began


class StateMachine:
    """The state machine, beginning idle.

    Args:
        on_move: called after every move with the state before and after, in the thread that moves.
    """

    def __init__(self, on_move: Callable[[State, State], None]) -> None:
        self._lock = threading.Lock()
        self._phase = Phase.now(State.IDLE, int(time.time()))
        self._on_move = on_move

    @property
    def phase(self) -> Phase:
        """The present state with its beginning."""
        with self._lock:
            return self._phase

    @property
    def state(self) -> State:
        """The present state."""
        return self.phase.state

    def move(self, to: State) -> None:
        """Go to another state.

        Raises:
            ValueError: `to` cannot follow the present state.
        """
        with self._lock:
            before = self._phase.state
            if to not in FOLLOWS[before]:
                raise ValueError(f"{to} cannot follow {before}")
            self._phase = Phase.now(to, self._phase.number + 1)
        self._on_move(before, to)


@dataclass(frozen=True, slots=True)
class Goal:
    """What people want of the rig.

    Attributes:
        armed: it is to be armed.
        least_cameras: so many cameras are enough.
    """

    armed: bool
    least_cameras: int


class Processes(Enum):
    """Which processes of the rig run."""

    NONE = "none"
    ALL = "all"
    NO_RECORDER = "all but the recorder, which died"


@dataclass(frozen=True, slots=True)
class Situation:
    """What decides the next steps.

    Attributes:
        state: the present state.
        wanted: whether the rig is to be armed.
        recording: whether a recording is in progress, or its log is being opened.
        processes: which processes run.
        busy: whether processes are being started or stopped.
        empty: whether nothing is left to stop.
        may_try: whether it is time to start processes, after a fault.
    """

    state: State
    wanted: bool
    recording: bool
    processes: Processes
    busy: bool
    empty: bool
    may_try: bool


class Step(Enum):
    """One step of the supervisor."""

    BEGIN_DISARMING = "begin disarming"
    REST = "rest"
    STOP_ALL = "stop all processes"
    BEGIN_ARMING = "begin arming"
    START_ALL = "start all processes"
    START_RECORDER = "start another recorder"


def next_steps(now: Situation) -> tuple[Step, ...]:
    """The steps from a situation towards the wanted one; none: there is nothing to do, or something must end first."""
    if not now.wanted:
        if now.state is State.IDLE or now.recording:
            return ()
        begin = () if now.state is State.DISARMING else (Step.BEGIN_DISARMING,)
        if now.empty:
            return (*begin, Step.REST)
        return begin if now.busy else (*begin, Step.STOP_ALL)
    if now.busy or not now.may_try or now.processes is Processes.ALL:
        return ()
    start = Step.START_ALL if now.processes is Processes.NONE else Step.START_RECORDER
    return (Step.BEGIN_ARMING, start)


def state_by_cameras(state: State, *, settled: bool, able: bool, any_present: bool) -> State:
    """The state that follows from the cameras, while the rig is to be armed and nothing is recorded.

    Args:
        state: the present state.
        settled: whether arming is done: all cameras have answered, or had time enough.
        able: whether enough cameras are there.
        any_present: whether at least one is.
    """
    match state:
        case State.ARMING if settled:
            return State.ARMED if able else State.FAULT
        case State.ARMED if not able and not any_present:
            return State.FAULT
        case State.FAULT if able:
            return State.ARMED
    return state
