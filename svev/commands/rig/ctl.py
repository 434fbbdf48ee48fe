"""`svev ctl`: operate a running service from the command line."""

import time
import urllib.parse
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from rig.errors import BadInputError, CameraError, SvevError
from rig.host.files import TEXT_MAX, read_whole
from svev import console
from svev.calling import AnywhereGroup, Json, call, client_of, path_of, show
from svev.commands.rig.ctl_watching import doctor, log
from svev.fetch import fetch
from svev.rest_client import RestClient, read_token

_POLL_S: Final = 0.2

app = typer.Typer(
    cls=AnywhereGroup,
    help="Operate a running service (svev serve): arm, record, stop, list.",
    epilog="Exit codes: 0 done, 1 not possible in this state, 2 bad input or token, 4 no room, 5 a camera fault, "
    "6 the service does not answer; with --json errors are JSON too. --url and --token-file may stand anywhere. "
    "Example: svev ctl arm && svev ctl start --athlete 'Ola Nordmann' --bib 17",
    no_args_is_help=True,
    rich_markup_mode=None,
)


start_list_app = typer.Typer(
    help="The start list: show, load, undo.",
    epilog="Exit codes: as of svev ctl. Example: svev ctl startlist load list.csv",
    no_args_is_help=True,
    rich_markup_mode=None,
)
app.add_typer(start_list_app, name="startlist")
app.command(short_help="Show what happens, until Ctrl-C.")(log)
app.command(short_help="Have the service examine everything.")(doctor)

Id = Annotated[str, typer.Argument(metavar="ID", help="id of the recording, see svev ctl list")]
Wait = Annotated[
    float,
    typer.Option("--wait", metavar="S", min=0, max=600, help="wait at most so long until it is done; 0: not at all"),
]
Athlete = Annotated[str | None, typer.Option(metavar="NAME", help="who jumps")]
Bib = Annotated[str | None, typer.Option(metavar="TEXT", help="number on the jumper's bib")]
Gate = Annotated[str | None, typer.Option(metavar="TEXT", help="start gate")]
Wind = Annotated[str | None, typer.Option(metavar="TEXT", help="wind, in whatever words you use")]
Notes = Annotated[str | None, typer.Option(metavar="TEXT", help="anything else that should stand with the jump")]
Operator = Annotated[str | None, typer.Option(metavar="NAME", help="who records")]


@app.callback()
def _target(
    context: typer.Context,
    url: Annotated[
        str, typer.Option(metavar="URL", envvar="SVEV_URL", help="address of the service")
    ] = "http://127.0.0.1:8000",
    token_file: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="file that holds the token; without it, the variable SVEV_TOKEN is used"),
    ] = None,
) -> None:
    """Operate a running service (svev serve): arm, record, stop, list."""
    context.obj = RestClient(url, read_token(token_file))


@app.command(short_help="Show the state of rig, cameras and disk.")
def status(context: typer.Context, as_json: Json = False) -> None:
    """Show the state of the rig, its cameras, the disk and the recording in progress.

    Example: svev ctl status
    """
    show(call(context, "GET", "/api/status"), "status", as_json)


@app.command()
def arm(
    context: typer.Context,
    min_cameras: Annotated[
        int | None,
        typer.Option(metavar="N", min=1, max=8, help="so many are enough this time; as the rig file says if left out"),
    ] = None,
    wait_s: Wait = 60.0,
    as_json: Json = False,
) -> None:
    """Connect the cameras, and wait until that is done.

    Example: svev ctl arm
    """
    answer = call(context, "POST", "/api/arm", {"min_cameras": min_cameras})
    show(_awaited(context, answer, "arming", wait_s), "status", as_json)


@app.command()
def disarm(context: typer.Context, wait_s: Wait = 60.0, as_json: Json = False) -> None:
    """Disconnect the cameras.

    Example: svev ctl disarm
    """
    answer = call(context, "POST", "/api/disarm")
    show(_awaited(context, answer, "disarming", wait_s), "status", as_json)


@app.command()
def start(
    context: typer.Context,
    preroll: Annotated[
        float | None, typer.Option(metavar="S", min=0, help="begin so many seconds ago; all that are held if left out")
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(metavar="S", min=0, help="end after so many seconds; when stopped if left out")
    ] = None,
    athlete: Athlete = None,
    bib: Bib = None,
    gate: Gate = None,
    wind: Wind = None,
    notes: Notes = None,
    operator: Operator = None,
    as_json: Json = False,
) -> None:
    """Start recording.

    Example: svev ctl start --athlete "Ola Nordmann" --bib 17 --seconds 10
    """
    session = _given(athlete=athlete, bib=bib, gate=gate, wind=wind, notes=notes, operator=operator)
    order = session | _given(preroll_s=preroll, duration_s=seconds)
    show(call(context, "POST", "/api/recordings", order), "recording", as_json)


