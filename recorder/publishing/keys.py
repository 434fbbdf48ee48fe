"""Keys that encrypt what is published (ZeroMQ CURVE), and whether an address needs them.

Whoever knows the publisher's public key may subscribe, and knows that it is this publisher who sends. The public key
does not travel over the network, so give it only to those who may see the images. The files are certificates as
`zmq.auth` reads and writes them.
"""

import ipaddress
import os
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import zmq
from zmq.auth import load_certificate

from rig.errors import BadInputError
from rig.phrase import Phrase, phrase
from rig.settings.model import NetworkSettings

_TCP: Final = "tcp://"
_FOR_SUBSCRIBERS: Final = (
    '# ZeroMQ CURVE: the key by which subscribers know the publisher\ncurve\n    public-key = "{}"\n'
)
_FOR_PUBLISHER: Final = "# ZeroMQ CURVE: the keys of the publisher; nobody else may read this file\ncurve\n{}"
_KEY_CHARACTERS: Final = 40


@dataclass(frozen=True, slots=True)
class Keys:
    """A publisher's keys, each 40 characters in ZeroMQ's encoding (Z85)."""

    public: bytes
    secret: bytes

    def guard(self, socket: "zmq.Socket[bytes]") -> None:
        """Let a socket, before it is bound, speak only with those who know the public key."""
        socket.curve_server = True
        socket.curve_publickey, socket.curve_secretkey = self.public, self.secret


def make_keys(name: Path) -> tuple[Path, Path]:
    """Make a pair of keys: NAME.key_secret for the publisher, NAME.key for subscribers. Only the owner may read them.

    Returns:
        The paths of both files, the secret one first.

    Raises:
        BadInputError: a file is there already, or cannot be written; or this ZeroMQ has no CURVE.
    """
    if not zmq.has("curve"):
        raise BadInputError("this build of ZeroMQ has no CURVE: install pyzmq from its wheel")
    public, secret = (key.decode() for key in zmq.curve_keypair())
    both = f'    public-key = "{public}"\n    secret-key = "{secret}"\n'
    files = name.with_name(f"{name.name}.key_secret"), name.with_name(f"{name.name}.key")
    for path, text in zip(files, (_FOR_PUBLISHER.format(both), _FOR_SUBSCRIBERS.format(public)), strict=True):
        try:
            with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
                file.write(text)
        except FileExistsError:
            raise BadInputError(f"{path}: exists already and is never overwritten; choose another name") from None
        except OSError as error:
            raise BadInputError(f"{path}: cannot be written ({error.strerror}); choose another folder") from None
    return files


def load_keys(path: Path) -> Keys:
    """Read the keys of a publisher.

    Raises:
        BadInputError: the file is missing, is no such file, or others may read it.
    """
    try:
        mode = path.stat().st_mode
        public, secret = load_certificate(path)
    except OSError as error:
        reason = error.strerror or "no such file"
        raise BadInputError(f"{path}: keys cannot be read ({reason}); make them with svev keys") from None
    except (ValueError, IndexError):
        public, secret = b"", None
    if secret is None or {len(public), len(secret)} != {_KEY_CHARACTERS}:
        raise BadInputError(f"{path}: holds no secret key; name the file .key_secret that svev keys has made")
    if stat.S_IMODE(mode) & (stat.S_IRWXG | stat.S_IRWXO):
        raise BadInputError(f"{path}: others than its owner may read the secret key; run: chmod 600 {path}")
    return Keys(public, secret)


def exposure(address: str, keys: Keys | None) -> Phrase | None:
    """Why it is unwise to publish at an address, in words; None if it is not."""
    if keys is not None or not address.startswith(_TCP) or _is_loopback(address):
        return None
    text = "whoever reaches {address} sees the images: publish on tcp://127.0.0.1, or with a key (svev keys)"
    return phrase("why_exposed", text, address=address)


def check_publication(network: NetworkSettings) -> Phrase | None:
    """Check the keys that a rig file names, before anything starts.

    Returns:
        Why it is unwise to publish like this, in words; None if it is not.

    Raises:
        BadInputError: the keys cannot be used.
    """
    return exposure(network.publish, None if network.curve_key_file is None else load_keys(network.curve_key_file))


def _is_loopback(address: str) -> bool:
    """Whether only programs on this computer reach a TCP address, as far as it says."""
    host = address.removeprefix(_TCP).rpartition(":")[0].strip("[]")
    if host in {"localhost", "lo"}:
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:  # a name, the name of an interface, or `*`
        return False
