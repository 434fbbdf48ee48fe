"""`svev calibrate --pictures`: from pictures of printed targets to calibrated cameras."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import typer

from analysis.targets.calibrating import calibrate_pictures
from analysis.targets.network_of import MeasuredDistance
from analysis.targets.pattern import Layout
from analysis.targets.pictures import read_pictures
from analysis.targets.report import lines, report, to_json
from photogrammetry.network.file_writer import write_network
from rig.errors import BadInputError
from svev import console
from svev.commands.networks.delivery import as_record, deliver, origin, written
from svev.overwriting import in_report, refuse_existing

_DISTANCE: Final = re.compile(r"([BT][0-9a-d-]+),([BT][0-9a-d-]+),(\d+(?:\.\d+)?)(?:,(\d+(?:\.\d+)?))?")
_SIGMA_MM: Final = 0.5  # of a distance measured with a tape or ruler


def from_pictures(
    context: typer.Context,
    paths: Sequence[Path],
    out: Path,
    layout: Layout,
    distances: Sequence[str],
    camera: str | None,
    *,
    flat: bool,
    force: bool,
    as_json: bool,
) -> None:
    """Find targets, write the network, adjust it, write calibration and report into a folder.

    Raises:
        BadInputError: pictures or options that no calibration comes of.
        typer.Exit: 3 not solvable, 4 not converged or refused.
    """
    measured = [_distance(words) for words in distances]
    network_file, result_file = out / "network.json", out / "calibration.json"
    refuse_existing(network_file, result_file, *in_report(out), force=force)
    with console.progress("pictures", None) as done:
        pictures, left_out = read_pictures(paths, layout, camera, done)
    out.mkdir(parents=True, exist_ok=True)

    def calibrated() -> tuple[dict[str, object], list[str]]:
        made = calibrate_pictures(pictures, layout, measured, flat=flat)
        write_network(made.network, network_file)
        result = to_json(made)
        result["notes"] = [*left_out, *result["notes"]]
        came_from = origin(context, network=network_file)
        told = written(lambda: as_record(report(made), came_from, result, result_file), out)
        return result, [*(f"note: {note}" for note in left_out), *lines(made), f"network in {network_file}", *told]

    deliver(calibrated, result_file, as_json=as_json)


def _distance(words: str) -> MeasuredDistance:
    found = _DISTANCE.fullmatch(words.replace(" ", ""))
    if found is None:
        raise BadInputError(
            f"--distance {words}: write corner,corner,mm or corner,corner,mm,sigma, for instance T100a,T115c,1234.5,0.5"
        )
    return MeasuredDistance(found[1], found[2], float(found[3]), float(found[4] or _SIGMA_MM))
