"""`svev doctor`, `svev schema` and `svev keys`: help with setting up a computer and its rig file."""

from dataclasses import asdict
from itertools import groupby
from pathlib import Path
from typing import Annotated, Final, Literal

import typer

from recorder.publishing.keys import make_keys
from rig.settings.file import CONFIG, load_rig, rig_schema
from svev import console
from svev.doctor.examination import Probe, firewire_probes, probes, run_probe
from svev.doctor.finding import Finding, Level, Topic
from svev.doctor.gige_cameras import look_for_cameras

_STYLES: Final = {Level.PASS: "green", Level.WARN: "yellow", Level.FAIL: "bold red"}
_SOMETHING_FAILS: Final = 3


def doctor(
    rig: Annotated[
        Path | None,
        typer.Option(help="rig file to examine the computer for; the simulated hill if left out", show_default=False),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="folder of the recordings; the rig file's if left out")] = None,
    bus: Annotated[
        Literal["firewire"] | None,
        typer.Option(help="examine this bus only, and try each camera on it: set it up, 2 s of frames, a bus reset"),
    ] = None,
    find: Annotated[
        bool, typer.Option("--find", help="only look for cameras on all networks, and compare them with the rig file")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="end with one JSON object")] = False,
) -> None:
    """Examine computer, network, disk and cameras before a recording: PASS, WARN or FAIL, and what to do.

    Writes up to 256 MB into the folder of the recordings and removes them again. Does not change settings of the
    cameras, except with --bus: do not use that while recording.

    Exit codes: 0 no FAIL, 2 bad input, 3 at least one FAIL.

    Example: svev doctor --rig config/rigs/hill-gige.toml

    Example: svev doctor --find --rig /etc/svev/rig.toml

    Example: svev doctor --bus firewire --rig config/rigs/hill-iidc.toml
    """
    usual = "hill-gige.toml" if find else "hill-iidc.toml" if bus else "sim-gige.toml"
    settings = load_rig(rig or CONFIG / "rigs" / usual)
    if find:
        todo = [Probe("discovery", Topic.CAMERAS, lambda: look_for_cameras(settings), limit_s=10.0)]
    else:
        todo = firewire_probes(settings) if bus else probes(settings, out or settings.recorder.directory)
    findings: list[Finding] = []
    with console.progress("examining", len(todo)) as advance:
        for done, probe in enumerate(todo, start=1):
            findings += run_probe(probe)
            advance(done)
    counts = {level: sum(finding.level is level for finding in findings) for level in Level}
    if as_json:
        result = {"rig": settings.name, "findings": [asdict(finding) for finding in findings], "counts": counts}
        console.print_json(result)
    else:
        _print(settings.name, findings, counts)
    if counts[Level.FAIL]:
        raise typer.Exit(_SOMETHING_FAILS)


def _print(rig: str, findings: list[Finding], counts: dict[Level, int]) -> None:
    console.say(f"examined for: {rig}")
    for topic, group in groupby(findings, key=lambda finding: finding.topic):
        console.say(topic)
        for finding in group:
            remedy = f" -> {finding.remedy}" if finding.remedy else ""
            console.say_marked(finding.level, _STYLES[finding.level], finding.what + remedy)
    console.say(", ".join(f"{count} {level}" for level, count in counts.items()))


def schema(
    output: Annotated[Path | None, typer.Option("-o", "--output", help="write it to this file instead")] = None,
) -> None:
    """Print the JSON schema of the rig file, for editors that check and complete TOML while you type.

    Example: svev schema -o rig.schema.json
    """
    if output is None:
        console.say_text(rig_schema().rstrip())
    else:
        output.write_text(rig_schema(), encoding="utf-8")


def keys(
    name: Annotated[Path, typer.Argument(help="beginning of the names of both files, e.g. /etc/svev/hill")],
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
