"""`svev network`: network files out of files of other programs."""

from pathlib import Path
from typing import Annotated

import typer

from photogrammetry.exchange.importing import import_network
from photogrammetry.network.file_writer import write_network
from svev import console
from svev.commands.networks.delivery import refuse_overwriting
from svev.overwriting import ForceOption, refuse_existing

app = typer.Typer(no_args_is_help=True, rich_markup_mode=None)


@app.callback()
def network() -> None:
    """Make network files out of files of other programs.

    Example: svev network import model/ balls.csv -o network.json
    """


@app.command("import", no_args_is_help=True)
def import_command(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE",
            help="COLMAP's folder or text files, OpenCV calibrations (.yml, .json, .xml), a PhotoModeler export "
            "(.txt), files of AICON (.ior, .eor, .phc, .obc), a survey (.csv: name, X, Y, Z, sigma)",
            show_default=False,
        ),
    ],
    output: Annotated[Path, typer.Option("-o", "--out", metavar="FILE", help="network file (svev-network/1) to write")],
    sigma: Annotated[
        float, typer.Option("--sigma", metavar="PX", min=1e-6, help="sigma of image points (px) whose file gives none")
    ] = 1.0,
    sigma_mm: Annotated[
        float | None, typer.Option("--sigma-mm", metavar="MM", min=1e-9, help="the same for files of AICON (mm)")
    ] = None,
    length_unit: Annotated[
        str, typer.Option("--length-unit", metavar="UNIT", help="unit of the object system, a label")
    ] = "m",
    force: ForceOption = False,
    as_json: Annotated[bool, typer.Option("--json", help="end with one JSON object")] = False,
) -> None:
    """Carry files of other programs over into one network file; say what was assumed and what was lost.

    Exit codes: 0 done, 2 bad input.

    Example: svev network import K1.yml K2.yml K3.yml balls.csv -o survey.json
    """
    inside = [path / each.name for path in files if path.is_dir() for each in path.iterdir()]
    refuse_overwriting(output, *files, *inside)
    refuse_existing(output, force=force)
    imported = import_network(files, sigma=sigma, sigma_mm=sigma_mm, length_unit=length_unit)
    write_network(imported.network, output)
    made = imported.network
    counts = {
        "cameras": len(made.cameras),
        "images": len(made.images),
        "points": len(made.points),
        "observations": len(made.observations.xy),
    }
    for note in imported.notes:
        console.say(f"note: {note}", aside=as_json)
    if as_json:
        console.print_json({"network": str(output), **counts, "notes": list(imported.notes)})
    else:
        console.say(f"network in {output}: " + ", ".join(f"{count} {what}" for what, count in counts.items()))
