"""Who may reach the panel: the address it listens on, the names it is called by, the token."""

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
    """The rules of access; make it with `for_address`.

    Attributes:
        host: the address that the service listens on.
        token: what a client must know, None if nothing.
        names: host names by which clients may call the service, lower case.
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
            token_file: file that holds the token; without one the variable SVEV_TOKEN is looked at.
            allow_hosts: further names by which clients call the service, e.g. `hillpc.local`.
            environment: for the tests.

        Raises:
            BadInputError: the address is reached from other computers and there is no token, or the token is no good.
        """
        token = _read_token(token_file, environment)
        if token is None and not is_loopback(host):
            raise BadInputError(
                f"{host} is reached from other computers, which needs a token: put {_TOKEN_MIN} or more characters "
                f"into a file and name it with --token-file, or set {TOKEN_VARIABLE}; or listen on 127.0.0.1"
            )
        return cls(host, token, _LOOPBACK_NAMES | {_bare(name) for name in (host, *allow_hosts)})

    def knows(self, candidate: str) -> bool:
        """Whether this is the token; takes the same time whatever is wrong with it. Without a token nothing is."""
        return self.token is not None and hmac.compare_digest(candidate.encode("utf-8", "surrogateescape"), self.token)

    def allows_host(self, host_header: str, own_address: str) -> bool:
        """Whether a client may call the service by this name, whatever the port.

        A page from elsewhere whose name was made to lead here (DNS rebinding) still calls it by that page's name.

        Args:
            host_header: name and port from the request.
            own_address: address at which the request arrived; it cannot be somebody else's name.
        """
        name = _without_port(host_header)
        return name in self.names or name == own_address


def is_loopback(host: str) -> bool:
    """Whether only this computer reaches what listens on this address."""
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
