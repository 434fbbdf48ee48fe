"""Spoken notes of a recording: files in a folder beside its log, which goes wherever the log goes."""

import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rig.errors import BadInputError
from rig.host.disk import replace_file
from rig.phrase import phrase

_NAME: Final = re.compile(r"([1-9][0-9]{0,5})_pulse-([1-9][0-9]{0,15})\.webm")
#: How a WebM file begins: the EBML head (RFC 8794, 11.2.1), which names its document type within the first bytes.
_EBML: Final = b"\x1a\x45\xdf\xa3"
_WEBM: Final = b"webm"
_HEAD: Final = 64


@dataclass(frozen=True, slots=True)
class StoredVoice:
    """A spoken note on the disk.

    Attributes:
        number: counts the notes of the recording.
        pulse: at which it was spoken.
        path: the file, WebM.
        bytes: its size.
        recorded: when it was stored, UNIX time, s.
    """

    number: int
    pulse: int
    path: Path
    bytes: int
    recorded: float


def voice_folder(log: Path) -> Path:
    """Path of the folder with the spoken notes of a log, whether it is there or not."""
    return log.with_suffix(".voice")


def voice_notes(log: Path) -> list[StoredVoice]:
    """The spoken notes of a log, in the order in which they were spoken; links and files that are none are left out.

    Raises:
        OSError: the folder cannot be read.
    """
    folder = voice_folder(log)
    if folder.is_symlink():
        return []
    try:
        with os.scandir(folder) as entries:
            found = [
                StoredVoice(int(name[1]), int(name[2]), Path(entry.path), stat.st_size, stat.st_mtime)
                for entry in entries
                if entry.is_file(follow_symlinks=False) and (name := _NAME.fullmatch(entry.name))
                for stat in (entry.stat(follow_symlinks=False),)
            ]
    except FileNotFoundError:
        return []
    return sorted(found, key=lambda note: note.number)


def check_voice(data: bytes) -> None:
    """Check that a spoken note is a WebM file.

    Raises:
        BadInputError: it is not.
    """
    if not data.startswith(_EBML) or _WEBM not in data[:_HEAD]:
        raise BadInputError(
            phrase("voice_note_no_webm", "this is no WebM file: send what a browser records as audio/webm")
        )


def add_voice_note(log: Path, pulse: int, data: bytes) -> None:
    """Store a spoken note beside a log; under its name only when it is complete.

    Raises:
        BadInputError: a link stands where its folder should be: whatever it leads to does not lie beside the log.
        OSError: the disk refuses.
    """
    folder = voice_folder(log)
    if folder.is_symlink():
        raise BadInputError(f"{folder}: is a link, and links are not followed: remove it")
    folder.mkdir(exist_ok=True)
    number = max((note.number for note in voice_notes(log)), default=0) + 1
    path = folder / f"{number}_pulse-{pulse}.webm"
    replace_file(path, data, links=False)
