"""What this process holds open: sockets with their addresses, files, pipes, memory files."""

import sys
from contextlib import suppress
from dataclasses import dataclass
from ipaddress import IPv4Address
from pathlib import Path

#: Read-only things that libraries open once and keep.
_KEPT_BY_LIBRARIES = ("/dev/null", "/dev/urandom", "/proc/", "/sys/", "/usr/", sys.prefix)
_TCP_LISTENING = "0A"


@dataclass(frozen=True, slots=True)
class Descriptor:
    """One open file descriptor: its number and what it leads to, e.g. `socket:[1234]` or a path."""

    number: int
    target: str

    @property
    def is_event(self) -> bool:
        """An eventfd or the like: GLib keeps one for its main loop once it was used."""
        return self.target.startswith("anon_inode:") and "pidfd" not in self.target

    def __str__(self) -> str:
        """For people."""
        if self.target.startswith("socket:"):
            return f"socket still open: {_socket_in_words(self.target[8:-1])} (descriptor {self.number})"
        return f"file still open: {self.target} (descriptor {self.number})"


def open_descriptors() -> frozenset[Descriptor]:
    """Everything that this process holds open, without what libraries keep for good."""
    found = set()
    for link in Path("/proc/self/fd").iterdir():
        with suppress(OSError):
            target = str(link.readlink())
            if not target.startswith(_KEPT_BY_LIBRARIES):
                found.add(Descriptor(int(link.name), target))
    return frozenset(found)


def _socket_in_words(inode: str) -> str:
    for protocol in ("tcp", "udp"):
        for fields in _table(protocol):
            if fields[9] == inode:
                state = " listening" if fields[3] == _TCP_LISTENING else ""
                return f"{protocol} {_address(fields[1])}{state}"
    for fields in _table("unix"):
        if fields[6] == inode:
            return f"unix {fields[7] if len(fields) > 7 else 'without a name'}"
    return f"inode {inode}"


def _table(protocol: str) -> list[list[str]]:
    return [line.split() for line in Path(f"/proc/self/net/{protocol}").read_text().splitlines()[1:]]


def _address(text: str) -> str:
    host, port = text.split(":")
    return f"{IPv4Address(int.from_bytes(bytes.fromhex(host), sys.byteorder))}:{int(port, 16)}"
