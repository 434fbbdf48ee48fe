"""`svev rehearse`: some seconds through the whole chain to the real disk, judged and deleted."""

from pathlib import Path
from typing import Annotated, Final

import typer

from recorder.publishing.keys import check_publication
from rig.host.endings import counted_endings
from rig.settings.file import load_rig
from svev import console
from svev.commands.rig.record import aside
from svev.doctor.finding import Topic
from svev.doctor.printing import counts_of, end_with, print_findings
from svev.neighbours import naming_the_publisher
from svev.rehearsal import rehearse

_TOPICS: Final = tuple(Topic)


def rehearse_command(
    rig: Annotated[Path, typer.Option(metavar="RIG.toml", help="rig file, e.g. config/rigs/sim.toml")],
    seconds: Annotated[float, typer.Option(metavar="S", min=0.5, max=600, help="how much is recorded, seconds")] = 5.0,
    out: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--out",
            metavar="DIR",
            help="folder of the recordings; the rig file's if left out",
            show_default=False,
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="end with one JSON object")] = False,
) -> None:
    """Rehearse a recording: cameras, pairing, recorder and disk together, read back, judged, deleted again.

    Records for some seconds into the folder of the recordings, with everything that a recording needs. Reads the log
    back, checks every byte of it, recomputes its ledger, and deletes it. Says whether every frame came, whether the
    cameras are ready for the next pulse in time, how far apart they are triggered, how much faster disk and links are
    than needed ("headroom"), and how many jumps fit on the disk.

    Exit codes: 0 ready, 2 bad input, or a camera does not answer, 3 something speaks against it: the lines with FAIL
    say what and what to do, 4 the disk failed, hung, was too slow or has too little room, 5 the cameras are ready, but
    no pulses come, 6 the recorder died, 130 interrupted, with no verdict.

    Example: svev rehearse --rig config/rigs/sim.toml
    """
    settings = load_rig(rig)
    check_publication(settings.network)
    folder = out or settings.recorder.directory
    with naming_the_publisher(settings.network.publish), counted_endings() as asks:
        done = rehearse(settings, rig.read_text(encoding="utf-8"), folder, seconds, aside, console.progress, asks)
    if as_json:
        console.print_json(done.to_json() | {"counts": counts_of(done.findings)})
    else:
        print_findings(sorted(done.findings, key=lambda finding: _TOPICS.index(finding.topic)))
        console.say(done.verdict)
    end_with(done.findings)
