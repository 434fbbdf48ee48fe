"""Links that open one recording to somebody without a token, until they end.

A link is signed and kept nowhere: its key holds the minute at which it ends, and a signature over that minute and the
recording. So it opens no other recording by construction, works on after a restart, and ends with the tokens of the
service: other tokens sign otherwise. What is signed is a secret of the service's own mixed with the tokens, so that
nobody who has a link can try out tokens against it.
"""

import base64
import binascii
import hmac
import math
import os
import secrets
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rig.host.files import read_own
from rig.phrase import Phrase, phrase
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


@dataclass(frozen=True, slots=True)
class Secret:
    """What links are signed with, and what shows that the tokens are the same.

    Attributes:
        value: random bytes.
        problem: why it is another one after the next start, which ends all links; None: it is kept.
    """

    value: bytes
    problem: Phrase | None = None


def kept_secret(folder: Path) -> Secret:
    """The secret of the service that records into a folder, made at the first time; only its own user can read it."""
    path = folder / SECRET_NAME
    try:
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
    return value


class Links:
    """Makes and checks the keys of links.

    Args:
        secret: random bytes that no client knows.
        tokens: the tokens of the service.
        share_s: how long a link opens its recording, s.
        clock: UNIX time, s.
    """

    def __init__(self, secret: bytes, tokens: Tokens, share_s: float, clock: Callable[[], float] = time.time) -> None:
        self._signing = tokens.mark(secret, b"svev link 1")
        self._share_s, self._clock = share_s, clock

    def make(self, recording: str) -> tuple[str, float]:
        """The key of a link to a recording, and the UNIX time at which it ends, s: a whole minute."""
        minute = math.ceil((self._clock() + self._share_s) / _MINUTE_S)
        ends = _MINUTES.pack(minute)
        return _as_text(ends + self._sign(recording, ends)), minute * float(_MINUTE_S)

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
