"""The state of the service: which may follow which, and how it goes from one to another.

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
"""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Final

from rig.api.status import State
from rig.events import Level
from service.status.statements import moved
from service.supervision.messages import Do, Say, TakeDown
from service.supervision.situation import Moment, Phase, Situation

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


def move(now: Situation, to: State, at: Moment, do: Do) -> Situation:
    """Go to another state, and say so.

    Raises:
        ValueError: `to` cannot follow the present state.
    """
    before = now.state
    if to not in FOLLOWS[before]:
        raise ValueError(f"{to} cannot follow {before}")
    fault = now.fault.statement if to is State.FAULT else None
    do(Say(Level.ERROR if to is State.FAULT else Level.INFO, "service", moved(before, to, fault)))
    return replace(now, phase=Phase(to, at.utc, now.phase.number + 1, at.s))


def arm_anew(now: Situation, at: Moment, do: Do, *, keep_hill: bool) -> Situation:
    """End all processes; the next turn starts them again.

    Args:
        now: the situation.
        at: the present moment.
        do: takes effects.
        keep_hill: simulated cameras go on.
    """
    now = replace(now, fault=now.fault.hurried())
    if now.state is not State.ARMING:
        now = move(now, State.ARMING, at, do)
    do(TakeDown(keep_hill))
    return now