@app.command(short_help="Have a recording measured, and show it.")
def measure(context: typer.Context, recording: Id, wait_s: Wait = 0.0, as_json: Json = False) -> None:
    """Have a recording measured, again if it was measured before, and show its jumps; it waits while one is recorded.

    Example: svev ctl measure 2026-02-14T10-15-30Z --wait 120
    """
    path, until = f"{path_of(recording)}/measurement", time.monotonic() + wait_s
    answer = call(context, "POST", path)
    while answer["state"] in {"waiting", "measuring"} and time.monotonic() < until:
        time.sleep(_POLL_S)
        answer = call(context, "GET", f"{path}?jumps=false")
    show(answer, "measurement", as_json)


@app.command()
def stop(
    context: typer.Context,
    recording: Annotated[
        str, typer.Argument(metavar="ID", help="id; the recording in progress if left out", show_default=False)
    ] = "",
    as_json: Json = False,
) -> None:
    """Stop recording, and wait until the file is closed.

    Example: svev ctl stop
    """
    if not recording:
        current = call(context, "GET", "/api/status")["recording"]
        if current is None:
            raise SvevError("no recording is in progress: see svev ctl list")
        recording = current["id"]
    show(call(context, "POST", f"{path_of(recording)}/stop"), "recording", as_json)


@app.command(short_help="Record what has just happened.")
def save(
    context: typer.Context,
    seconds: Annotated[
        float | None, typer.Option(metavar="S", min=0, help="the last so many seconds; all that are held if left out")
    ] = None,
    athlete: Athlete = None,
    bib: Bib = None,
    gate: Gate = None,
    wind: Wind = None,
    notes: Notes = None,
    operator: Operator = None,
    as_json: Json = False,
) -> None:
    """Save what has just happened: record the last seconds, which are held in memory.

    Example: svev ctl save --seconds 5 --bib 17
    """
    session = _given(athlete=athlete, bib=bib, gate=gate, wind=wind, notes=notes, operator=operator)
    order = session | _given(preroll_s=seconds, duration_s=0)
    recording = call(context, "POST", "/api/recordings", order)
    show(call(context, "POST", f"{path_of(recording['id'])}/stop"), "recording", as_json)


@app.command("list")
def list_(
    context: typer.Context,
    search: Annotated[
        str, typer.Option(metavar="WORDS", help="only those in which all these words stand: id, bib, athlete, tags")
    ] = "",
    deleted: Annotated[bool, typer.Option("--deleted", help="list the recordings in the trash instead")] = False,
    as_json: Json = False,
) -> None:
    """List the recordings, newest first.

    Example: svev ctl list --search "17 nordmann"
    """
    wanted = urllib.parse.urlencode({"deleted": str(deleted).lower(), "search": search})
    found = call(context, "GET", f"/api/recordings?{wanted}")
    if as_json:
        console.print_json({"recordings": found})
        return
    for recording in found:
        show(recording, "recording", as_json=False)
    if not found:
        console.say("no recordings")


@app.command(short_help="Change session fields of a recording.")
def session(
    context: typer.Context,
    recording: Id,
    athlete: Athlete = None,
    bib: Bib = None,
    gate: Gate = None,
    wind: Wind = None,
    notes: Notes = None,
    operator: Operator = None,
    as_json: Json = False,
) -> None:
    """Change session fields of a recording; those left out stay.

    Example: svev ctl session 2026-02-14T10-15-30Z --bib 18
    """
    change = _given(athlete=athlete, bib=bib, gate=gate, wind=wind, notes=notes, operator=operator)
    show(call(context, "PATCH", path_of(recording), change), "recording", as_json)


@app.command("next", short_help="Show or change the next jumper.")
def next_(
    context: typer.Context,
    athlete: Athlete = None,
    bib: Bib = None,
    gate: Gate = None,
    wind: Wind = None,
    notes: Notes = None,
    operator: Operator = None,
    as_json: Json = False,
) -> None:
    """Show whom the next recording is of, or change it; a bib of the start list makes its jumper the next one.

    Example: svev ctl next --bib 18
    """
    change = _given(athlete=athlete, bib=bib, gate=gate, wind=wind, notes=notes, operator=operator)
    method, body = ("PATCH", change) if change else ("GET", None)
    show(call(context, method, "/api/next-jumper", body), "next jumper", as_json)


@app.command()
def skip(context: typer.Context, as_json: Json = False) -> None:
    """Pass over the next jumper.

    Example: svev ctl skip
    """
    show(call(context, "POST", "/api/next-jumper/skip"), "start list", as_json)


@start_list_app.command("show", short_help="Show who has jumped, is next, and waits.")
def show_start_list(context: typer.Context, as_json: Json = False) -> None:
    """Show the start list: those who have jumped, the next one, those who wait.

    Example: svev ctl startlist show
    """
    show(call(context, "GET", "/api/start-list"), "start list", as_json)


