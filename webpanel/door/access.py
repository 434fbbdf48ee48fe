"""The rules of access to the panel: the address it listens on, the names it answers to, the token."""

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from ipaddress import IPv4Network, IPv6Network, ip_address, ip_network
from pathlib import Path
from typing import Final

from starlette.requests import HTTPConnection

from rig.errors import BadInputError
from webpanel.door.tokens import TOKEN_MIN, TOKEN_VARIABLE, Tokens, read_tokens

_LOOPBACK_NAMES = frozenset({"localhost", "127.0.0.1", "::1"})
#: Who has one IPv6 address has a whole network of this size (RFC 6177, 2).
_IPV6_SITE: Final = 64


@dataclass(frozen=True, slots=True)
class Access:
    """The rules of access; `for_address` makes them.

    Attributes:
        host: the address that the service listens on.
        tokens: the tokens that clients must send one of, and their roles.
        names: host names that the service answers to, lower case.
        proxies: networks of the proxies whose word on client and scheme is believed.
    """

    host: str
    tokens: Tokens = field(default_factory=Tokens)
    names: frozenset[str] = _LOOPBACK_NAMES
    proxies: tuple[IPv4Network | IPv6Network, ...] = ()

    @classmethod
    def for_address(
        cls,
        host: str,
        token_file: Path | None = None,
        allow_hosts: Iterable[str] = (),
        environment: Mapping[str, str] = os.environ,
        proxies: Iterable[str] = (),
    ) -> "Access":
        """Access for a service that listens on `host`.

        Args:
            host: address or name to listen on.
            token_file: file that holds the tokens; None: the token is in the variable SVEV_TOKEN.
            allow_hosts: further names that the service answers to, e.g. `hillpc.local`.
            environment: for the tests.
            proxies: addresses or networks of trusted proxies, e.g. `127.0.0.1` or `10.0.0.0/24`.

        Raises:
            BadInputError: other computers reach the address and there is no token, a token is malformed, or a proxy
                is no address.
        """
        tokens = read_tokens(token_file, environment)
        if not tokens and not is_loopback(host):
            raise BadInputError(
                f"{host} is reached from other computers, which needs a token: put {TOKEN_MIN} or more characters "
                f"into a file and name it with --token-file, or set {TOKEN_VARIABLE}; or listen on 127.0.0.1"
            )
        names = _LOOPBACK_NAMES | {_bare(name) for name in (host, *allow_hosts)}
        return cls(host, tokens, names, tuple(_network(proxy) for proxy in proxies))

    def client_of(self, request: HTTPConnection) -> str:
        """The IP address of the client: the one that connected, or the one that a trusted proxy names."""
        address = request.client.host if request.client else ""
        # Each proxy appends the address that it was called from; what stands left of a stranger's, he may have made up.
        named = [part.strip() for part in ",".join(request.headers.getlist("x-forwarded-for")).split(",")]
        while self._trusts(address) and named and _is_address(named[-1]):
            address = named.pop()
        return address

    def is_https(self, request: HTTPConnection) -> bool:
        """Whether the client speaks HTTPS, with this service or with a trusted proxy."""
        if request.scope["scheme"] == "https":
            return True
        said = ",".join(request.headers.getlist("x-forwarded-proto")).rpartition(",")[2].strip().lower()
        return said == "https" and self._trusts(request.client.host if request.client else "")

    def _trusts(self, address: str) -> bool:
        return _is_address(address) and any(ip_address(address) in network for network in self.proxies)

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


def site_of(address: str) -> str:
    """What counts as one client for the brake: an IPv4 address, or the network of an IPv6 address."""
    if not _is_address(address) or ip_address(address).version == 4:
        return address
    return str(ip_network(f"{address.partition('%')[0]}/{_IPV6_SITE}", strict=False))


def _is_address(text: str) -> bool:
    try:
        ip_address(text)
    except ValueError:
        return False
    return True


def _network(proxy: str) -> IPv4Network | IPv6Network:
    try:
        return ip_network(proxy.strip().strip("[]"))
    except ValueError:
        raise BadInputError(
            f"--proxy {proxy}: no address and no network; give the address from which the proxy calls, e.g. 127.0.0.1"
        ) from None


def _bare(host: str) -> str:
    return host.strip().strip("[]").rstrip(".").lower()


def _without_port(host_header: str) -> str:
    name, colon, port = host_header.rpartition(":")
    return _bare(name if colon and port.isdecimal() and (name.startswith("[") or ":" not in name) else host_header)
