"""Tokens: read from a file (one for each role) or from the environment, compared in constant time."""

import hmac
import os
import stat
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from rig.errors import BadInputError
from rig.host.files import open_to_read
from webpanel.door.roles import Role

TOKEN_VARIABLE = "SVEV_TOKEN"  # noqa: S105 - the name of the variable
TOKEN_MIN: Final = 16
_TOKEN_MAX: Final = 1000
_FILE_MAX: Final = 16_000
_ROLES: Final = ", ".join(Role)


@dataclass(frozen=True, slots=True)
class Tokens:
    """The tokens of a service and their roles.

    Attributes:
        roles: role of each token; empty if clients need none.
        warning: what is wrong with the file they come from, empty if nothing is.
    """

    roles: Mapping[bytes, Role] = field(default_factory=dict, repr=False)
    warning: str = ""

    def __bool__(self) -> bool:
        """Whether clients need a token."""
        return bool(self.roles)

    def role_of(self, candidate: str) -> Role | None:
        """The role of a token, None if it is none of them. All are compared, each in constant time."""
        given = candidate.encode("utf-8", "surrogateescape")
        found = [role for token, role in self.roles.items() if hmac.compare_digest(given, token)]
        return found[0] if found else None

    def mark(self, secret: bytes, purpose: bytes) -> bytes:
        """32 bytes that follow from a secret and the tokens, and are others for other tokens and for another purpose.

        The secret keeps whoever sees something made with them from trying out tokens against it.
        """
        # A token holds no space and no line end, so that no two sets of tokens are written alike.
        written = b"".join(sorted(role.encode() + b" " + token + b"\n" for token, role in self.roles.items()))
        return hmac.digest(secret, purpose + b"\n" + written, "sha256")


def read_tokens(file: Path | None, environment: Mapping[str, str] = os.environ) -> Tokens:
    """The tokens of a file, or the one of the variable SVEV_TOKEN, which may do everything.

    A file holds one token alone, which may do everything, or lines of role and token; lines that begin with `#` are
    comments.

    Raises:
        BadInputError: the file cannot be read, or is malformed. The message quotes no token.
    """
    if file is None:
        given = environment.get(TOKEN_VARIABLE)
        return Tokens() if given is None else Tokens({_token(given.encode().strip(), TOKEN_VARIABLE): Role.ADMINISTER})
    try:
        with open_to_read(file, links=True) as opened:
            content, status = opened.read(_FILE_MAX + 1), os.fstat(opened.fileno())
    except OSError as error:
        raise BadInputError(f"{file}: token cannot be read ({error.strerror}); check path and permissions") from None
    return Tokens(_parse(content, str(file)), _readable_by_all(file, status))


def _parse(content: bytes, where: str) -> dict[bytes, Role]:
    if len(content) > _FILE_MAX:
        raise _malformed(where)
    if len(content.split()) == 1:
        return {_token(content.strip(), where): Role.ADMINISTER}
    found: dict[bytes, Role] = {}
    names = {role.value.encode(): role for role in Role}
    for line in content.splitlines():
        words = line.split()
        if not words or words[0].startswith(b"#"):
            continue
        if len(words) != 2 or words[0] not in names:
            raise _malformed(where)
        if _token(words[1], where) in found:
            raise BadInputError(f"{where}: one token stands there twice: make each with openssl rand -hex 24")
        found[words[1]] = names[words[0]]
    if not found:
        raise _malformed(where)
    return found


def _token(token: bytes, where: str) -> bytes:
    if not TOKEN_MIN <= len(token) <= _TOKEN_MAX or not all(0x21 <= byte <= 0x7E for byte in token):
        raise _malformed(where)
    return token


def _malformed(where: str) -> BadInputError:
    return BadInputError(
        f"{where}: a token has {TOKEN_MIN} to {_TOKEN_MAX} letters, digits and signs on one line, no spaces, alone or "
        f"after its role ({_ROLES}); make one with: openssl rand -hex 24"
    )


def _readable_by_all(file: Path, status: os.stat_result) -> str:
    """A warning if every user of this computer can read the file; its group may, the service may run in it."""
    if not status.st_mode & stat.S_IRWXO:
        return ""
    # A file that another user owns is read as a member of its group.
    mode = "600" if status.st_uid == os.geteuid() else "640"
    return f"every user of this computer can read the tokens in {file}: chmod {mode} {file}"
