"""The fault matrix of the FireWire cameras: each fault is made to happen, and what the log says of it becomes a row.

    .venv/bin/python -m tests.service.cameras.firewire_matrix    writes the rows into docs/how-to/firewire.md

Each fault befalls K2 in a recording of its own of the same running rig: three emulated Marlins, 15 pulses per second.
"""

import os
import re
import signal
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any, Final

from recorder.checking.verify import verify
from recorder.publishing.subscriber import free_address
from recorder.reading.triplets import triplets
from rig.api.recordings import Counts
from rig.clocks import host_now
from rig.errors import BadInputError
from rig.frame import FrameStatus
from rig.settings.file import CONFIG, load_rig
from rig.settings.model import RigSettings
from service.headless import HeadlessRig
from service.processes.simulation import simulated_hill
from simrig.programs.simulated_hill import SimulatedHill
from simrig.world.faults import Fault
from tests.support.stamps import hill_pulses

PAGE: Final = Path(__file__).resolve().parents[3] / "docs" / "how-to" / "firewire.md"
BEGIN: Final = "<!-- fault matrix: written by tests.service.cameras.firewire_matrix, do not edit -->"
END: Final = "<!-- end of the fault matrix -->"
RATE_HZ: Final = 15.0
PACKETS: Final = 480  # of a frame at 15 Hz
_VICTIM: Final = 1  # K2
_BEFORE: Final = 8  # pulses of a recording before its fault
_HEAD: Final = ("Fault", "What the tags say of the camera", "What the events say of it")


@dataclass(frozen=True, slots=True)
class Row:
    """What one fault came to.

    Attributes:
        fault: in words.
        tags: what the tags say of K2, in order.
        events: what the log's events say of K2, numbers left out.
        cause: words that they must have said.
        mixed: pulses whose frames are of different hill pulses, or of another than the pulse's.
    """

    fault: str
    tags: str
    events: str
    cause: str
    mixed: int

    def line(self) -> str:
        """One row of the table in Markdown."""
        return f"| {self.fault} | {self.tags} | {self.events} |"


@dataclass(frozen=True, slots=True)
class Case:
    """One fault, the length of its recording in pulses, and what an event must say of it; "": the tags say enough."""

    words: str
    pulses: int
    cause: str
    happen: Callable[[SimulatedHill, HeadlessRig], None]


def _fault(**fault: Any) -> Callable[[SimulatedHill, HeadlessRig], None]:
    def happen(hill: SimulatedHill, _: HeadlessRig) -> None:
        hill.inject(Fault(camera="K2", at_pulse=hill.train.next_index(host_now()) + 5, **fault))

    return happen


def _stall(_: SimulatedHill, running: HeadlessRig) -> None:
    """Stop the grabber process for a second."""
    pid = running.pids["K2"]
    os.kill(pid, signal.SIGSTOP)
    threading.Timer(1.0, os.kill, (pid, signal.SIGCONT)).start()


