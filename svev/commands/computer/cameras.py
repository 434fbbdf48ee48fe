"""`svev cameras`: lists GigE Vision cameras, shows their features, gives them addresses."""

from collections import Counter
from collections.abc import Callable
from dataclasses import asdict
from ipaddress import IPv4Address
from itertools import groupby
from pathlib import Path
from typing import Annotated, Final

import typer

from rig.errors import BadInputError, CameraError
from rig.settings.file import load_rig
from svev import console
from svev.gige.gvcp import FoundCamera, ask_camera, ask_cameras, find_cameras, force_address

app = typer.Typer(
    help="Find GigE Vision cameras, show their features, give them addresses.",
    epilog="Example: svev cameras list",
    no_args_is_help=True,
)

_ANSWER_S: Final = 0.5
#: A camera that was given an address takes a moment until it answers there.
_LOOKS: Final = 3

Port = Annotated[
    str | None, typer.Option(metavar="PORT", help="look behind this network port only, e.g. enp2s0", show_default=False)
]
Json = Annotated[bool, typer.Option("--json", help="end with one JSON object")]


@app.command("list", short_help="List the cameras behind all ports.")
def list_command(
    interface: Port = None,
    rig: Annotated[
        Path | None,
        typer.Option(
            metavar="RIG.toml",
            help="ask at the addresses of this rig file too, for networks that carry no broadcast",
            show_default=False,
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """List the cameras behind all network ports, also those whose address fits no port.

    Example: svev cameras list

    Example: svev cameras list --rig /etc/svev/rig.toml
    """
    addresses = [] if rig is None else [each.address for each in load_rig(rig).cameras if each.backend == "aravis"]
    found = find_cameras(interface)
    there = {each.camera.address for each in found}
    found += ask_cameras((each for each in addresses if each not in there), _ANSWER_S)
    if as_json:
        console.print_json({"cameras": [_as_json(each) for each in found]})
        return
    times = Counter(each.camera.address for each in found)
    for each in found:
        camera, port = each.camera, each.interface
        what = (
            f"{camera.address:15} {camera.mac} {camera.vendor} {camera.model}, serial {camera.serial}, at {port.name}"
        )
        if each.asked:
            what += ", found by the rig file's address: it does not answer broadcasts here"
        elif not each.reachable:
            what += f", which reaches {port.network} only: svev cameras set-ip {camera.mac} ADDRESS"
        elif times[camera.address] > 1:
            what += f", an address that another camera has too: svev cameras set-ip {camera.mac} ADDRESS"
        console.say(what)
    if not found:
        console.say("no camera answers: check power and cables, and that no firewall blocks UDP port 3956")
        if rig is None:
            console.say("where the network carries no broadcast, give the addresses: svev cameras list --rig RIG.toml")


@app.command(short_help="Show the features of a camera.")
def show(
    address: Annotated[str, typer.Argument(metavar="ADDRESS", help="IP address of the camera")],
    as_json: Json = False,
) -> None:
    """Show the features of a camera: value, unit, what is allowed. Changes nothing.

    Exit codes: 0; 2 no camera answers there.

    Example: svev cameras show 192.168.11.2
    """
    from svev.gige.features import features  # noqa: PLC0415 - listing cameras needs no Aravis

    found = features(_address(address).exploded)
    if as_json:
        console.print_json({"address": address, "features": [asdict(feature) for feature in found]})
        return
    for category, group in groupby(found, key=lambda feature: feature.category):
        console.say(category)
        for feature in group:
            unit = f" {feature.unit}" if feature.unit else ""
            allowed = f" ({feature.allowed}{unit})" if feature.allowed else ""
            console.say(f"  {feature.name} = {feature.value}{unit}{allowed}")


@app.command("set-ip", short_help="Give a camera an IP address.")
def set_ip(
    camera: Annotated[
        str, typer.Argument(metavar="CAMERA", help="serial number, MAC address or present IP address of the camera")
    ],
    address: Annotated[str, typer.Argument(metavar="ADDRESS", help="its new IP address")],
    interface: Port = None,
    temporary: Annotated[bool, typer.Option("--temporary", help="only until the camera's power goes")] = False,
    as_json: Json = False,
) -> None:
    """Give a camera an IP address in the subnet of the network port that it is connected to.

    The camera need not be reachable at its present address. It keeps the new one when its power goes, unless
    --temporary. A camera that records keeps its address.

    Exit codes: 0; 2 no such camera, or the address does not fit; 5 the camera does not obey.

    Example: svev cameras set-ip DEV_000F31021A2B 192.168.11.2
    """
    keep = None if temporary else _keeper()
    found, wanted = find_cameras(interface), _address(address)
    chosen = _choose(camera, found)
    _check_address(wanted, chosen)
    force_address(chosen.camera.mac, chosen.interface, wanted)
    mask = str(chosen.interface.network.netmask)
    now = _look_again(chosen, wanted)
    if keep is not None:
        keep(str(wanted), mask)
    if as_json:
        console.print_json(_as_json(now) | {"kept": not temporary})
    else:
        until = "until its power goes" if temporary else "for good"
        console.say(f"{now.camera.model}, serial {now.camera.serial}: {wanted} {until}")


def _address(text: str) -> IPv4Address:
    try:
        return IPv4Address(text)
    except ValueError:
        raise BadInputError(f"{text}: is no IPv4 address; give one such as 192.168.11.2") from None


def _keeper() -> Callable[[str, str], None]:
    """What has a camera keep its address; without Aravis it is refused before the address changes."""
    from svev.gige.features import keep_address  # noqa: PLC0415 - see `show`

    return keep_address


def _choose(which: str, found: list[FoundCamera]) -> FoundCamera:
    """The camera that is meant."""
    wanted = which.lower().replace("-", ":")
    chosen = [each for each in found if which in {each.camera.serial, each.camera.address} or wanted == each.camera.mac]
    if len(chosen) == 1:
        return chosen[0]
    there = ", ".join(f"{each.camera.mac} serial {each.camera.serial} at {each.camera.address}" for each in found)
    if not chosen:
        raise BadInputError(
            f"{which}: no camera found by this (there: {there or 'none'}); give MAC address, serial number or address"
        )
    raise BadInputError(f"{which}: {len(chosen)} cameras have it (there: {there}); give the MAC address of one")


def _check_address(wanted: IPv4Address, chosen: FoundCamera) -> None:
    """Check that the port reaches the address, and that nobody has it."""
    port = chosen.interface
    if wanted not in port.network or wanted in {port.address, port.network[0], port.network[-1]}:
        raise BadInputError(
            f"{wanted}: is no free address in the subnet {port.network} of {port.name}, behind which the camera is; "
            f"choose one there (not {port.address}, the port's own), or give the port another"
        )
    try:
        there = ask_camera(str(wanted), _ANSWER_S)
    except (OSError, ValueError):
        there = None  # nobody, or no camera: a computer would be found by its owner
    if there is not None and there[0].mac != chosen.camera.mac:
        raise BadInputError(f"{wanted}: is the address of camera {there[0].serial}; choose another")


def _look_again(chosen: FoundCamera, wanted: IPv4Address) -> FoundCamera:
    """The camera at its new address.

    Raises:
        CameraError: it is not there.
    """
    for _ in range(_LOOKS):
        for each in find_cameras(chosen.interface.name):
            if each.camera.mac == chosen.camera.mac and each.camera.address == str(wanted):
                return each
    raise CameraError(
        f"camera {chosen.camera.serial} has not taken the address {wanted}: end the program that controls it, or "
        "switch the camera off and on, then set it again"
    )


def _as_json(found: FoundCamera) -> dict[str, object]:
    port = found.interface
    return asdict(found.camera) | {
        "interface": port.name,
        "subnet": str(port.network),
        "reachable": found.reachable,
        "asked": found.asked,
    }
