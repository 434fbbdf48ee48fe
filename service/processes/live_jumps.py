"""Keeps the jumps that are measured live beside their log, in `LOG.jumper.json`.

The log has the states of the pulses. A jump as a whole is computed after them, often when the log is closed already.
The file is a `svev-jumper/1` file like those of `svev analyze`; its member `summaries` has the main figures.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from analysis.result import file as result_file
from analysis.result.model import Jump, MeasuredRecording
from analysis.worker.findings import MeasuredJump
from recorder.log.beside import jumper_path
from rig.api.jump import LastJump
from rig.errors import BadInputError, StorageError
from service.recordings.live_results import summaries


def keep(jump: MeasuredJump, folders: Sequence[Path]) -> Path | None:
    """Write a jump beside the log of its recording, with those that are there already.

    Args:
        jump: the jump.
        folders: where the log may be.

    Returns:
        The file; None if the log is in none of the folders any more.

    Raises:
        StorageError: the disk refuses.
    """
    name = f"{jump.result.recording}.mcap"
    log = next((folder / name for folder in folders if (folder / name).exists()), None)
    if log is None:
        return None
    path = jumper_path(log)
    result, told = _joined(log, jump)
    content = result_file.to_json(result) | {"summaries": [each.model_dump(mode="json") for each in told]}
    try:
        result_file.write_json(content, path)
    except OSError as error:
        text = f"{path}: cannot be written ({error.strerror}); make room and measure the log with `svev analyze`"
        raise StorageError(text) from error
    return path


def _joined(log: Path, jump: MeasuredJump) -> tuple[MeasuredRecording, list[LastJump]]:
    """The jumps of the file, but for one of the same pulses, and this one: an analysis that died begins anew."""
    new = jump.result.jumps[0]
    try:
        before = result_file.read(jumper_path(log)).jumps
    except BadInputError:  # there is none, or it is damaged
        before = ()
    known = [(old, told) for old, told in zip(before, summaries(log), strict=False) if not _overlap(old, new)]
    order = sorted([*known, (new, jump.summary)], key=lambda pair: pair[0].pulses[0].pulse)
    jumps = tuple(replace(each, number=number) for number, (each, _) in enumerate(order, 1))
    told = [each.model_copy(update={"jump": number}) for number, (_, each) in enumerate(order, 1)]
    return replace(jump.result, jumps=jumps), told


def _overlap(one: Jump, other: Jump) -> bool:
    return one.pulses[0].pulse <= other.pulses[-1].pulse and other.pulses[0].pulse <= one.pulses[-1].pulse
