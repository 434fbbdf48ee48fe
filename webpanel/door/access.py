"""The rules of access to the panel: the address it listens on, the names it answers to, the token."""

import hmac
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from ipaddress import ip_address
from pathlib import Path

from rig.errors import BadInputError

TOKEN_VARIABLE = "SVEV_TOKEN"  # noqa: S105 - the name of the variable
_TOKEN_MIN = 16
_TOKEN_MAX = 1000
_LOOPBACK_NAMES = frozenset({"localhost", "127.0.0.1", "::1"})


@dataclass(frozen=True, slots=True)
class Access:
    """The rules of access; `for_address` makes them.

    Attributes:
        host: the address that the service listens on.
        token: the token that clients must send, None if they need none.
        names: host names that the service answers to, lower case.
    """

    host: str
    token: bytes | None = field(default=None, repr=False)
    names: frozenset[str] = _LOOPBACK_NAMES

    @classmethod
    def for_address(
        cls,
        host: str,
        token_file: Path | None = None,
        allow_hosts: Iterable[str] = (),
        environment: Mapping[str, str] = os.environ,
    ) -> "Access":
        """Access for a service that listens on `host`.

        Args:
            host: address or name to listen on.
            token_file: file that holds the token; None: the token is in the variable SVEV_TOKEN.
            allow_hosts: further names that the service answers to, e.g. `hillpc.local`.
            environment: for the tests.

        Raises:
            BadInputError: other computers reach the address and there is no token, or the token is malformed.
        """
        token = _read_token(token_file, environment)
        if token is None and not is_loopback(host):
            raise BadInputError(
                f"{host} is reached from other computers, which needs a token: put {_TOKEN_MIN} or more characters "
                f"into a file and name it with --token-file, or set {TOKEN_VARIABLE}; or listen on 127.0.0.1"
            )
        return cls(host, token, _LOOPBACK_NAMES | {_bare(name) for name in (host, *allow_hosts)})

    def knows(self, candidate: str) -> bool:
        """Whether this is the token, compared in constant time; False if there is none."""
        return self.token is not None and hmac.compare_digest(candidate.encode("utf-8", "surrogateescape"), self.token)

    def allows_host(self, host_header: str, own_address: str) -> bool:
        """Whether the service answers to this name, on any port.

        The check stops DNS rebinding: a foreign page whose name was made to lead here still sends that name.

        Args:
            host_header: name and port from the request.
            own_address: IP address at which the request arrived; the service always answers to it.
        """
        name = _without_port(host_header)
        return name in self.names or name == own_address


def is_loopback(host: str) -> bool:
    """Whether only programs on this computer reach this address."""
    if host == "localhost":
        return True
    try:
        return ip_address(_bare(host)).is_loopback
    except ValueError:
        return False


def _read_token(token_file: Path | None, environment: Mapping[str, str]) -> bytes | None:
    if token_file is not None:
        where = str(token_file)
        try:
            with token_file.open("rb") as file:
                token = file.read(_TOKEN_MAX + 2).strip()
        except OSError as error:
            raise BadInputError(
                f"{where}: token cannot be read ({error.strerror}); check path and permissions"
            ) from None
    elif TOKEN_VARIABLE in environment:
        where, token = TOKEN_VARIABLE, environment[TOKEN_VARIABLE].encode().strip()
    else:
        return None
    if not _TOKEN_MIN <= len(token) <= _TOKEN_MAX or not all(0x21 <= byte <= 0x7E for byte in token):
        raise BadInputError(
            f"{where}: a token has {_TOKEN_MIN} to {_TOKEN_MAX} letters, digits and signs on one line, no spaces; "
            "make one with: openssl rand -hex 24"
        )
    return token


def _bare(host: str) -> str:
    return host.strip().strip("[]").rstrip(".").lower()


def _without_port(host_header: str) -> str:
    name, colon, port = host_header.rpartition(":")
    return _bare(name if colon and port.isdecimal() and (name.startswith("[") or ":" not in name) else host_header)
