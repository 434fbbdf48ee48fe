"""`svev ctl`: operate a running service from the command line."""

import time
import urllib.parse
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from rig.errors import CameraError, SvevError
from svev import console
from svev.commands import ctl_output
from svev.rest_client import RestClient, read_token

_POLL_S: Final = 0.2

app = typer.Typer(
    help="Operate a running service (svev serve): arm, record, stop, list.",
    epilog="Exit codes: 0 done, 1 not possible in this state, 2 bad input or token, 4 no room, 5 a camera fault, "
    "6 the service does not answer. Example: svev ctl arm && svev ctl start --athlete 'Ola Nordmann' --bib 17",
    no_args_is_help=True,
    rich_markup_mode=None,
)


Id = Annotated[str, typer.Argument(help="id of the recording, see svev ctl list")]
Wait = Annotated[float, typer.Option("--wait", min=0, max=600, help="wait so long until it is done; 0: do not wait")]
Json = Annotated[bool, typer.Option("--json", help="print the service's answer as one JSON object")]
Text = Annotated[str | None, typer.Option()]


@app.callback()
def _target(
    context: typer.Context,
    url: Annotated[str, typer.Option(envvar="SVEV_URL", help="address of the service")] = "http://127.0.0.1:8000",
    token_file: Annotated[
        Path | None, typer.Option(help="file that holds the token; the variable SVEV_TOKEN if left out")
    ] = None,
) -> None:
    """Operate a running service (svev serve): arm, record, stop, list."""
    context.obj = RestClient(url, read_token(token_file))


@app.command()
def status(context: typer.Context, as_json: Json = False) -> None:
    """Say what the service does.

    Example: svev ctl status
    """
    client: RestClient = context.obj
    _show(client.call("GET", "/api/status"), ctl_output.status, as_json)


@app.command()
def arm(context: typer.Context, wait_s: Wait = 60.0, as_json: Json = False) -> None:
    """Connect the cameras, and wait until that is done.

    Example: svev ctl arm
    """
    client: RestClient = context.obj
    answer = client.call("POST", "/api/arm")
    _show(_awaited(client, answer, "arming", wait_s), ctl_output.status, as_json)


@app.command()
def disarm(context: typer.Context, wait_s: Wait = 60.0, as_json: Json = False) -> None:
    """Disconnect the cameras.

    Example: svev ctl disarm
    """
    client: RestClient = context.obj
    answer = client.call("POST", "/api/disarm")
    _show(_awaited(client, answer, "disarming", wait_s), ctl_output.status, as_json)


@app.command()
def start(
    context: typer.Context,
    preroll: Annotated[float | None, typer.Option(min=0, help="begin so many seconds ago; all that is held")] = None,
    seconds: Annotated[float | None, typer.Option(min=0, help="end by itself; until stopped if left out")] = None,
    athlete: Text = None,
    bib: Text = None,
    gate: Text = None,
    wind: Text = None,
    notes: Text = None,
    operator: Text = None,
    as_json: Json = False,
) -> None:
    """Start recording.

    Example: svev ctl start --athlete "Ola Nordmann" --bib 17 --seconds 10
    """
    client: RestClient = context.obj
    order = {
        "preroll_s": preroll, "duration_s": seconds, "athlete": athlete, "bib": bib, "gate": gate, "wind": wind,
        "notes": notes, "operator": operator,
    }  # fmt: skip
    _show(client.call("POST", "/api/recordings", _given(order)), ctl_output.recording, as_json)


@app.command()
def stop(
    context: typer.Context,
    recording: Annotated[
        str, typer.Argument(help="id; the recording in progress if left out", show_default=False)
    ] = "",
    as_json: Json = False,
) -> None:
    """Stop recording, and wait until the file is closed.

    Example: svev ctl stop
    """
    client: RestClient = context.obj
    if not recording:
        current = client.call("GET", "/api/status")["recording"]
        if current is None:
            raise SvevError("no recording is in progress: see svev ctl list")
        recording = current["id"]
    _show(client.call("POST", f"{_path(recording)}/stop"), ctl_output.recording, as_json)


@app.command()
def save(
    context: typer.Context,
    seconds: Annotated[float | None, typer.Option(min=0, help="so many seconds; all that are held if left out")] = None,
    as_json: Json = False,
) -> None:
    """Save what has just happened: the last seconds that are held in memory.

    Example: svev ctl save --seconds 5
    """
    client: RestClient = context.obj
    order = _given({"preroll_s": seconds, "duration_s": 0})
    recording = client.call("POST", "/api/recordings", order)
    _show(client.call("POST", f"{_path(recording['id'])}/stop"), ctl_output.recording, as_json)


@app.command("list")
def list_(
    context: typer.Context,
    deleted: Annotated[bool, typer.Option("--deleted", help="those in the trash")] = False,
    as_json: Json = False,
) -> None:
    """List the recordings, newest first.

    Example: svev ctl list
    """
    client: RestClient = context.obj
    found = client.call("GET", f"/api/recordings?deleted={str(deleted).lower()}")
    _show({"recordings": found}, ctl_output.recordings, as_json)


@app.command()
def session(
    context: typer.Context,
    recording: Id,
    athlete: Text = None,
    bib: Text = None,
    gate: Text = None,
    wind: Text = None,
    notes: Text = None,
    operator: Text = None,
    as_json: Json = False,
) -> None:
    """Change session fields of a recording; those left out stay.

    Example: svev ctl session 2026-02-14T10-15-30Z --bib 18
    """
    client: RestClient = context.obj
    change = {"athlete": athlete, "bib": bib, "gate": gate, "wind": wind, "notes": notes, "operator": operator}
    _show(client.call("PATCH", _path(recording), _given(change)), ctl_output.recording, as_json)


@app.command()
def delete(context: typer.Context, recording: Id, as_json: Json = False) -> None:
    """Put a recording into the trash.

    Example: svev ctl delete 2026-02-14T10-15-30Z
    """
    client: RestClient = context.obj
    _show(client.call("DELETE", _path(recording)), ctl_output.recording, as_json)


@app.command()
def restore(context: typer.Context, recording: Id, as_json: Json = False) -> None:
    """Take a recording out of the trash.

    Example: svev ctl restore 2026-02-14T10-15-30Z
    """
    client: RestClient = context.obj
    _show(client.call("POST", f"{_path(recording)}/restore"), ctl_output.recording, as_json)


def _show(answer: Any, words: Callable[[Any], str], as_json: bool) -> None:
    if as_json:
        console.print_json(answer)
    else:
        console.say(words(answer))


def _awaited(client: RestClient, answer: dict[str, Any], passing: str, wait_s: float) -> dict[str, Any]:
    """The status when a passing state is over.

    Raises:
        CameraError: it ended in a fault.
        SvevError: it is not over in time.
    """
    deadline = time.monotonic() + wait_s
    while answer["state"] == passing and wait_s:
        if time.monotonic() > deadline:
            raise SvevError(f"still {passing} after {wait_s:g} s: {answer['statement']['text']}; see svev ctl status")
        time.sleep(_POLL_S)
        answer = client.call("GET", "/api/status")
    if answer["state"] == "fault":
        raise CameraError(f"{answer['statement']['text']}; {answer['statement']['advice']}")
    return answer


def _given(fields: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in fields.items() if value is not None}


def _path(recording: str) -> str:
    return f"/api/recordings/{urllib.parse.quote(recording, safe='')}"
