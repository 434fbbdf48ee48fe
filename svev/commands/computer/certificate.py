"""`svev certificate`: makes what `svev serve` needs to speak HTTPS."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from svev import console
from svev.serving.certificates import make_certificate


def certificate(
    name: Annotated[
        list[str],
        typer.Option(
            metavar="NAME", help="name or address by which others call this computer, e.g. hillpc.local; repeatable"
        ),
    ],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="folder for the files, made if missing")],
    as_json: Annotated[bool, typer.Option("--json", help="end with one JSON object")] = False,
) -> None:
    """Make a certificate for HTTPS, signed by an authority (CA) of your own, which phones are told to trust once.

    The folder gets ca.crt (for phones and programs), ca.key (keep it secret), server.crt and server.key. If the CA is
    there already, it signs a new certificate, and the phones need nothing new. A certificate lasts 825 days.

    Exit codes: 0; 2 a name is none, or the folder's CA is for other names; 6 openssl is missing.

    Example: svev certificate --name hillpc.local --name 192.168.1.20 --out /etc/svev/tls
    """
    files = make_certificate(name, out)
    if as_json:
        console.print_json({role: str(path) for role, path in asdict(files).items()})
        return
    console.say(f"{files.authority}: install it on phones and computers as a certificate authority")
    console.say(f"{files.authority_key}: secret; signs the next certificate")
    console.say(f"svev serve --tls-certificate {files.certificate} --tls-key {files.key}")
