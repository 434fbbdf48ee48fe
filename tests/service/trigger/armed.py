"""What the service says of a rig that is armed, by a health record."""

from dataclasses import replace

from rig.api.recordings import NextJumper
from rig.api.status import State, Status
from rig.health import Health
from rig.settings.model import RigSettings
from service.processes.seen import Seen
from service.supervision.picture import Beside, picture
from service.supervision.situation import Moment, RigInUse, Situation


def armed(rig: RigSettings, health: Health) -> Status:
    at = Moment.now()
    now = Situation.idle(RigInUse(rig, ""), at)
    now = replace(now, phase=replace(now.phase, state=State.ARMED), seen=Seen(health=health, warm=True))
    return picture(now, Beside(at, (), (), 10**9, 0.0, None, NextJumper()))
