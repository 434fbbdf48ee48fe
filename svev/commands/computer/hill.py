"""`svev setup`: asks what a new hill needs, writes its files, and rehearses."""

import shlex
import sys
from functools import partial
from ipaddress import IPv4Network
from pathlib import Path
from typing import Annotated

import typer

from recorder.publishing.keys import check_publication
from rig.errors import BadInputError, SvevError
from rig.host.endings import counted_endings, interrupted_by_endings
from rig.settings.file import load_rig
from svev import console
from svev.commands.rig.record import aside
from svev.rehearsal import Rehearsed, rehearse
from svev.setup.answers import RIG, Answers, Today
from svev.setup.dialog import Dialog
from svev.setup.interview import Given, Interview
from svev.setup.places import SERVICE, Places
from svev.setup.search import pictures, search
from svev.setup.words import said
from svev.setup.writing import Written, write

_NOT_READY = 3
_INTERRUPTED = 130
_UNIT = Path("/usr/local/lib/systemd/system/svev.service"), Path("/lib/systemd/system/svev.service")


def setup(
    folder: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="of the files; /etc/svev with root, ~/svev-hill without, if left out",
            show_default=False,
        ),
    ] = None,
    language: Annotated[str | None, typer.Option(metavar="en|nb", help="of the questions: en or nb")] = None,
    name: Annotated[str | None, typer.Option(metavar="NAME", help="of the hill")] = None,
    camera: Annotated[
        list[str] | None,
        typer.Option(metavar="ADDRESS", help="address of a camera, or NAME=ADDRESS; repeatable, from left to right"),
    ] = None,
    network: Annotated[
        str | None,
        typer.Option(metavar="NETWORK", help="look for GigE Vision cameras in this network only, e.g. 192.168.11.0/24"),
    ] = None,
    trigger: Annotated[
        str | None,
        typer.Option(
            metavar="SOURCE",
            help="who makes the pulses: external, triggerbox, gpio, action, iidc-broadcast or software",
        ),
    ] = None,
    rate: Annotated[str | None, typer.Option(metavar="HZ", help="pulses per second")] = None,
    trigger_input: Annotated[
        str | None, typer.Option(metavar="NAME", help="input of GigE Vision cameras with the cable")
    ] = None,
    trigger_port: Annotated[str | None, typer.Option(metavar="FILE", help="device file of a trigger box")] = None,
    trigger_line: Annotated[
        str | None, typer.Option(metavar="LINE", help="line of this computer that makes the pulses")
    ] = None,
    survey: Annotated[str | None, typer.Option(metavar="FILE", help='file of the surveyed balls, or "none"')] = None,
    recordings: Annotated[str | None, typer.Option(metavar="DIR", help="folder of the recordings")] = None,
    phones: Annotated[
        bool | None, typer.Option("--phones/--no-phones", help="whether other computers reach the page")
    ] = None,
    call: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="name or address by which they call this computer; repeatable"),
    ] = None,
    https: Annotated[bool | None, typer.Option("--https/--no-https", help="whether the page has a certificate")] = None,
    yes: Annotated[
        bool, typer.Option("--yes", help="ask nothing: take the answers of today, or the usual ones")
    ] = False,
    rehearsal: Annotated[
        bool, typer.Option("--rehearse/--no-rehearse", help="whether a rehearsal is made at the end")
    ] = True,
    as_json: Annotated[bool, typer.Option("--json", help="end with one JSON object")] = False,
) -> None:
    """Set up a hill: ask what it needs, write its files, rehearse.

    Finds the cameras and shows a picture of each, so that you can name them from left to right. Asks for the trigger,
    the survey, the folder of the recordings, and who may reach the page. Then writes the rig file, the options of the
    service with token and certificate, and makes a rehearsal. Call it again at any time: it shows today's answers,
    keeps what it does not ask about, and keeps the former files. Nothing is changed before the last answer; Ctrl-C
    leaves everything as it was. Each option answers a question, which is then not asked.

    Exit codes: 0 ready, 2 bad input, or no camera and nobody to ask, 3 the files are written, but the rehearsal says
    what is wrong, 130 interrupted, nothing is changed.

    Example: sudo svev setup

    Example: svev setup --yes --camera K1=192.168.11.2 --camera K2=192.168.12.2 --trigger external --no-phones
    """
    places = Places.of(folder)
    if network is not None:
        _check_network(network)
    if not yes and not sys.stdin.isatty():
        raise BadInputError("there is no terminal to ask at: answer by options, and add --yes for all others")
    given = Given(
        language, name, tuple(camera or ()), trigger, rate, trigger_input, trigger_port, trigger_line, survey,
        recordings, phones, tuple(call or ()), https,
    )  # fmt: skip
    dialog = Dialog(asks=not yes, aside=as_json)
    today = Today.of(places.folder)
    try:
        with interrupted_by_endings():
            with pictures() as place:
                answers = Interview(given, today, places, dialog, partial(search, place, network or "")).ask()
            written = write(answers, today, places)
    except KeyboardInterrupt:
        console.say("", aside=True)
        dialog.aside = True
        dialog.say("ended")
        raise typer.Exit(_INTERRUPTED) from None
    _tell_files(written, dialog)
    done, failed = _rehearse(places.folder / RIG, dialog) if rehearsal else (None, "")
    commands = _tell_how_to_start(answers, today, places, written, dialog)
    if as_json:
        console.print_json(_as_json(answers, today, places, written, commands) | _rehearsed_json(done, failed))
    if failed or (done is not None and not done.ready):
        raise typer.Exit(_NOT_READY)


