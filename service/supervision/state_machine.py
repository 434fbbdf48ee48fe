"""Holds the state of the service, and enforces which state may follow which.

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

Only the supervisor's thread moves the machine; any thread reads its phase.
"""

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
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
