"""Examines FireWire cameras, in a child process, so that a card that hangs does not hang the doctor.

The child sees the emulated bus of a simulated rig, if it is started with the right environment.
"""

from collections.abc import Iterator, Mapping
from typing import Final

from rig.clocks import host_now
from rig.settings.model import RigSettings
from service.processes.simulation import hill_environment
from svev.doctor.cameras.child import hear
from svev.doctor.cameras.firewire_process import Examination
from svev.doctor.finding import Finding, Topic, failure, passed

#: Time limits, s: of the examination without trial, and of the trial of each camera.
LOOK_S: Final = 15.0
TRIAL_S: Final = 15.0


def has_firewire(rig: RigSettings) -> bool:
    """Whether a rig has FireWire cameras."""
    return any(camera.backend == "iidc" for camera in rig.cameras)


def look_at_firewire(rig: RigSettings) -> Iterator[Finding]:
    """Are the FireWire cameras of the rig connected? Changes none of their settings."""
    if not has_firewire(rig):
        return
    if rig.simulation is not None:
        names = ", ".join(camera.name for camera in rig.cameras if camera.backend == "iidc")
        what = "{cameras} are simulated on an emulated FireWire bus"
        yield passed(Topic.CAMERAS, "check_firewire_simulated", what, cameras=names)
        return
    yield from _ask(rig, {}, trial=False)


def try_firewire(rig: RigSettings) -> Iterator[Finding]:
    """Set each camera up as a recording does, and take frames for two seconds."""
    if not has_firewire(rig):
        remedy = 'name a rig file whose cameras have backend = "iidc", e.g. --rig config/rigs/hill-iidc.toml'
        yield failure(
            Topic.CAMERAS, "check_no_firewire", 'the rig "{rig}" has no FireWire camera', remedy, rig=rig.name
        )
        return
    with hill_environment(rig, host_now()) as variables:
        yield from _ask(rig, variables, trial=True)


def trial_limit_s(rig: RigSettings) -> float:
    """Time limit of the trial of all cameras, with the start of an emulated bus, s."""
    return LOOK_S + TRIAL_S * len(rig.cameras)


def _ask(rig: RigSettings, variables: Mapping[str, str], *, trial: bool) -> Iterator[Finding]:
    limit_s = trial_limit_s(rig) if trial else LOOK_S
    program, config = "svev.doctor.cameras.firewire_process", Examination(rig=rig, trial=trial)
    heard = hear("FireWire examination", program, config, limit_s, variables)
    if heard.hangs:
        remedy = "plug the FireWire card's cables out and in, and look at `dmesg`"
        what = "the FireWire bus did not answer within {seconds:g} s"
        yield failure(Topic.CAMERAS, "check_firewire_hangs", what, remedy, seconds=limit_s)
        return
    yield from heard.findings
    if heard.broken:
        what, remedy = "FireWire cannot be examined: {why}", "report it with this line"
        yield failure(Topic.CAMERAS, "check_firewire_broken", what, remedy, why=heard.broken)
