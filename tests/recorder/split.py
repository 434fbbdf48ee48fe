"""Splits a log into parts as the recorder does, so that they can be compared with it."""

from collections.abc import Sequence
from itertools import accumulate
from pathlib import Path

from recorder.log.extent import CONTINUES, CONTINUES_AFTER, NEXT_PART, PART, extent
from recorder.log.triplet_buffers import TripletBuffers
from recorder.reading.log_reader import LogReader
from recorder.reading.triplets import triplets
from recorder.writing.log_writer import LogDescription
from rig.clocks import UtcNs
from rig.tag import TripletTag
from rig.topics import CALIBRATION_ATTACHMENT, RECORDING_METADATA, RIG_ATTACHMENT, RIG_METADATA, SESSION_METADATA
from tests.recorder.logs import READY_NS, acquire, open_writer


def split_log(log: Path, first: Path, sizes: Sequence[int], second: int = 2) -> list[Path]:
    """Write the pulses of a log into parts.

    Args:
        log: the log.
        first: path of the first part.
        sizes: number of pulses in each part but the last one, which gets the rest.
        second: number of the second part, larger if its usual name is taken.

    Returns:
        The parts.
    """
    with LogReader(log) as reader:
        for _ in reader.items():
            pass
        session, rig = reader.metadata[SESSION_METADATA], reader.metadata.get(RIG_METADATA, {})
        files = reader.attachments
    pulses = [(tag, image.copy()) for tag, image in triplets(log)]
    ends = [*accumulate(sizes), len(pulses)]
    paths = [first, *(first.with_name(f"{first.stem}-part{second + n}{first.suffix}") for n in range(len(sizes)))]
    recording = pulses[0][0].recording
    for place, path in enumerate(paths):
        begin, end = ends[place - 1] if place else 0, ends[place]
        chain = {"recording": recording}
        if place:
            chain |= {CONTINUES: paths[place - 1].stem, CONTINUES_AFTER: str(begin), PART: str(second + place - 1)}
        description = LogDescription(
            session | chain, rig, files.get(RIG_ATTACHMENT, b""), files.get(CALIBRATION_ATTACHMENT)
        )
        buffers = TripletBuffers(pulses[0][0].shape, 4, (), pulses[0][0].pixels)
        with open_writer(path, buffers, description) as writer:
            for tag, image in pulses[begin:end]:
                slot = acquire(buffers)
                buffers.write(slot, image)
                writer.write_pulse(tag, slot, UtcNs(tag.time + READY_NS))
            told = extent(_time(pulses[begin - 1 if place else 0][0]), _time(pulses[end - 1][0]))
            last = {NEXT_PART: paths[place + 1].stem} if place + 1 < len(paths) else {}
            writer.set_metadata(RECORDING_METADATA, told | last)
        buffers.close()
    return paths


def _time(tag: TripletTag) -> UtcNs:
    return tag.time
