"""What the service says of a rig that is armed, by a health record."""

from rig.api.recordings import NextJumper
from rig.api.status import State, Status
from rig.health import Health
from rig.settings.model import RigSettings
from service.recordings.storage import Room
from service.supervision.picture import Facts, picture
from service.supervision.state_machine import Phase
from service.supervision.watching import PulseRate


def armed(rig: RigSettings, health: Health) -> Status:
    return picture(
        rig,
        Facts(
            phase=Phase.now(State.ARMED, 1), still=False, fault=None, notice=None, heard=None, health=health, warm=True,
            pulses=PulseRate(), alarms=(), overloaded=(), room=Room(10**9, 1.0, 1), preroll_s=0.0, holding_s=0.0,
            recording=None, last_recording=None, last_jump=None, next_jumper=NextJumper(), pids={}, restarts={},
        ),
    )  # fmt: skip
