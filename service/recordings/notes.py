"""Notes at single pulses of a recording: fields `note.PULSE` of its session, in the file beside the log."""

from collections.abc import Mapping
from typing import Final

from rig.errors import StateForbidsError
from rig.looking import Note

#: How the names of fields with notes begin.
NOTE_FIELD: Final = "note."
#: So many notes, and pulses that ever had one, fit into the file with the longest session fields.
_NOTES_MAX: Final = 60
_FIELDS_MAX: Final = 400


def notes_of(session: Mapping[str, str]) -> list[Note]:
    """The notes of a recording, by pulse; a field without text was one that is removed."""
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
        raise StateForbidsError(f"a recording has at most {_NOTES_MAX} notes: remove some, or use its field for notes")
    return {name: text} if text or name in fields else {}
