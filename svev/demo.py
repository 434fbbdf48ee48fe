"""The main job on the simulated hill: record a few jumps, publish, count, verify, show."""

import socket
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Final, Literal

from recorder.contact_sheet import write_contact_sheet
from recorder.verify import verify
from rig.clocks import host_now
from rig.control import Message
from rig.errors import BadInputError
from rig.rigfile import CONFIG, load_rig
from rig.settings import RigSettings
from svev.recording_run import new_log_path, run_recording
from svev.running_rig import RunningRig
from svev.simulation import environment, simulated_hill
from svev.subscriber import Subscriber, free_address
from svev.truth_file import write_truth

Bus = Literal["gige", "firewire", "sim"]

_RIGS: Final[dict[Bus, str]] = {"gige": "sim-gige.toml", "firewire": "sim-firewire.toml", "sim": "sim.toml"}
_CAMERAS: Final[dict[Bus, str]] = {
    "gige": "three simulated cameras speak GigE Vision",
    "firewire": "three simulated cameras on an emulated FireWire bus",
    "sim": "three simulated cameras",
}
_GVCP_PORT: Final = 3956
_BLOCKS: Final = 64


def run_demo(bus: Bus, seconds: float, out: Path, say: Callable[[str], None]) -> Message:
    """Record for `seconds` on the simulated hill, with a subscriber that counts.

    Returns:
        The recording's result, what the subscriber counted, the verdict, and the files made.
    """
    rig_file = CONFIG / "rigs" / _RIGS[bus]
    rig = _on_free_addresses(load_rig(rig_file))
    path = new_log_path(out)
    epoch = host_now()
    with ExitStack() as stack:
        hill = stack.enter_context(simulated_hill(rig, epoch))
        say(f"{_CAMERAS[bus]}; pulses at {rig.trigger.rate_hz:g} Hz")
        running = stack.enter_context(
            RunningRig(rig, rig_file.read_text(encoding="utf-8"), say, epoch, environment(hill))
        )
        subscriber = stack.enter_context(Subscriber(rig.network.publish))
        session = {"session": "demo", "athlete": "simulated jumper"}
        result = run_recording(running, rig, path, seconds, allow_absent=False, session=session)
        counted = subscriber.count()
    say("checking the log")
    report = verify(path)
    sheet, truth = path.with_suffix(".png"), write_truth(path, rig)
    write_contact_sheet(path, sheet)
    return result | {
        "rate_hz": rig.trigger.rate_hz,
        "subscriber": counted,
        "verdict": report.verdict,
        "contact_sheet": str(sheet),
        "truth": str(truth),
    }


def _on_free_addresses(rig: RigSettings) -> RigSettings:
    """The rig with a port of its own for publication and, if they are taken, other loopback addresses."""
    network = rig.network.model_copy(update={"publish": free_address()})
    for block in range(_BLOCKS):
        cameras = tuple(
            camera.model_copy(update={"address": camera.address.replace("127.0.0.", f"127.0.{block}.")})
            for camera in rig.cameras
        )
        if all(_is_free(camera.address) for camera in cameras if camera.backend == "aravis"):
            return rig.model_copy(update={"cameras": cameras, "network": network})
    raise BadInputError(f"{_BLOCKS} blocks of loopback addresses are all in use: stop the other simulated cameras")


def _is_free(address: str) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((address, _GVCP_PORT))
        except OSError:
            return False
    return True
