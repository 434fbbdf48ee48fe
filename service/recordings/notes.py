"""Notes at single pulses of a recording: written ones are fields `note.PULSE` of its session; and spoken ones."""

from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from typing import Final

from recorder.catalogue.voice_notes import StoredVoice
from rig.api.looking import VOICES_MAX, Note, VoiceNote
from rig.errors import StateForbidsError, UnknownRecordingError
from rig.host.files import open_to_read
from rig.phrase import phrase
from service.seam.archive import Download

#: How the names of fields with notes begin.
NOTE_FIELD: Final = "note."
#: So many notes, and pulses that ever had one, fit into the file with the longest session fields.
_NOTES_MAX: Final = 60
_FIELDS_MAX: Final = 400


def notes_of(session: Mapping[str, str]) -> list[Note]:
    """The notes of a recording, by pulse; a field without text stands for a removed note."""
    found = {
        name.removeprefix(NOTE_FIELD): text for name, text in session.items() if name.startswith(NOTE_FIELD) and text
    }
    return [
        Note(pulse=int(pulse), text=found[pulse])
        for pulse in sorted((pulse for pulse in found if pulse.isascii() and pulse.isdecimal()), key=int)
    ]


def noted(session: Mapping[str, str], pulse: int, text: str) -> dict[str, str]:
    """The change of a session that sets the note of a pulse; no text: that removes it.

    Raises:
        StateForbidsError: there are too many.
    """
    name = f"{NOTE_FIELD}{pulse}"
    fields = {field for field in session if field.startswith(NOTE_FIELD)}
    if text and name not in fields and (len(notes_of(session)) >= _NOTES_MAX or len(fields) >= _FIELDS_MAX):
        raise StateForbidsError(
            phrase(
                "notes_full",
                "a recording has at most {most} notes: remove some, or use its field for notes",
                most=_NOTES_MAX,
            )
        )
    return {name: text} if text or name in fields else {}


def spoken(stored: Iterable[StoredVoice]) -> list[VoiceNote]:
    """Spoken notes as the panel shows them."""
    return [
        VoiceNote(
            number=note.number, pulse=note.pulse, recorded=datetime.fromtimestamp(note.recorded, UTC), bytes=note.bytes
        )
        for note in stored
    ]


def check_voices(stored: Sequence[StoredVoice]) -> None:
    """Check that there is room for another spoken note.

    Raises:
        StateForbidsError: there are too many.
    """
    if len(stored) >= VOICES_MAX:
        raise StateForbidsError(
            phrase("voice_notes_full", "a recording has at most {most} spoken notes: remove some", most=VOICES_MAX)
        )


def voice_file(stored: Iterable[StoredVoice], number: int, name: str) -> Download:
    """A spoken note as a file to take away.

    Args:
        stored: the spoken notes of the recording.
        number: of the note.
        name: of the recording's file, without an ending.

    Raises:
        UnknownRecordingError: there is none of this number.
    """
    note = next((each for each in stored if each.number == number), None)
    if note is None:
        raise UnknownRecordingError(
            phrase(
                "voice_note_unknown",
                "the recording has no spoken note {number}: see the list of its notes",
                number=number,
            )
        )
    file, path = f"{name}_note-{number}_pulse-{note.pulse}.webm", note.path
    tag = f"{note.recorded}-{note.bytes}-{number}"
    return Download(file, note.bytes, note.recorded, tag, corrected=False, open=lambda: open_to_read(path, links=False))
