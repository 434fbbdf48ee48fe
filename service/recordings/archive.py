"""The recordings in the service's folder: which there are, their files and images, and the trash."""

from collections.abc import Callable, Iterator, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.images.activity import liveliest_pulse
from recorder.catalogue.entry import Entry, LogState
from recorder.catalogue.folder import Catalogue
from recorder.catalogue.trash import TrashContents
from rig.api.export import ExportJob, ExportOrder
from rig.api.recordings import Pulses, Recording, RecordingQuery, Trash
from rig.errors import StateForbidsError, StillRecordingError
from rig.phrase import phrase
from service.exports.jobs import Exports
from service.measuring.queue import Measurings
from service.measuring.results import result_downloads
from service.recordings.archive_notes import ArchiveNotes
from service.recordings.archive_results import ArchiveResults
from service.recordings.describing import Chain, as_pulses, as_recording
from service.recordings.download import digitized_downloads, download_of, file_name, sha256_of, zipped, zipped_size
from service.recordings.measured_jumps import MeasuredJumps
from service.seam.archive import Download, FoundRecordings

_ALL: Final = RecordingQuery()


class Archive(ArchiveResults, ArchiveNotes):
    """The reading part of `service.seam.rig.RigService`: all recordings of the folder, with the one in progress.

    Attributes:
        exports: what is being exported, and what has been.

    Args:
        catalogue: of the folder.
        exports: of the same recordings.
        measurings: likewise.
        jumps: that were measured in them.
    """

    def __init__(self, catalogue: Catalogue, exports: Exports, measurings: Measurings, jumps: MeasuredJumps) -> None:
        ArchiveResults.__init__(self, catalogue, measurings, jumps)
        ArchiveNotes.__init__(self, catalogue)
        self.exports = exports
        self._checksums: dict[str, str] = {}

    def recordings(self, query: RecordingQuery = _ALL) -> FoundRecordings:
        """The recordings that a query finds, the one in progress among them."""
        current = self.status().recording
        found = self._catalogue.find(query)
        chain = Chain(self._catalogue, found.entries)
        shown = [chain.pointing_on(as_recording(entry)) for entry in found.entries]
        return FoundRecordings(found.total, [current if current and each.id == current.id else each for each in shown])

    def recording(self, recording_id: str) -> Recording:
        """One recording, in the trash or not."""
        current = self.status().recording
        if current and current.id == recording_id:
            return current
        return self._with_next_part(self._catalogue.entry(recording_id))

    def _with_next_part(self, entry: Entry) -> Recording:
        """Describe an entry, with the id of the recording that goes on with it."""
        return Chain(self._catalogue, [entry]).pointing_on(as_recording(entry))

    def trash(self) -> Trash:
        """How much lies in the trash."""
        return _as_trash(self._catalogue.trash())

    def empty_trash(self) -> Trash:
        """Remove everything in the trash for good."""
        return _as_trash(self._catalogue.purge())

    def remove_recording(self, recording_id: str) -> Trash:
        """Remove one recording of the trash for good.

        Raises:
            StateForbidsError: it does not lie in the trash.
        """
        entry = self._catalogue.entry(recording_id, prefer_deleted=True)
        if not entry.deleted:
            raise StateForbidsError(
                phrase(
                    "recording_not_in_trash",
                    "recording {recording} is not in the trash: delete it first",
                    recording=recording_id,
                )
            )
        removed = [self._catalogue.remove(part) for part in entry.parts[:0:-1]]
        removed.append(self._catalogue.remove(recording_id))
        return Trash(recordings=len(removed), bytes=sum(each.bytes for each in removed))

    def download(self, recording_id: str) -> Download:
        """A log of a recording that has ended, as a file with the corrected session, which all parts have in common.

        Raises:
            StillRecordingError: it has not.
            BadInputError: the file may not be read, or is no regular file.
        """
        self._check_ended(recording_id)
        first = self._catalogue.first_part(recording_id)
        session = self._catalogue.entry(first).session
        return download_of(recording_id, session, self._catalogue.file(recording_id), self._catalogue.file(first))

    def start_export(self, recording_id: str, order: ExportOrder) -> ExportJob:
        """Ask for an export of a recording that has ended.

        Raises:
            StillRecordingError: it has not.
            StorageError: there is not room enough.
        """
        self._check_ended(recording_id)
        entry, log = self._catalogue.entry(recording_id), self._catalogue.file(recording_id)
        return self.exports.start(recording_id, log, file_name(recording_id, entry.session, ""), order)

    def _check_ended(self, recording_id: str) -> None:
        current = self.status().recording
        here = current is not None and recording_id in (current.id, *current.parts)
        if here or self._catalogue.entry(recording_id).state is LogState.WRITING:
            raise StillRecordingError(
                phrase(
                    "recording_being_written",
                    "recording {recording} is still being written: stop it first",
                    recording=recording_id,
                )
            )

    def checksum(self, recording_id: str, wanted: Callable[[], bool]) -> str:
        """SHA-256 of that file, in hexadecimal.

        Raises:
            StateForbidsError: it is not `wanted` any more.
        """
        download = self.download(recording_id)
        known = self.known_checksum(download)
        if not known:
            known = self._checksums[download.tag] = sha256_of(download, wanted)
        return known

    def known_checksum(self, download: Download) -> str:
        """SHA-256 of a file if it was asked for before, otherwise empty."""
        return self._checksums.get(download.tag, "")

    def zipped(self, recording_ids: Sequence[str]) -> tuple[int, Iterator[bytes]]:
        """Several recordings and what belongs to them as one archive: its size, and its bytes piece by piece."""
        downloads: list[Download] = []
        for recording_id in recording_ids:
            self._check_ended(recording_id)
        entries = [self._catalogue.entry(recording_id) for recording_id in recording_ids]
        for recording_id in dict.fromkeys(part for each in entries for part in each.parts or (each.id,)):
            file = self.download(recording_id)
            log = self._catalogue.file(recording_id)
            downloads += [file, *result_downloads(log, file.name), *digitized_downloads(log, file.name)]
            downloads += [self.voice_file(recording_id, note.number) for note in self.voice_notes(recording_id)]
        return zipped_size(downloads), zipped(downloads)

    def pulses(self, recording_id: str) -> Pulses:
        """What became of each pulse of a recording."""
        return as_pulses(recording_id, self._catalogue.tags(recording_id))

    def image(self, recording_id: str, pulse: int) -> NDArray[np.uint8]:
        """One triplet of a recording, uint8, (rows, columns), or blue, green, red, (rows, columns, 3)."""
        return self._catalogue.image(recording_id, pulse)

    def liveliest_pulse(self, recording_id: str) -> int:
        """The pulse to show a recording by: the middle of the stretch in which most moves."""
        return liveliest_pulse(self._catalogue.file(recording_id))


def _as_trash(contents: TrashContents) -> Trash:
    return Trash(recordings=contents.recordings, bytes=contents.bytes)
