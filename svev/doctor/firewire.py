"""FireWire cameras: asked in a process of their own, which a card that hangs cannot hold up.

The same process sees the emulated bus of a simulated rig, if it is started with the right environment.
"""

import json
import subprocess
import sys
from collections.abc import Iterator, Mapping
from os import environ
from typing import Final

from rig.clocks import host_now
from rig.settings import RigSettings
from svev.doctor.finding import Finding, Level, Topic, failure, passed
from svev.simulation import environment, simulated_hill

#: A look, and a trial of each camera, take at most so long.
LOOK_S: Final = 15.0
TRIAL_S: Final = 15.0


def has_firewire(rig: RigSettings) -> bool:
    """Whether a rig has FireWire cameras."""
    return any(camera.backend == "iidc" for camera in rig.cameras)


def look_at_firewire(rig: RigSettings) -> Iterator[Finding]:
    """Are the cameras there? Changes nothing in them."""
    if not has_firewire(rig):
        return
    if rig.simulation is not None:
        names = ", ".join(camera.name for camera in rig.cameras if camera.backend == "iidc")
        yield passed(Topic.CAMERAS, f"{names} are simulated on an emulated FireWire bus")
        return
    yield from _ask(rig, {}, trial=False)


def try_firewire(rig: RigSettings) -> Iterator[Finding]:
    """Set each camera up as a recording does, and take frames for two seconds."""
    if not has_firewire(rig):
        remedy = 'name a rig file whose cameras have backend = "iidc", e.g. --rig config/rigs/hill-iidc.toml'
        yield failure(Topic.CAMERAS, f'the rig "{rig.name}" has no FireWire camera', remedy)
        return
    with simulated_hill(rig, host_now()) as hill:
        yield from _ask(rig, environment(hill), trial=True)


def trial_limit_s(rig: RigSettings) -> float:
    """A trial of all cameras takes at most so long, with an emulated bus to be started."""
    return LOOK_S + TRIAL_S * len(rig.cameras)


def _ask(rig: RigSettings, variables: Mapping[str, str], *, trial: bool) -> Iterator[Finding]:
    command = [sys.executable, "-m", "svev.doctor.firewire_process", *(["--trial"] if trial else [])]
    limit_s = trial_limit_s(rig) if trial else LOOK_S
    try:
        done = subprocess.run(
            command, input=rig.model_dump_json(), capture_output=True, text=True, check=False, timeout=limit_s,
            env={**environ, **variables},
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        remedy = "plug the FireWire card's cables out and in, and look at `dmesg`"
        yield failure(Topic.CAMERAS, f"the FireWire bus did not answer within {limit_s:g} s", remedy)
        return
    for line in done.stdout.splitlines():
        finding = json.loads(line)
        yield Finding(Level(finding["level"]), Topic(finding["topic"]), finding["what"], finding["remedy"])
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or ["no reason given"])[-1]
        yield failure(Topic.CAMERAS, f"FireWire cannot be examined: {last}", "report it with this line")
