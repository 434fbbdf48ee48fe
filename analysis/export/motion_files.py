"""Writes what other programs read of a measured recording into its folder: the table and a pair of files a jump."""

from pathlib import Path

from analysis.export import c3d_file, osim_file, table, trc_file
from analysis.export.places import SKI_LENGTH_M
from analysis.result.model import MeasuredRecording


def write(result: MeasuredRecording, folder: Path, ski_length_m: float = SKI_LENGTH_M) -> list[Path]:
    """Write `jumper.csv`, `jumper.c3d` and `jumper.trc`; a second jump is in `jumper-2.c3d` and `jumper-2.trc`.

    Beside them `jumper.osim` is the model for all TRC files, if there are any.

    Returns:
        The files written.

    Raises:
        OSError: the disk refuses.
    """
    written = [folder / "jumper.csv"]
    table.write(result, written[0])
    cameras = tuple(result.orientation.images)
    for order, jump in enumerate(result.jumps, 1):
        if jump.pulses:
            name = "jumper" if order == 1 else f"jumper-{order}"
            written += [folder / f"{name}.c3d", folder / f"{name}.trc"]
            c3d_file.write(jump, result.rate_hz, cameras, written[-2], ski_length_m)
            trc_file.write(jump, result.rate_hz, written[-1], ski_length_m)
    if len(written) > 1:
        written.append(folder / "jumper.osim")
        osim_file.write(written[-1], ski_length_m)
    return written
