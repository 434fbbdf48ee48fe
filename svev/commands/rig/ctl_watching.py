"""`svev ctl log` and `svev ctl doctor`: what the service tells of itself."""

import json
from collections.abc import Iterator
from datetime import datetime
from typing import Annotated, Any

import typer

from rig.errors import ProcessDiedError
from svev import console
from svev.calling import Json, call, client_of
from svev.doctor.finding import Finding, Level, Topic
from svev.doctor.printing import end_with, print_findings


def log(
    context: typer.Context,
    once: Annotated[bool, typer.Option("--once", help="end after what has happened")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="print each event as one JSON object on a line")] = False,
) -> None:
    """Show what has happened, the last thousand events, and what happens, until Ctrl-C.

    Example: svev ctl log --once
    """
    for event in _events(context, once=once):
        if as_json:
            console.print_json_line(event)
        else:
            time = datetime.fromisoformat(event["time"]).astimezone()
            console.say(f"{time:%H:%M:%S} {event['level']:7} {event['name']}: {event['message']}")


def _events(context: typer.Context, *, once: bool) -> Iterator[dict[str, Any]]:
    """The events of the service, oldest first.

    Raises:
        ProcessDiedError: the service has ended the stream.
    """
    kind, statuses = "", 0
    with client_of(context).answering("GET", "/api/events", more={"Accept": "text/event-stream"}) as answer:
        for line in answer.iter_lines():
            name, _, value = line.partition(": ")
            if name == "event":
                kind = value
                statuses += kind == "status"
            elif name == "data" and kind == "log":
                yield json.loads(value)
            if statuses > 1 and once:  # the kept events come between the first status and the second
                return
    raise ProcessDiedError("the service has ended: start it with svev serve, then call again")


def doctor(context: typer.Context, as_json: Json = False) -> None:
    """Have the service examine computer, network, disk and cameras; what would disturb an armed rig is left out.

    Exit codes: as of svev ctl, and 3 if there is a FAIL.

    Example: svev ctl doctor
    """
    answer = call(context, "GET", "/api/doctor")
    findings = [
        Finding(Level(each["level"]), Topic(each["topic"]), each["code"], each["what"], each["remedy"])
        for each in answer["findings"]
    ]
    if as_json:
        console.print_json(answer)
    else:
        print_findings(findings)
    end_with(findings)
