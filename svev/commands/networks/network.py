"""`svev network`: network files out of files of other programs, and files of these out of networks and results."""

from pathlib import Path
from typing import Annotated

import typer

from photogrammetry.exchange.exporting import Form, exported
from photogrammetry.exchange.importing import import_network
from photogrammetry.network.file_writer import write_network
from photogrammetry.programming.oriented import read_oriented
from svev import console
from svev.commands.networks.delivery import refuse_overwriting
from svev.overwriting import ForceOption, refuse_existing

app = typer.Typer(no_args_is_help=True, rich_markup_mode=None)


@app.callback()
def network() -> None:
    """Take cameras, poses and points from other programs, and give them to these.

    Example: svev network import model/ balls.csv -o network.json
    """


@app.command("import", short_help="Make a network file of other programs' files.", no_args_is_help=True)
def import_command(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE",
            help="the result of svev calibrate (.json), COLMAP's folder or files (.txt, .bin), OpenCV calibrations "
            "(.yml, .json, .xml), those of anipose (.toml), a PhotoModeler export "
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

    Example: svev network import calibration.json balls.csv -o survey.json
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


@app.command("export", short_help="Write files for other programs.", no_args_is_help=True)
def export_command(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="result (svev-adjustment/1) or network (svev-network/1) with poses", show_default=False
        ),
    ],
    form: Annotated[
        Form,
        typer.Option(
            "--to",
            metavar="PROGRAM",
            help="opencv: a FileStorage for each camera; colmap: a text model; "
            "toml: calibration.toml for anipose, FreeMoCap and Pose2Sim, camera_array.toml for caliscope",
        ),
    ],
    output: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="folder to write into")],
    force: ForceOption = False,
    as_json: Annotated[bool, typer.Option("--json", help="end with one JSON object")] = False,
) -> None:
    """Give cameras, poses and points to other programs; say what is lost.

    Exit codes: 0 done, 2 bad input.

    Example: svev network export poses.json --to toml -o cameras
    """
    made = exported(read_oriented(source), form)
    for name in made.files:
        refuse_overwriting(output / name, source)
        refuse_existing(output / name, force=force)
    output.mkdir(parents=True, exist_ok=True)
    for name, text in made.files.items():
        (output / name).write_text(text, encoding="utf-8")
    for note in made.notes:
        console.say(f"note: {note}", aside=as_json)
    if as_json:
        console.print_json({"files": [str(output / name) for name in made.files], "notes": list(made.notes)})
    else:
        console.say(f"in {output}: {', '.join(made.files)}")