def _check_network(text: str) -> None:
    try:
        IPv4Network(text)
    except ValueError as error:
        raise BadInputError(f"--network {text}: {error}; give one like 192.168.11.0/24") from None


def _tell_files(written: Written, dialog: Dialog) -> None:
    for path in written.written:
        dialog.say("wrote", path=path)
    for path in written.kept:
        dialog.say("kept", path=path)
    for path in written.backups:
        dialog.say("backup", path=path)


def _rehearse(rig: Path, dialog: Dialog) -> tuple[Rehearsed | None, str]:
    """Rehearse with the new rig file: what it showed, or why it failed."""
    dialog.say("rehearsing")
    settings = load_rig(rig)
    try:
        check_publication(settings.network)
        with counted_endings() as asks:
            text = rig.read_text(encoding="utf-8")
            done = rehearse(settings, text, settings.recorder.directory, 5.0, aside, console.progress, asks)
    except (SvevError, OSError, KeyboardInterrupt) as error:
        why = said(dialog.language, "broken_off") if isinstance(error, KeyboardInterrupt) else str(error)
        dialog.say("not_rehearsed", why=why)
        dialog.say("again", rig=rig)
        return None, why
    if done.ready:
        dialog.say("ready", verdict=done.verdict)
    else:
        dialog.say("not_rehearsed", why=done.verdict.removeprefix("not ready: "))
        dialog.say("again", rig=rig)
    return done, ""


def _page(answers: Answers, today: Today) -> str:
    """Address of the page, as other computers call it, or this one."""
    scheme = "https" if answers.https else "http"
    return f"{scheme}://{answers.names[0] if answers.phones else '127.0.0.1'}:{today.options.port}/"


def _tell_how_to_start(answers: Answers, today: Today, places: Places, written: Written, dialog: Dialog) -> list[str]:
    """Say how the service is started, and where its page is.

    Returns:
        The commands that need root.
    """
    svev = sys.argv[0] if Path(sys.argv[0]).name == "svev" else "svev"
    installed = (
        []
        if any(unit.exists() for unit in _UNIT)
        else ["sudo make install    # in the checkout; or install of a bundle"]
    )
    start = ["sudo systemctl daemon-reload", "sudo systemctl enable svev", "sudo systemctl restart svev"]
    if places.state is not None:
        commands = [*installed, *start]
        dialog.say("start_service")
    else:
        options = today.options.read(places.folder / "options").words
        by_hand = [svev, "serve", "--rig", str(places.folder / RIG), *options]
        dialog.say("start_by_hand", command=shlex.join(by_hand))
        again = ["sudo", svev, "setup", "--folder", str(SERVICE), "--yes", *answers.command_line()]
        if answers.recordings != places.recordings:
            again += ["--recordings", str(answers.recordings)]
        commands = [*installed, shlex.join(again), *start]
        dialog.say("needs_root", folder=SERVICE)
    for command in commands:
        dialog.plain(f"  {command}")
    dialog.say("address", url=_page(answers, today))
    if written.token:
        dialog.say("token", token=written.token)
    if written.authority is not None:
        dialog.say("authority", path=written.authority)
    return commands


def _as_json(
    answers: Answers, today: Today, places: Places, written: Written, commands: list[str]
) -> dict[str, object]:
    return {
        "rig": str(places.folder / RIG),
        "cameras": [{"name": each.name, "backend": each.backend, "address": each.address} for each in answers.cameras],
        "recordings": str(answers.recordings),
        "page": _page(answers, today),
        "written": [str(path) for path in written.written],
        "kept": [str(path) for path in written.kept],
        "backups": [str(path) for path in written.backups],
        "commands": commands,
    }


def _rehearsed_json(done: Rehearsed | None, failed: str) -> dict[str, object]:
    if failed:
        return {"rehearsal": {"ready": False, "verdict": failed}}
    return {"rehearsal": None if done is None else {"ready": done.ready, "verdict": done.verdict}}
