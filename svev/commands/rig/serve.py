"""`svev serve`: runs the service with its control panel."""

from pathlib import Path
from typing import Annotated

import typer

from svev.serving.composition import ServiceSettings
from svev.serving.composition import serve as run_service
from webpanel.door.access import Access
from webpanel.door.tls import Tls


def serve(
    rig: Annotated[Path, typer.Option(metavar="RIG.toml", help="rig file, e.g. config/rigs/sim.toml")],
    host: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS", help="address at which the panel answers; any but this computer's own needs a token"
        ),
    ] = "127.0.0.1",
    port: Annotated[
        int, typer.Option(metavar="PORT", min=0, max=65535, help="port of the panel; 0: any that is free")
    ] = 8000,
    data: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="folder for recordings, made if missing; the rig file's if left out"),
    ] = None,
    token_file: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="file with the token, or with one for each role; the variable SVEV_TOKEN if left out"
        ),
    ] = None,
    allow_host: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME", help="a name by which other computers call this one, e.g. hillpc.local; repeatable"
        ),
    ] = None,
    proxy: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ADDRESS",
            help="address of a web server that passes requests on, whose X-Forwarded headers count; repeatable",
        ),
    ] = None,
    tls_certificate: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="certificate with which the panel speaks HTTPS; svev certificate makes one"),
    ] = None,
    tls_key: Annotated[Path | None, typer.Option(metavar="FILE", help="private key of the certificate")] = None,
    preroll: Annotated[
        float | None,
        typer.Option(
            metavar="S", min=0, max=600, help="seconds held in memory while armed; the rig file's if left out"
        ),
    ] = None,
) -> None:
    """Run the rig as a service: arm and record from the control panel, a web page, or with svev ctl.

    Open the address that is printed in a browser on this computer. Ctrl-C ends the service; a recording in progress is
    finished first.

    Exit codes: 0 ended by a signal, 2 bad input, or another service uses the port or the folder, 6 a process did not
    end in time.

    Example: svev serve --rig config/rigs/sim.toml
    """
    access = Access.for_address(host, token_file, allow_host or (), proxies=proxy or ())
    run_service(ServiceSettings(rig, data, port, access, preroll, Tls.of(tls_certificate, tls_key)))
