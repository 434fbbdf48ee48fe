"""Runs the demonstration on the simulated hill: records, publishes, checks the log, measures the jumps."""

import re
import socket
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from analysis.film.contact_sheet import write_contact_sheet
from recorder.checking.verify import verify
from recorder.log.beside import survey_path, truth_path
from recorder.publishing.subscriber import SubscriberCount, free_address, subscriber
from rig.errors import BadInputError
from rig.host.endings import counted_endings
from rig.settings.file import CONFIG, load_rig
from rig.settings.model import RigSettings, SimulationSettings
from service.headless import HeadlessRig, Recorded, record
from service.recordings.storage import new_log_path
from svev import console
from svev.claims import folder_claim
from svev.demo_analysis import Measured, measure

Bus = Literal["gige", "firewire", "sim"]
Shown = Literal["training", "hard", "faults"]

_RIGS: Final[dict[Bus, str]] = {"gige": "sim-gige.toml", "firewire": "sim-firewire.toml", "sim": "sim.toml"}
_CAMERAS: Final[dict[Bus, str]] = {
    "gige": "three simulated cameras speak GigE Vision",
    "firewire": "three simulated cameras on an emulated FireWire bus",
    "sim": "three simulated cameras",
}
_GVCP_PORT: Final = 3956
_BLOCKS: Final = 64


def run_demo(
    bus: Bus, shown: Shown, seconds: float, out: Path, say: Callable[[str], None], *, analyze: bool = True
) -> "Demonstrated":
    """Record for `seconds` on the simulated hill, with a subscriber that counts the triplets; measure the jumps.

    Args:
        bus: how the simulated cameras are connected.
        shown: scenario of the simulated hill.
        seconds: length of the recording.
        out: folder for the files.
        say: prints a line for people.
        analyze: measure the jumps too.

    Raises:
        SvevError: as `service.headless.record`, and if images are missing because of the disk.
    """
    rig, rig_toml = _showing(CONFIG / "rigs" / _RIGS[bus], shown)
    rig = _on_free_addresses(rig)
    say(f"{_CAMERAS[bus]}; pulses at {rig.trigger.rate_hz:g} Hz")
    with (
        folder_claim(out, "svev demo", "--out"),
        counted_endings() as asks,
        HeadlessRig(rig, rig_toml, say) as running,
    ):
        path = new_log_path(out)
        running.wait_until_warm(asks)
        with subscriber(rig.network.publish) as count_received:
            session = {"session": "demo", "athlete": "simulated jumper"}
            recorded = record(running, rig, path, seconds, session=session, progress=console.progress, asks=asks)
            counted = count_received()
    if recorded.disk_error is not None:
        raise recorded.disk_error
    path = recorded.report.path
    say("checking the log")
    report = verify(path)
    sheet = path.with_suffix(".png")
    write_contact_sheet(path, sheet)
    analysis = measure(path, say) if analyze else None
    return Demonstrated(recorded, rig.trigger.rate_hz, counted, report.verdict, sheet, analysis)


@dataclass(frozen=True, slots=True)
class Demonstrated:
    """What came of a demonstration.

    Attributes:
        recorded: the recording.
        rate_hz: of its pulses.
        subscriber: counted by the subscriber.
        verdict: of the check of the log.
        contact_sheet: a picture of its frames.
        analysis: the measured jumps; None: nobody asked.
    """

    recorded: Recorded
    rate_hz: float
    subscriber: SubscriberCount
    verdict: str
    contact_sheet: Path
    analysis: Measured | None

    @property
    def log(self) -> Path:
        """The log."""
        return self.recorded.report.path

    @property
    def truth(self) -> Path:
        """The truth of the simulated hill."""
        return truth_path(self.log)

    @property
    def survey(self) -> Path:
        """The survey of its balls."""
        return survey_path(self.log)

    def to_json(self) -> dict[str, object]:
        """All of it as `svev demo --json` prints it."""
        names = ("received", "missing", "bytes", "latency_ms")
        return self.recorded.to_json() | {
            "rate_hz": self.rate_hz,
            "subscriber": {name: getattr(self.subscriber, name) for name in names},
            "verdict": self.verdict,
            "contact_sheet": str(self.contact_sheet),
            "truth": str(self.truth),
            "survey": str(self.survey),
            "analysis": None if self.analysis is None else self.analysis.to_json(),
        }


def _showing(rig_file: Path, shown: Shown) -> tuple[RigSettings, str]:
    """A shipped rig and the text of its file, both with that scenario."""
    text = re.sub(r"scenarios/\w+\.toml", f"scenarios/{shown}.toml", rig_file.read_text(encoding="utf-8"))
    simulation = SimulationSettings(scenario=CONFIG / "scenarios" / f"{shown}.toml")
    return load_rig(rig_file).model_copy(update={"simulation": simulation}), text


def _on_free_addresses(rig: RigSettings) -> RigSettings:
    """The rig with a free port for publication and, if its loopback addresses are in use, with other ones."""
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
