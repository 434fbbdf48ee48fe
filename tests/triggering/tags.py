"""Tags as the recorder writes them, of pulses that were decided in memory, and their recomputed ledger."""

from collections.abc import Iterable

from rig.clocks import UtcNs
from rig.events import Event
from rig.frame import FrameStatus
from rig.pulse import PulseNumber
from rig.tag import CameraTag, TripletTag
from triggering.ledger.recount import Recount
from triggering.ledger.recounted import Recounted
from triggering.pairing.outcomes import ClosedPulse

OK = FrameStatus.OK


def tags_of(closed: Iterable[ClosedPulse]) -> list[TripletTag]:
    """The tags that the recorder would write."""
    return [
        TripletTag(
            PulseNumber(pulse.number), UtcNs(pulse.time), "", "r", (48, 64 * len(pulse.outcomes)),
            tuple(
                CameraTag(f"K{place + 1}", (64 * place, 64 * place + 64), outcome.status) if outcome.record is None
                else CameraTag(
                    f"K{place + 1}", (64 * place, 64 * place + 64), OK, outcome.record.frame_id,
                    None if outcome.record.trigger_count < 0 else outcome.record.trigger_count,
                    outcome.record.device_time, UtcNs(outcome.record.host_time), 0.0,
                )
                for place, outcome in enumerate(pulse.outcomes)
            ),
        )
        for pulse in closed
    ]  # fmt: skip


def recount(tags: Iterable[TripletTag], events: Iterable[Event] = ()) -> Recounted:
    account = Recount()
    for event in events:
        account.happened(event)
    for tag in tags:
        account.add(tag)
    return account.finish()
