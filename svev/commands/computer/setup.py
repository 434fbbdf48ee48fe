"""`svev doctor`, `svev schema` and `svev keys`: help with setting up a computer and its rig file."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

import typer

from recorder.publishing.keys import make_keys
from rig.settings.file import CONFIG, load_rig, rig_schema
from service.alarms.delivery import DEADLINE_S
from svev import console
from svev.doctor.cameras.gige import look_for_cameras
from svev.doctor.examination import Probe, firewire_probes, probes, run_probe
from svev.doctor.finding import Finding, Topic
from svev.doctor.printing import counts_of, end_with, print_findings
from svev.doctor.webhook import send_test, target_of
from svev.overwriting import ForceOption, refuse_existing


def doctor(
    rig: Annotated[
        Path | None,
        typer.Option(
            metavar="RIG.toml",
            help="rig file to examine the computer for; the simulated hill if left out",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", metavar="DIR", help="folder of the recordings; the rig file's if left out"),
    ] = None,
    bus: Annotated[
        Literal["firewire"] | None,
        typer.Option(
            metavar="firewire",
            help="examine this bus only, and try each camera on it: set it up, 2 s of frames, a bus reset",
        ),
    ] = None,
    find: Annotated[
        bool, typer.Option("--find", help="only look for cameras on all networks, and compare them with the rig file")
    ] = False,
    send: Annotated[
        bool, typer.Option("--send-test", help="only send a test to the webhook that the rig file names")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="end with one JSON object")] = False,
) -> None:
    """Examine computer, network, disk and cameras before a recording: PASS, WARN or FAIL, and what to do.

    Writes up to 256 MB into the folder of the recordings and removes them again. GigE Vision cameras that nobody uses
    are set up as for a recording and set back. With --bus FireWire cameras are tried: not while recording.

    Exit codes: 0 no FAIL, 2 bad input, 3 at least one FAIL.

    Example: svev doctor --rig config/rigs/hill-gige.toml

    Example: svev doctor --find --rig /etc/svev/rig.toml

    Example: svev doctor --bus firewire --rig config/rigs/hill-iidc.toml

    Example: svev doctor --send-test --rig /etc/svev/rig.toml
    """
    usual = "hill-gige.toml" if find else "hill-iidc.toml" if bus else "sim-gige.toml"
    if rig is None:
        text = f"no --rig is given: looking at the computer for {CONFIG / 'rigs' / usual}, not for your rig file"
        console.say(text, aside=True)
    settings = load_rig(rig or CONFIG / "rigs" / usual)
    if find:
        todo = [Probe("discovery", Topic.CAMERAS, lambda: look_for_cameras(settings), limit_s=10.0)]
    elif send:
        target = target_of(settings)
        todo = [Probe("webhook", Topic.NETWORK, lambda: send_test(settings, target), limit_s=3 * DEADLINE_S)]
    else:
        todo = firewire_probes(settings) if bus else probes(settings, out or settings.recorder.directory)
    findings: list[Finding] = []
    with console.progress("examining", len(todo)) as advance:
        for done, probe in enumerate(todo, start=1):
            findings += run_probe(probe)
            advance(done)
    if as_json:
        counts = counts_of(findings)
        console.print_json(
            {"rig": settings.name, "findings": [asdict(finding) for finding in findings], "counts": counts}
        )
    else:
        console.say(f"examined for: {settings.name}")
        print_findings(findings)
    end_with(findings)


def schema(
    output: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="FILE", help="write it to this file instead")
    ] = None,
    force: ForceOption = False,
) -> None:
    """Print the JSON schema of the rig file, for editors that check and complete TOML while you type.

    Example: svev schema -o rig.schema.json
    """
    if output is None:
        console.say_text(rig_schema().rstrip())
    else:
        refuse_existing(output, force=force)
        output.write_text(rig_schema(), encoding="utf-8")


def keys(
    name: Annotated[
        Path, typer.Argument(metavar="NAME", help="beginning of the names of both files, e.g. /etc/svev/hill")
    ],
    as_json: Annotated[bool, typer.Option("--json", help="end with one JSON object")] = False,
) -> None:
    """Make a pair of keys (ZeroMQ CURVE), so that only programs that have one of them can take published images.

    NAME.key_secret stays on this computer: name it in the rig file, `curve_key_file` in `[network]`. NAME.key is for
    subscribers; whoever has it may subscribe. Existing files are never overwritten.

    Exit codes: 0; 2 a file exists already or cannot be written.

    Example: svev keys hill
    """
    secret, public = make_keys(name)
    if as_json:
        console.print_json({"secret": str(secret), "public": str(public)})
        return
    console.say(f'{secret}: for the publisher; in the rig file: [network] curve_key_file = "{secret}"')
    console.say(f"{public}: for subscribers; give it only to those who may see the images")
