"""What people said of single pulses of the recordings, in writing and aloud."""

from recorder.catalogue.folder import Catalogue
from rig.api.looking import Note, VoiceNote
from service.recordings.download import file_name
from service.recordings.notes import check_voices, noted, notes_of, spoken, voice_file
from service.seam.archive import Download


class ArchiveNotes:
    """The part of the archive that keeps notes.

    Args:
        catalogue: of the folder.
    """

    def __init__(self, catalogue: Catalogue) -> None:
        self._catalogue = catalogue

    def notes(self, recording_id: str) -> list[Note]:
        """The notes at single pulses, in order."""
        return notes_of(self._catalogue.entry(recording_id).session)

    def note(self, recording_id: str, pulse: int, text: str) -> list[Note]:
        """Set the note of a pulse; no text: remove it.

        Raises:
            StateForbidsError: there are too many.
        """
        session = self._catalogue.entry(recording_id).session
        if changes := noted(session, pulse, text):
            session = self._catalogue.change_session(recording_id, changes).session
        return notes_of(session)

    def voice_notes(self, recording_id: str) -> list[VoiceNote]:
        """The spoken notes, in the order in which they were spoken."""
        return spoken(self._catalogue.voice_notes(recording_id))

    def voice_file(self, recording_id: str, number: int) -> Download:
        """A spoken note as a file.

        Raises:
            UnknownRecordingError: there is none of this number.
        """
        stored, entry = self._catalogue.voice_notes(recording_id), self._catalogue.entry(recording_id)
        return voice_file(stored, number, file_name(recording_id, entry.session, ""))

    def add_voice_note(self, recording_id: str, pulse: int, data: bytes) -> list[VoiceNote]:
        """Keep a spoken note (WebM) about a pulse.

        Raises:
            BadInputError: it is no WebM file.
            StateForbidsError: there are too many.
        """
        check_voices(self._catalogue.voice_notes(recording_id))
        self._catalogue.add_voice_note(recording_id, pulse, data)
        return self.voice_notes(recording_id)

    def remove_voice_note(self, recording_id: str, number: int) -> list[VoiceNote]:
        """Remove a spoken note for good; if there is none of this number, nothing changes."""
        self._catalogue.remove_voice_note(recording_id, number)
        return self.voice_notes(recording_id)
