"""The pulses of a recording one after the other, with their images and times; also those that the log has not."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from recorder.reading.info import LogInfo, info
from recorder.reading.log_reader import LogReader
from recorder.reading.parts import RecordingReader
from recorder.reading.triplets import StoredTriplet, stored_triplets, tags
from rig.api.export import LOSSLESS, ExportOrder
from rig.clocks import UtcNs
from rig.errors import BadInputError, LogDamagedError
from rig.frame import FrameStatus
from rig.images.picture import exported, shown
from rig.images.pixels import Stored
from rig.phrase import phrase
from rig.tag import TripletTag

#: Pulses without a tag that are shown: an hour at 30 Hz. More come from a damaged number, not from lost pulses.
_UNKNOWN_MAX: Final = 108_000
#: Said of a frame of a pulse without a tag, and of one whose image is damaged.
UNKNOWN: Final = "missing"


@dataclass(frozen=True, slots=True, eq=False)
class Shot:
    """One pulse.

    Attributes:
        pulse: its number.
        time: of the pulse; that of one without a tag lies evenly between its neighbours.
        tag: what became of it; None if the log does not say.
        image: the chosen cameras side by side, (rows, columns), of colour cameras (rows, columns, 3), black where a
            frame is missing; valid until the next.
        lacking: by place of the camera why there is no frame.
    """

    pulse: int
    time: UtcNs
    tag: TripletTag | None
    image: Stored
    lacking: Mapping[int, str]


class Recording:
    """The chosen pulses and cameras of a log; of a damaged one, the part that can be read.

    Attributes:
        log: the log.
        cameras: names of the chosen cameras.
        columns: of each in the pictures, first and one past the last.
        rows: of the frames of each.
        pulses: the chosen ones, without gaps.
        session: who jumped, as it was corrected.
        rate_hz: pulses per second.

    Raises:
        BadInputError: the log cannot be read, has no pulse, or has not the cameras or pulses that are asked for.
        LogDamagedError: the numbers of its pulses make no sense.
    """

    def __init__(self, log: Path, order: ExportOrder) -> None:
        found = info(log, whole=True)
        self.log, self.session = log, found.session
        self.rate_hz = found.ledger.rate_hz or 1.0
        self._tags: dict[int, TripletTag] = {}
        for tag in tags(log):
            self._tags.setdefault(int(tag.pulse), tag)
        self.pulses = _chosen(found, order)
        self._blocks = _blocks(found, order)
        first = next(iter(self._tags.values()))
        self._shape, self._pixels, self._lossless = first.shape, first.pixels, order.kind in LOSSLESS
        self.cameras = tuple(self._blocks)
        rows = {camera.name: camera.size(first.shape)[1] for camera in first.cameras}
        self.rows = tuple(rows[name] for name in self.cameras)
        widths = [end - first for first, end in self._blocks.values()]
        ends = np.cumsum(widths).tolist()
        self.columns = tuple((end - width, end) for end, width in zip(ends, widths, strict=True))
        known = sorted(pulse for pulse in self._tags if pulse in self.pulses)
        if not known or len(self.pulses) - len(known) > _UNKNOWN_MAX:
            raise LogDamagedError(
                phrase(
                    "export_few_pulses",
                    "{log}: of the pulses {first} to {last} it has {count}: choose others",
                    log=str(log),
                    first=self.pulses[0],
                    last=self.pulses[-1],
                    count=len(known),
                )
            )
        self._known = np.array(known)

    def shots(self) -> Iterator[Shot]:
        """The chosen pulses in order.

        Raises:
            BadInputError: the disk cannot read the log, or its images are not all of one size.
        """
        with RecordingReader(self.log, skim=True) as reader:
            stored: dict[int, StoredTriplet] = {}
            for triplet in stored_triplets(reader):
                stored.setdefault(int(triplet.tag.pulse), triplet)
            for pulse in self.pulses:
                yield self._shot(reader, pulse, stored.get(pulse))

    def tag(self, pulse: int) -> TripletTag | None:
        """What became of a pulse; None if the log does not say."""
        return self._tags.get(pulse)

    def time_of(self, pulse: int) -> UtcNs:
        """Time of a pulse; of one without a tag by its neighbours: it lies evenly between them."""
        tag = self._tags.get(pulse)
        if tag is not None:
            return tag.time
        after = int(np.searchsorted(self._known, pulse))
        neighbours = [self._tags[int(p)] for p in self._known[max(0, after - 1) : after + 1]]
        first, last = neighbours[0], neighbours[-1]
        if first.pulse < pulse < last.pulse:
            step = (last.time - first.time) / (last.pulse - first.pulse)
        else:
            step = 1e9 / self.rate_hz
        return UtcNs(round(first.time + step * (pulse - first.pulse)))

    def _shot(self, reader: LogReader, pulse: int, stored: StoredTriplet | None) -> Shot:
        tag = self._tags.get(pulse)
        if tag is not None and (tag.shape, tag.pixels) != (self._shape, self._pixels):
            raise BadInputError(
                phrase(
                    "export_sizes",
                    "{log}: the images change their size at pulse {pulse}: export the parts apart",
                    log=str(self.log),
                    pulse=pulse,
                )
            )
        image: Stored | None = None
        if stored is not None:
            try:
                image = stored.image(reader)
            except ValueError:  # `svev verify` names it; here the picture says that it is missing
                image = None
        held = np.zeros(self._shape, self._pixels.dtype) if image is None else image
        whole = exported(held, self._pixels) if self._lossless else shown(held, self._pixels, coloured=True)
        blocks = list(self._blocks.values())
        everything = blocks[0][0] == 0 and self.columns == tuple(blocks) and blocks[-1][1] == self._shape[1]
        chosen = whole if everything else np.hstack([whole[:, first:end] for first, end in blocks])
        return Shot(pulse, self.time_of(pulse), tag, chosen, self._lacking(tag, seen=image is not None))

    def _lacking(self, tag: TripletTag | None, *, seen: bool) -> dict[int, str]:
        """Why cameras show nothing, by their place."""
        if tag is None:
            return dict.fromkeys(range(len(self.cameras)), UNKNOWN)
        statuses = {camera.name: camera.status for camera in tag.cameras}
        found = {}
        for place, name in enumerate(self.cameras):
            status = statuses.get(name)
            if status is not FrameStatus.OK:
                found[place] = UNKNOWN if status is None else status.value
            elif not seen:
                found[place] = UNKNOWN
        return found


def _chosen(found: LogInfo, order: ExportOrder) -> range:
    """The pulses that are asked for.

    Raises:
        BadInputError: the log has none of them.
    """
    if found.first is None:
        raise BadInputError(
            phrase("export_no_pulse", "{log}: no pulse came in this recording; choose another", log=str(found.path))
        )
    begin, end = int(found.first.pulse), int(found.ledger.last_pulse)
    first = begin if order.first is None else order.first
    last = end if order.last is None else order.last
    if None not in (order.first, order.last) and first > last:
        raise BadInputError(
            phrase(
                "export_turned",
                "{log}: first pulse {first}, last pulse {last}: that is none; exchange them",
                log=str(found.path),
                first=first,
                last=last,
            )
        )
    if not begin <= first <= last <= end:
        raise BadInputError(
            phrase(
                "export_outside",
                "{log}: has pulses {first} to {last}; choose among them",
                log=str(found.path),
                first=begin,
                last=end,
            )
        )
    return range(first, last + 1)


def _blocks(found: LogInfo, order: ExportOrder) -> dict[str, tuple[int, int]]:
    """Columns of the chosen cameras in the triplet, by name.

    Raises:
        BadInputError: there is no camera of a name.
    """
    there = {} if found.first is None else {camera.name: camera.columns for camera in found.first.cameras}
    for name in order.cameras:
        if name not in there:
            raise BadInputError(
                phrase(
                    "export_no_camera",
                    "{log}: has no camera {camera}; choose among {cameras}",
                    log=str(found.path),
                    camera=name,
                    cameras=", ".join(there),
                )
            )
    return {name: there[name] for name in order.cameras or there}
