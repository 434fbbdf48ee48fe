"""What the commands of `svev ctl` share: options that may stand anywhere, calls of the service, answers shown."""

import urllib.parse
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer
from typer.core import TyperGroup

from svev import console
from svev.rest_client import RestClient

if TYPE_CHECKING:
    from svev.answers import Kind

#: Options of all commands together, each with a value.
_EVERYWHERE: Final = ("--url", "--token-file")

Json = Annotated[bool, typer.Option("--json", help="print the service's answer as one JSON object")]


class AnywhereGroup(TyperGroup):
    """Commands of which the common options may stand anywhere in the line, also behind the command."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the arguments, the common options first."""
        return super().parse_args(ctx, _common_first(args))


def _common_first(args: Sequence[str]) -> list[str]:
    """The arguments, with the common options and their values at the front; behind `--` stand no options."""
    end = args.index("--") if "--" in args else len(args)
    front: list[str] = []
    rest: list[str] = []
    place = 0
    while place < end:
        is_common = args[place].partition("=")[0] in _EVERYWHERE
        length = 2 if is_common and "=" not in args[place] else 1
        (front if is_common else rest).extend(args[place : place + length])
        place += length
    return [*front, *rest, *args[max(place, end) :]]


def call(context: typer.Context, method: str, path: str, body: dict[str, object] | bytes | None = None) -> Any:
    """Call the service; errors as `svev.rest_client.RestClient.call`."""
    return client_of(context).call(method, path, body)


def client_of(context: typer.Context) -> RestClient:
    """The client of the service that the command line names."""
    client: RestClient = context.obj
    return client


def show(answer: Any, kind: "Kind", as_json: bool) -> None:
    """Print an answer as JSON, or as lines for people."""
    if as_json:
        console.print_json(answer)
        return
    from svev.answers import lines_of  # noqa: PLC0415 - with the models of the API, which take 0.1 s

    for line in lines_of(kind, answer):
        console.say(line)


def path_of(recording: str) -> str:
    """Path of a recording in the API."""
    return f"/api/recordings/{urllib.parse.quote(recording, safe='')}"
