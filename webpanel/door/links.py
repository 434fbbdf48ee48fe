"""Links that open one recording to somebody without a token, until they end.

A link is signed: its key holds the minute at which it ends, and a signature over that minute and the recording. So it
opens no other recording by construction, works on after a restart, and ends with the tokens of the service: other
tokens sign otherwise. Which links were made is kept as well, so that each can be taken back. What is signed
is a secret of the service's own mixed with the tokens, so that nobody who has a link can try out tokens against it.
"""

import base64
import binascii
import hmac
import math
import os
import secrets
import struct
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rig.host.disk import sync
from rig.host.files import read_own
from rig.phrase import Phrase, phrase
from webpanel.door.link_file import KeptLink, LinkFile
from webpanel.door.tokens import Tokens

#: Name of the file with the secret, in the folder of the recordings.
SECRET_NAME: Final = ".svev-secret"  # noqa: S105 - the name of the file
#: Length of a key as text.
KEY_LENGTH: Final = 27
_SECRET_BYTES: Final = 32
_MINUTES: Final = struct.Struct(">I")
#: 128 bits cannot be guessed (RFC 2104, 5: half of the hash is enough), and make a small QR code.
_SIGNATURE_BYTES: Final = 16
_MINUTE_S: Final = 60
#: A link is given again for this part of its time, one hour of a day.
_SAME: Final = 24
#: So many links are known; of more than that the oldest cannot be taken back any more.
_LINKS_MOST: Final = 5000


@dataclass(frozen=True, slots=True)
class Secret:
    """What links are signed with, and what shows that the tokens are the same.

    Attributes:
        value: random bytes.
        problem: why it is another one after the next start, which ends all links; None: it is kept.
    """

    value: bytes
    problem: Phrase | None = None


def kept_secret(folder: Path, *, anew: bool = False) -> Secret:
    """The secret of the service that records into a folder, made at the first time; only its own user can read it.

    Args:
        folder: the folder.
        anew: make another one, which ends all links and sessions.
    """
    path = folder / SECRET_NAME
    try:
        if anew:
            path.unlink(missing_ok=True)
        try:
            value = read_own(path, _SECRET_BYTES)
        except FileNotFoundError:
            value = _make_secret(path)
        if len(value) != _SECRET_BYTES:
            path.unlink()  # a power cut while it was written
            value = _make_secret(path)
    except OSError as error:
        text = "{path} cannot be kept ({why}): links to jumps end when the service is restarted"
        said = phrase("event_secret", text, path=str(path), why=error.strerror or str(error))
        return Secret(secrets.token_bytes(_SECRET_BYTES), said)
    return Secret(value)


def _make_secret(path: Path) -> bytes:
    value = secrets.token_bytes(_SECRET_BYTES)
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600), "wb") as file:
        file.write(value)
        file.flush()
        os.fsync(file.fileno())
    sync(path.parent)
    return value


class Links:
    """Makes and checks the keys of links, and takes them back. Any thread may call any method.

    Args:
        secret: random bytes that no client knows.
        tokens: the tokens of the service.
        share_s: how long a link opens its recording, s.
        clock: UNIX time, s.
        file: keeps which links were made, and taken back; None: nobody does.
    """

    def __init__(
        self,
        secret: bytes,
        tokens: Tokens,
        share_s: float,
        clock: Callable[[], float] = time.time,
        file: LinkFile | None = None,
    ) -> None:
        self._signing = tokens.mark(secret, b"svev link 1")
        self._share_s, self._clock, self._file = share_s, clock, file
        self._made = {(link.recording, link.minute): link for link in (() if file is None else file.links)}
        self._lock = threading.Lock()

    def make(self, recording: str) -> tuple[str, float]:
        """The key of a link to a recording, and the UNIX time at which it ends, s: a whole minute.

        A screen that shows its code anew again and again gets the same one for a while.
        """
        now = self._clock()
        with self._lock:
            fresh = [link for link in self._open(recording) if 0 <= now - link.made < self._share_s / _SAME]
            if fresh:
                minute = fresh[-1].minute
            else:
                minute = math.ceil((now + self._share_s) / _MINUTE_S)
                while (recording, minute) in self._made:  # taken back
                    minute += 1
                self._made[recording, minute] = KeptLink(recording=recording, minute=minute, made=now)
                self._keep()
        ends = _MINUTES.pack(minute)
        return _as_text(ends + self._sign(recording, ends)), minute * float(_MINUTE_S)

    def open_links(self, recording: str) -> list[KeptLink]:
        """The links that open a recording, the oldest first."""
        with self._lock:
            return self._open(recording)

    def take_back(self, recording: str, minute: int) -> bool | None:
        """Let a link open nothing any more, from now on.

        Returns:
            Whether the disk keeps that for the next start; None: there is no such link, or it is not open.
        """
        with self._lock:
            link = next((each for each in self._open(recording) if each.minute == minute), None)
            if link is None:
                return None
            self._made[recording, minute] = link.model_copy(update={"taken_back": True})
            self._keep()
        return self._file is None or self._file.is_kept()

    def is_taken_back(self, recording: str, ends: float) -> bool:
        """Whether the link to a recording that ends at this UNIX time, s, was taken back."""
        link = self._made.get((recording, round(ends / _MINUTE_S)))
        return link is not None and link.taken_back

    def _open(self, recording: str) -> list[KeptLink]:
        return [
            link
            for link in self._made.values()
            if link.recording == recording and not link.taken_back and self.left_s(link.minute * float(_MINUTE_S))
        ]

    def _keep(self) -> None:
        """Forget those that have ended and, of too many, the oldest that were not taken back."""
        known = [link for link in self._made.values() if self.left_s(link.minute * float(_MINUTE_S))]
        surplus = [link for link in known if not link.taken_back][: max(0, len(known) - _LINKS_MOST)]
        self._made = {(link.recording, link.minute): link for link in known if link not in surplus}
        if self._file is not None:
            self._file.keep(self._made.values())

    def ends(self, recording: str, key: str) -> float | None:
        """The UNIX time at which a key ends or has ended, s; None: it was not made here, or for another recording."""
        content = _from_text(key)
        ends, signature = content[: _MINUTES.size], content[_MINUTES.size :]
        if len(content) != _MINUTES.size + _SIGNATURE_BYTES:
            return None
        if not hmac.compare_digest(signature, self._sign(recording, ends)):
            return None
        (minute,) = _MINUTES.unpack(ends)
        return float(minute * _MINUTE_S)

    def left_s(self, ends: float) -> float:
        """Seconds until a link ends; 0: it has ended."""
        return max(0.0, ends - self._clock())

    def _sign(self, recording: str, ends: bytes) -> bytes:
        signed = ends + recording.encode("utf-8", "surrogatepass")
        return hmac.digest(self._signing, signed, "sha256")[:_SIGNATURE_BYTES]


def _as_text(content: bytes) -> str:
    return base64.urlsafe_b64encode(content).rstrip(b"=").decode()


def _from_text(key: str) -> bytes:
    """The bytes of a key; empty if it is none. Each key is written in one way only."""
    if len(key) != KEY_LENGTH or not key.isascii():
        return b""
    try:
        content = base64.b64decode(key + "=", altchars=b"-_", validate=True)
    except binascii.Error:
        return b""
    return content if _as_text(content) == key else b""