@start_list_app.command("load", short_help="Replace the start list by a table.")
def load_start_list(
    context: typer.Context,
    table: Annotated[
        Path, typer.Argument(metavar="FILE", help="CSV file or Excel workbook, with a line that names the columns")
    ],
    encoding: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="of its letters, if they can be read in several ways, e.g. mac-roman"),
    ] = None,
    sheet: Annotated[str | None, typer.Option(metavar="NAME", help="of a workbook with several lists")] = None,
    as_json: Json = False,
) -> None:
    """Replace the start list by a table with the columns bib, athlete, gate, club and own ones.

    Example: svev ctl startlist load list.csv
    """
    try:
        content = read_whole(table, TEXT_MAX, links=True)
    except OSError as error:
        raise BadInputError(f"{table}: cannot be read ({error.strerror}); correct the path") from None
    chosen = {name: value for name, value in (("encoding", encoding), ("sheet", sheet)) if value is not None}
    path = f"/api/start-list?{urllib.parse.urlencode(chosen)}" if chosen else "/api/start-list"
    show(call(context, "PUT", path, content), "start list", as_json)


@start_list_app.command("undo", short_help="Take the last change back.")
def undo(context: typer.Context, as_json: Json = False) -> None:
    """Take the last change of the start list back.

    Example: svev ctl startlist undo
    """
    show(call(context, "POST", "/api/start-list/undo"), "start list", as_json)


@app.command()
def delete(context: typer.Context, recording: Id, as_json: Json = False) -> None:
    """Put a recording into the trash.

    Example: svev ctl delete 2026-02-14T10-15-30Z
    """
    show(call(context, "DELETE", path_of(recording)), "recording", as_json)


@app.command()
def restore(context: typer.Context, recording: Id, as_json: Json = False) -> None:
    """Take a recording out of the trash.

    Example: svev ctl restore 2026-02-14T10-15-30Z
    """
    show(call(context, "POST", f"{path_of(recording)}/restore"), "recording", as_json)


@app.command(short_help="Fetch files of recordings, and check them.")
def download(
    context: typer.Context,
    recordings: Annotated[list[str], typer.Argument(metavar="ID", help="ids of the recordings, see svev ctl list")],
    folder: Annotated[
        Path, typer.Option("-o", "--out", metavar="DIR", help="folder to put them into, made if missing")
    ] = Path(),
    as_json: Json = False,
) -> None:
    """Fetch the files of recordings, with their session as it was corrected, and check that they came whole.

    A connection that breaks goes on where it broke.

    Example: svev ctl download 2026-02-14T10-15-30Z -o jumps
    """
    client = client_of(context)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInputError(f"{folder}: cannot be made ({error.strerror}); choose another folder with -o") from None
    found = []
    for recording in recordings:
        with console.progress(f"fetching {recording}", 100) as advance:
            path = fetch(
                client, f"{path_of(recording)}/file", folder, lambda have, of: advance(have * 100 // max(1, of))
            )
        found.append(str(path))
    if as_json:
        console.print_json({"files": found})
        return
    for file in found:
        console.say(file)


@app.command(short_help="Say what lies in the trash, or empty it.")
def trash(
    context: typer.Context,
    empty: Annotated[bool, typer.Option("--empty", help="remove everything in it for good")] = False,
    remove: Annotated[str, typer.Option("--remove", metavar="ID", help="remove this recording in it for good")] = "",
    as_json: Json = False,
) -> None:
    """Say how much lies in the trash and what its removal frees; or remove it for good.

    Example: svev ctl trash --empty
    """
    if empty and remove:
        raise BadInputError("--empty removes everything, --remove one recording: give one of the two")
    path = f"/api/trash/{urllib.parse.quote(remove, safe='')}" if remove else "/api/trash"
    answer = call(context, "DELETE" if empty or remove else "GET", path)
    show(answer, "removed" if empty or remove else "trash", as_json)


def _awaited(context: typer.Context, answer: Any, passing: str, wait_s: float) -> Any:
    """Wait until the rig has left the state `passing`, and return the status then.

    Raises:
        CameraError: it went into the state fault.
        SvevError: it is still in `passing` after `wait_s`.
    """
    deadline = time.monotonic() + wait_s
    while answer["state"] == passing and wait_s:
        if time.monotonic() > deadline:
            raise SvevError(f"still {passing} after {wait_s:g} s: {answer['statement']['text']}; see svev ctl status")
        time.sleep(_POLL_S)
        answer = call(context, "GET", "/api/status")
    if answer["state"] == "fault":
        raise CameraError(f"{answer['statement']['text']}; {answer['statement']['advice']}")
    return answer


def _given(**fields: object) -> dict[str, object]:
    return {name: value for name, value in fields.items() if value is not None}
