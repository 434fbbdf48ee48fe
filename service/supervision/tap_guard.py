"""Tells a second tap from a wish: an operator's command names the state that he saw when he gave it.

A button that says "Record" and then "Stop" turns a double tap into two opposite commands. So a page sends with each
command the number of the state that it showed (`seen`). The command is refused if another state has come since, or if
the state is so new that nobody can have read it; in the first seconds of a recording stopping has to be confirmed.
Programs that leave `seen` out are obeyed at once: they name what they start and stop.
"""

from typing import Final

from rig.api.recordings import StopOrder
from rig.api.status import State, TapGuard
from rig.errors import ChangedMeanwhileError, ConfirmFirstError, TooSoonError
from service.supervision.situation import Phase

#: Second taps by cold fingers, and taps meant for the state before, come within this time after a change of state.
HOLD_S: Final = 1.5
#: Nobody stops a jump on purpose so soon after its recording began: in-run, take-off and landing take longer.
CONFIRM_S: Final = 3.0


def tap_guard(phase: Phase, now: float) -> TapGuard:
    """What a page has to know before it sends its next command.

    Args:
        phase: the present state.
        now: on the monotonic clock, s.
    """
    age_s = phase.age_s(now)
    confirm_s = CONFIRM_S - age_s if phase.state is State.RECORDING else 0.0
    return TapGuard(
        number=phase.number,
        hold_s=round(max(0.0, HOLD_S - age_s), 2),
        confirm_s=round(max(0.0, confirm_s), 2),
    )


def check_seen(phase: Phase, seen: int | None, now: float, *, opening: bool = False) -> None:
    """Check that a command was given in the present state, and not by a second tap.

    Args:
        phase: the present state.
        seen: number of the state that the operator saw; None: a program commands, which is not checked.
        now: on the monotonic clock, s.
        opening: whether a recording is being opened, so that the state is about to change.

    Raises:
        ChangedMeanwhileError: the operator saw another state.
        TooSoonError: the state is too new.
    """
    if seen is None:
        return
    if seen != phase.number or opening:
        words = "a recording is being started" if opening else f"the rig is {_IN_WORDS[phase.state]}"
        raise ChangedMeanwhileError(f"{words} by now, so nothing was done: look at the state, then press again")
    if (age_s := phase.age_s(now)) < HOLD_S:
        raise TooSoonError(
            f"the rig is {_IN_WORDS[phase.state]} since {age_s:.1f} s only, so this counts as a second tap and "
            f"nothing was done: press again after {HOLD_S:g} s"
        )


def check_stop(phase: Phase, order: StopOrder, now: float) -> None:
    """Check likewise that a recording is to be stopped.

    Raises:
        ChangedMeanwhileError: the operator saw another state.
        ConfirmFirstError: the recording has only just begun, and the order does not confirm that it is to end.
    """
    if order.seen is None or (order.confirm and order.seen == phase.number):
        return
    if order.seen == phase.number and (age_s := phase.age_s(now)) < CONFIRM_S:
        raise ConfirmFirstError(
            f"the recording began {age_s:.1f} s ago and goes on: hold the button to stop it all the same"
        )
    check_seen(phase, order.seen, now)


_IN_WORDS: Final = {
    State.IDLE: "not armed",
    State.ARMING: "being armed",
    State.ARMED: "armed",
    State.RECORDING: "recording",
    State.DISARMING: "being disarmed",
    State.FAULT: "in a fault",
}
