"""`svev serve`: the service with its panel."""

from pathlib import Path
from typing import Annotated

import typer

from svev.service.composition import ServiceSettings
from svev.service.composition import serve as run_service
from webpanel.access import Access


def serve(
    rig: Annotated[Path, typer.Option(help="rig file, e.g. config/rigs/sim.toml")],
    host: Annotated[str, typer.Option(help="address to listen on; other than loopback needs a token")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="port to listen on; 0: any that is free")] = 8000,
    data: Annotated[
        Path | None, typer.Option(help="folder for recordings, made if missing; the rig file's if left out")
    ] = None,
    token_file: Annotated[
        Path | None, typer.Option(help="file that holds the token; the variable SVEV_TOKEN if left out")
    ] = None,
    allow_host: Annotated[
        list[str] | None, typer.Option(help="a name by which others call this computer, e.g. hillpc.local; repeatable")
    ] = None,
    preroll: Annotated[
        float | None, typer.Option(min=0, max=600, help="seconds kept while armed; the rig file's if left out")
    ] = None,
) -> None:
    """Run the rig as a service, with the control panel and its REST API. Ctrl-C ends it, and finishes a recording.

    Exit codes: 0 ended by a signal, 2 bad input, or another service uses the port or the folder, 6 something did not
    come to an end.

    Example: svev serve --rig config/rigs/sim.toml
    """
    access = Access.for_address(host, token_file, allow_host or ())
    run_service(ServiceSettings(rig, data, port, access, preroll))
