"""Recordings as files to take away: with the corrected session, under a name that says who jumped, one or several."""

import hashlib
import io
import re
import unicodedata
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import BinaryIO, Final

from recorder.log.beside import digitized_path
from recorder.log.session_changes import session_changes
from recorder.reading.corrected_log import corrected_log
from rig.errors import BadInputError, StateForbidsError
from rig.host.files import open_to_read
from rig.phrase import phrase
from service.measuring.results import file_download
from service.seam.archive import Download

#: What a part of a file's name may hold on every system; letters are those of any language.
_NOT_IN_NAMES: Final = re.compile(r"[^\w.]+")
_PART_MAX: Final = 40
_PIECE: Final = 1 << 20
_SUMS: Final = "SHA256SUMS"
#: Bytes of the records around a member, beside its name: before it, behind it, in the directory at the end; what a
#: member with 64-bit lengths has more (an extra field of 20, 8 more behind it); the head of an extra field; the ends.
_LOCAL, _DESCRIPTOR, _CENTRAL, _ZIP64_MORE, _EXTRA, _END, _ZIP64_END = 30, 16, 46, 28, 4, 22, 76


def download_of(recording: str, session: Mapping[str, str], path: Path, first: Path) -> Download:
    """A log as a file to take away.

    Args:
        recording: id of the log.
        session: of the recording, with its changes; the names of all its parts are made of it.
        path: the log, which nobody writes any more.
        first: the first part of the recording, beside which the changes of the session lie; most have no other.

    Raises:
        BadInputError: the log cannot be read.
    """
    try:
        changes = session_changes(first)
    except BadInputError:  # the entry's verdict says so; the recording itself is as good as ever
        changes = {}
    log = corrected_log(path, changes)
    stat = log.status
    facts = (stat.st_ino, stat.st_mtime_ns, stat.st_size, sorted(changes.items()) if log.corrected else ())
    tag = hashlib.sha256(repr(facts).encode()).hexdigest()[:32]
    return Download(file_name(recording, session), log.size, stat.st_mtime, tag, log.corrected, log.open)


def file_name(recording: str, session: Mapping[str, str], ending: str = ".mcap") -> str:
    """The name of a downloaded file: bib, athlete and id, e.g. `17_Ola-Nordmann_2026-11-20T10-15-03Z.mcap`."""
    parts = [_part(session.get(field, "")) for field in ("bib", "athlete")]
    return "_".join([*filter(None, parts), recording]) + ending


def sha256_of(download: Download, wanted: Callable[[], bool]) -> str:
    """SHA-256 of a file to take away, as it is handed out; reads all of it.

    Args:
        download: the file.
        wanted: whether somebody still waits; asked at every piece.

    Raises:
        StateForbidsError: nobody does.
        BadInputError: the log has become shorter.
        OSError: it cannot be read.
    """
    digest = hashlib.sha256()
    with download.open() as file:
        while piece := file.read(_PIECE):
            if not wanted():
                raise StateForbidsError(
                    phrase("checksum_unwanted", "nobody waits for the checksum any more: ask for it again")
                )
            digest.update(piece)
    return digest.hexdigest()


def zipped(downloads: Iterable[Download]) -> Iterator[bytes]:
    """Several files as one ZIP archive without compression, made while it is sent; with the SHA-256 of each.

    ZIP64, so neither a log nor the archive is too large. The checksums are taken from the bytes as they go by, and
    stand at the end in a file that `sha256sum -c SHA256SUMS` reads.

    Raises:
        BadInputError: a log has become shorter.
        OSError: one cannot be read.
    """
    sink, sums = _Sink(), []
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_STORED, allowZip64=True) as archive:
        for download in downloads:
            digest = hashlib.sha256()
            begun = datetime.fromtimestamp(download.modified, UTC).timetuple()[:6]
            entry = zipfile.ZipInfo(download.name, begun)
            with archive.open(entry, "w", force_zip64=True) as member, download.open() as file:
                while piece := file.read(_PIECE):
                    digest.update(piece)
                    member.write(piece)
                    yield sink.taken()
            sums.append(f"{digest.hexdigest()}  {download.name}\n")
        archive.writestr(_SUMS, "".join(sums))
    yield sink.taken()


def zipped_size(downloads: Sequence[Download]) -> int:
    """Bytes of the archive that `zipped` makes, by APPNOTE.TXT 6.3.10 and how `zipfile` applies it."""
    sums = sum(len(f"{'0' * 64}  {download.name}\n".encode()) for download in downloads)
    sizes = [(len(download.name.encode()), download.size, _ZIP64_MORE) for download in downloads]
    place = central = 0
    for name, size, more in [*sizes, (len(_SUMS), sums, 0)]:
        large = [16] * (size > zipfile.ZIP64_LIMIT) + [8] * (place > zipfile.ZIP64_LIMIT)
        central += _CENTRAL + name + (sum(large) + _EXTRA if large else 0)
        place += _LOCAL + name + size + _DESCRIPTOR + more
    return place + central + _END + (_ZIP64_END if place > zipfile.ZIP64_LIMIT else 0)


class _Sink:
    """Takes what an archive writes, until it is sent. It has no place to go back to, so the archive never does."""

    def __init__(self) -> None:
        self._written = bytearray()

    def write(self, data: bytes, /) -> int:
        """Take bytes."""
        self._written += data
        return len(data)

    def flush(self) -> None:
        """Nothing waits elsewhere."""

    def close(self) -> None:
        """What was written can still be taken."""

    def taken(self) -> bytes:
        """What was written since the last call."""
        data = bytes(self._written)
        self._written.clear()
        return data


def _part(text: str) -> str:
    """A session field as a part of a file's name."""
    return _NOT_IN_NAMES.sub("-", unicodedata.normalize("NFC", text)).replace("_", "-").strip("-.")[:_PART_MAX]


def digitized_downloads(log: Path, name: str) -> list[Download]:
    """The marks of all operators, and the jumps computed from them, in a folder that belongs beside the log's file.

    Args:
        log: the log.
        name: of the file that it is taken away as.
    """
    folder = digitized_path(log)
    within = digitized_path(Path(name)).name
    files = [path for path in sorted(folder.rglob("*")) if path.is_file() and not path.is_symlink()]
    seen = [path for path in files if not any(part.startswith(".") for part in path.relative_to(folder).parts)]
    return [file_download(path, f"{within}/{path.relative_to(folder)}", _begin_of) for path in seen]


def _begin_of(path: Path, size: int) -> BinaryIO:
    """The first bytes of a file: while somebody measures, lines are added to his marks."""
    with open_to_read(path, links=False) as file:
        return io.BytesIO(file.read(size))
