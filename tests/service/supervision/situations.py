"""Situations of the service, made without a service: nothing runs, and the clock stands still."""

from concurrent.futures import Future
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from rig.api.recordings import Recording, SessionFields
from rig.api.status import State
from rig.clocks import HostNs
from rig.phrase import plain
from rig.transport.recorder_commands import StartRecording
from rig.transport.recorder_reports import CameraNews
from service.processes.seen import CameraPresence, Processes, Seen
from service.recordings.in_progress import RecordingInProgress
from service.status.statements import no_camera
from service.supervision.decide import decide
from service.supervision.messages import Effect, Message
from service.supervision.situation import Moment, RigInUse, Situation
from tests.support.rigs import SIM

AT = Moment(HostNs(1_000_000_000_000), datetime(2026, 2, 1, 12, tzinfo=UTC))
HERE = CameraPresence(CameraNews.CONNECTED, plain("a camera"))
GONE = CameraPresence(CameraNews.GONE, plain("unplugged"))
LOG = Path("/recordings/one.mcap")
RUNNING = Seen(
    Processes.ALL, empty=False, cameras=(HERE,) * len(SIM.cameras), warm=True, ready=True, started=AT.s - 100
)
#: What processes there usually are in a state.
SEEN = {
    State.IDLE: Seen(),
    State.ARMING: replace(RUNNING, cameras=(CameraPresence(),) * len(SIM.cameras), warm=False),
    State.ARMED: RUNNING,
    State.RECORDING: RUNNING,
    State.DISARMING: Seen(busy=True, empty=False),
    State.FAULT: replace(RUNNING, cameras=(GONE,) * len(SIM.cameras), warm=False),
}


def later(seconds: float) -> Moment:
    """A moment after `AT`."""
    return replace(AT, host=HostNs(AT.host + round(seconds * 1e9)))


def recording(*, opened: bool = True) -> RecordingInProgress:
    """A recording in progress, or one whose log is being opened."""
    order = StartRecording(path=LOG, session={}, seconds=60.0, nobody_stops=True)
    waiting: Future[Recording] = Future()
    return RecordingInProgress(order, SessionFields(), AT.utc, AT.host, LOG, (LOG,), None if opened else waiting)


def situation(state: State, *, seen: Seen | None = None, wanted: bool | None = None) -> Situation:
    """The usual situation in a state, which has lasted for ten seconds."""
    now = Situation.idle(RigInUse(SIM, "name = 'sim'"), AT)
    wanted = state not in {State.IDLE, State.DISARMING} if wanted is None else wanted
    now = replace(
        now,
        phase=replace(now.phase, state=state, began=AT.s - 10),
        goal=replace(now.goal, armed=wanted),
        seen=SEEN[state] if seen is None else seen,
        settling=replace(now.settling, began=AT.s - 10),
        recordings=replace(now.recordings, current=recording() if state is State.RECORDING else None),
    )
    return replace(now, fault=replace(now.fault, statement=no_camera())) if state is State.FAULT else now


def told(now: Situation, *messages: Message, at: Moment = AT) -> tuple[Situation, list[Effect]]:
    """What follows from messages, one after the other."""
    all_effects: list[Effect] = []
    for message in messages:
        now, effects = decide(now, message, at)
        all_effects += effects
    return now, all_effects