CASES: Final = (
    Case("missed pulse", 30, "", _fault(kind="missed_pulse")),
    Case("overrun: pulse during the read-out", 30, "overrun", _fault(kind="overrun")),
    Case("lost packet, the first", 30, "", _fault(kind="lost_packets", packets=(1,))),
    Case("lost packet, in the middle", 30, "", _fault(kind="lost_packets", packets=(PACKETS // 2,))),
    Case("lost packet, the last", 30, "", _fault(kind="lost_packets", packets=(PACKETS,))),
    Case("all packets of a frame lost", 30, "", _fault(kind="lost_frame")),
    Case("bus reset", 30, "bus reset", _fault(kind="bus_reset")),
    Case("stalled consumer: grabber stopped for 1 s", 60, "silent", _stall),
    Case("unplugged for 1 s and back", 90, "gone", _fault(kind="restart", duration_s=1.0)),
    Case(
        "camera dead for 1 s, plugged in",
        90,
        "no frame while the other cameras have theirs",
        _fault(kind="frozen", duration_s=1.0),
    ),
)


def rows(directory: Path) -> Iterator[Row]:
    """Make every fault happen; logs and rig file go into `directory`."""
    with _running(directory) as (hill, running, rig):
        for number, case in enumerate(CASES):
            log = directory / f"{number}.mcap"
            _record(hill, running, case, log)
            yield _row(case, log, rig)
    yield _fourth_camera(directory)


@contextmanager
def _running(directory: Path) -> Iterator[tuple[SimulatedHill, HeadlessRig, RigSettings]]:
    rig, epoch = _rig(directory, 3), host_now()
    with simulated_hill(rig, epoch) as hill:
        assert hill is not None
        with HeadlessRig(rig, "", _ignore, lambda _: nullcontext(hill.environment)) as running:
            running.wait_until_warm()
            yield hill, running, rig


def _rig(directory: Path, cameras: int) -> RigSettings:
    scenario = CONFIG / "scenarios" / "training.toml"
    lines = [
        'name = "fault matrix"',
        "[trigger]",
        f"rate_hz = {RATE_HZ}",
        "settle_s = 60",
        "[simulation]",
        f'scenario = "{scenario}"',
    ]
    lines += ["[network]", f'publish = "{free_address()}"']
    for number in range(1, cameras + 1):
        lines += ["[[cameras]]", f'name = "K{number}"', 'backend = "iidc"', f'address = "000a4701011b{number:04x}"']
    path = directory / "rig.toml"
    path.write_text("\n".join(lines) + "\n")
    return load_rig(path)


def _record(hill: SimulatedHill, running: HeadlessRig, case: Case, log: Path) -> None:
    """Record, and make the fault happen when the recording has begun."""
    happened: list[Case] = []

    def on_progress(counts: Counts) -> None:
        if counts.pulses >= _BEFORE and not happened:
            happened.append(case)
            case.happen(hill, running)

    running.start_recording(log, session={}, pulses=case.pulses, seconds=60)
    running.wait_until_finished(on_progress, lambda: False)


def _row(case: Case, log: Path, rig: RigSettings) -> Row:
    tags = [tag for tag, _ in triplets(log)]
    seen = hill_pulses(log, rig)
    first = next(min(seen[tag.pulse]) - tag.pulse for tag in tags if seen[tag.pulse])
    mixed = sum(stamps not in ({number + first}, set()) for number, stamps in seen.items())
    fates = [tag.cameras[_VICTIM].status for tag in tags]
    if fates[-1] is not FrameStatus.OK:
        return Row(case.words, "does not come back", "", case.cause, mixed)
    said = [event.message for event in verify(log).events if event.name == rig.cameras[_VICTIM].name]
    return Row(case.words, _told(fates), _said(said), case.cause, mixed)


def _told(fates: list[FrameStatus]) -> str:
    """The tags of one camera except those of whole frames; the length of an absence depends on the machine."""
    holes = [list(run) for whole, run in groupby(fates, lambda fate: fate is FrameStatus.OK) if not whole]
    words = []
    for hole in holes:
        runs = [(fate, len(list(run))) for fate, run in groupby(hole)]
        words.append(", then ".join(_run(fate, count) for fate, count in runs))
    return "; ".join(words) or "all ok"


def _run(fate: FrameStatus, count: int) -> str:
    if fate is FrameStatus.ABSENT:
        return "`absent` until it is back"
    return f"`{fate}`" if count == 1 else f"`{fate}` {count} times"


def _said(messages: list[str]) -> str:
    """The different events, without the parts that differ from run to run."""
    texts = dict.fromkeys(map(_without_numbers, messages))
    return "<br>".join(texts) or "none"


def _without_numbers(message: str) -> str:
    return re.sub(r"\bpulse \d+", "pulse …", re.sub(r"\b000a4701011b\d{4}\b", "…", message)).replace("|", "/")


def _fourth_camera(directory: Path) -> Row:
    """Four cameras at the rate of the paper do not fit on one bus."""
    rig = _rig(directory, 4)
    rig = rig.model_copy(update={"trigger": rig.trigger.model_copy(update={"rate_hz": 30.0})})
    words = "fourth camera on the bus, at 30 Hz"
    try:
        HeadlessRig(rig, "", _ignore)
    except BadInputError as error:
        return Row(
            words, "no recording begins", _without_numbers(str(error)), "need 5168 of its 4915 bandwidth units", 0
        )
    return Row(words, "not refused", "", "", 0)


def _ignore(_: str) -> None:
    """Events are read from the log."""


def table(found: list[Row]) -> str:
    """The rows in Markdown."""
    head = [f"| {' | '.join(_HEAD)} |", "|---|---|---|"]
    return "\n".join([*head, *(row.line() for row in found)])


def committed() -> list[tuple[str, str, str]]:
    """The rows of the table in the documentation: fault, tags, events."""
    lines = PAGE.read_text().partition(BEGIN)[2].partition(END)[0].strip().splitlines()[2:]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return [(fault, tags, events) for fault, tags, events in cells]


def main() -> int:
    """Write the table into the documentation."""
    with tempfile.TemporaryDirectory() as directory:
        found = list(rows(Path(directory)))
    if any(row.mixed for row in found):
        sys.stderr.write(f"pulses are mixed: {found}\n")
        return 1
    before, _, rest = PAGE.read_text().partition(BEGIN)
    PAGE.write_text(f"{before}{BEGIN}\n\n{table(found)}\n\n{END}{rest.partition(END)[2]}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
