"""Reads, writes, adjusts, calibrates and orients networks, as the commands do."""

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

from photogrammetry.adjustment.equations.unknowns import state_of
from photogrammetry.network.file import network_from_json, read_network
from photogrammetry.network.file_writer import write_network
from photogrammetry.network.model import Network
from photogrammetry.procedures.calibration import calibrate as calibrate_network
from photogrammetry.procedures.doubtful_poses import refuse_ambiguous
from photogrammetry.procedures.minima import adjust_least
from photogrammetry.procedures.orientation import orient as orient_network
from photogrammetry.procedures.stages import snoop_network
from photogrammetry.programming.results import Result
from photogrammetry.start_values.search import complete


def read(path: str | PathLike[str]) -> Network:
    """Read a network file (`svev-network/1`), JSON or TOML.

    Raises:
        BadInputError: missing, unreadable or no network; one line that names everything that is wrong.
    """
    return read_network(Path(path))


def network_from(data: Mapping[str, Any]) -> Network:
    """Make a network of the file's object, e.g. of a dict that a program puts together.

    Raises:
        BadInputError: one line that names everything that is wrong.
    """
    return network_from_json(data, "network")


def write(network: Network, path: str | PathLike[str]) -> None:
    """Write a network file."""
    write_network(network, Path(path))


def adjust(network: Network, *, snoop: bool = False) -> Result:
    """Adjust a network; poses and points without values are found (`svev adjust`).

    Args:
        network: any network.
        snoop: take out gross errors that can be located.

    Raises:
        BadInputError: nothing to adjust, or numbers that leave all bounds.
        NotSolvableError: the network does not determine its unknowns; `defects` says which and why.
        NotConvergedError: no optimum was reached.
        RefusedError: with `snoop`, the data contradict each other.
    """
    outcome = snoop_network(network) if snoop else adjust_least(network, state_of(complete(network)), network)
    refuse_ambiguous(network, outcome.adjustment)
    return Result(outcome)


def calibrate(network: Network) -> Result:
    """Estimate interior orientations from images of a frame of unknown targets (`svev calibrate`).

    Raises:
        BadInputError, NotSolvableError, NotConvergedError, RefusedError: as `adjust`.
    """
    calibration = calibrate_network(network)
    return Result(calibration.outcome, calibration.notes)


def orient(network: Network, *, alternative: int = 2, moving: str = "H*", uncertain_interior: bool = False) -> Result:
    """Estimate poses from reference points, with the search for gross errors in three stages (`svev orient`).

    Args:
        network: images, reference points and tie points.
        alternative: 1: static tie points alone; 2: moving ones too.
        moving: pattern of the moving points' names (`*` and `?`).
        uncertain_interior: interior parameters with a sigma are observations instead of constants.

    Raises:
        BadInputError, NotSolvableError, NotConvergedError, RefusedError: as `adjust`.
    """
    orientation = orient_network(network, alternative, moving, uncertain_interior=uncertain_interior)
    findings = (finding.message for stage in orientation.stages for finding in stage.findings)
    return Result(orientation.outcome, (*orientation.notes, *findings))
