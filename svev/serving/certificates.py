"""Makes a certification authority (CA) of one's own and certificates of servers, with the program openssl."""

import re
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from ipaddress import ip_address
from pathlib import Path
from typing import Final

from rig.errors import BadInputError, ProcessDiedError

_CA_DAYS: Final = 3650
#: The most that Apple's devices accept from a CA that their owner has installed (support.apple.com/103769).
_SERVER_DAYS: Final = 825
#: A subject has at most 64 characters (RFC 5280, A.1); the CA's has some more than the name.
_NAME_MAX: Final = 58
_OPENSSL_S: Final = 30.0
_MONTH_S: Final = 30 * 86400
_OWN: Final = ("localhost", "127.0.0.1")
#: RFC 5280: 4.2.1.9 basic constraints, 4.2.1.10 name constraints, 4.2.1.12 extended key usage.
_CONFIG: Final = """
[req]
distinguished_name = subject
prompt = no
[subject]
CN = {subject}
[ca]
basicConstraints = critical, CA:TRUE, pathlen:0
keyUsage = critical, keyCertSign, cRLSign
subjectKeyIdentifier = hash
nameConstraints = critical, {permitted}
[server]
basicConstraints = critical, CA:FALSE
keyUsage = critical, digitalSignature
extendedKeyUsage = serverAuth
subjectKeyIdentifier = hash
authorityKeyIdentifier = keyid
subjectAltName = {names}
"""


@dataclass(frozen=True, slots=True)
class CertificateFiles:
    """The files in one folder, PEM.

    Attributes:
        authority: the CA's certificate, for phones and programs.
        authority_key: the CA's private key; signs later certificates.
        certificate: of the server.
        key: the server's private key.
    """

    authority: Path
    authority_key: Path
    certificate: Path
    key: Path

    @classmethod
    def within(cls, folder: Path) -> "CertificateFiles":
        """The files of a folder, there or not."""
        return cls(folder / "ca.crt", folder / "ca.key", folder / "server.crt", folder / "server.key")


def make_certificate(names: Sequence[str], folder: Path) -> CertificateFiles:
    """Make a server's certificate, and before it the CA if the folder has none.

    The CA is good for the names that it was made for and for no others, so a phone that trusts it trusts nothing else.
    A certificate that is there is replaced once the new one is whole.

    Args:
        names: names and IP addresses by which the server is called; those of loopback are added.
        folder: made if missing.

    Raises:
        BadInputError: a name is none, the CA of the folder is for other names, or a file cannot be written.
        ProcessDiedError: openssl is not installed, or failed.
    """
    wanted = tuple(dict.fromkeys((*names, *_OWN)))
    for name in wanted:
        check_name(name)
    files = CertificateFiles.within(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder, prefix=".new-") as place:
            new = CertificateFiles.within(Path(place))
            has_authority = files.authority.exists() and files.authority_key.exists()
            if not has_authority:
                _sign(new.authority, new.authority_key, wanted, None)
            authority = files if has_authority else new
            _sign(new.certificate, new.key, wanted, authority)
            _check(new.certificate, authority.authority, folder)
            if not has_authority:
                new.authority_key.replace(files.authority_key)
                new.authority.replace(files.authority)
            new.key.replace(files.key)
            new.certificate.replace(files.certificate)
    except OSError as error:
        raise BadInputError(f"{folder}: cannot be written ({error.strerror}); choose another --out") from None
    return files


def check_name(name: str) -> None:
    """Check the name of a computer.

    Raises:
        BadInputError: it is none, and no IP address either.
    """
    if not _is_address(name) and not _is_host_name(name):
        raise BadInputError(f"{name}: no name of a computer and no IP address; give one like hillpc.local")


def is_signed_for(names: Sequence[str], certificate: Path) -> bool:
    """Whether a certificate is for exactly these names, beside those of loopback, and lasts another month.

    Raises:
        ProcessDiedError: openssl is not installed.
    """
    command = [
        "openssl",
        "x509",
        "-in",
        str(certificate),
        "-noout",
        "-checkend",
        str(_MONTH_S),
        "-ext",
        "subjectAltName",
    ]
    done = _run(command)
    found = set(re.findall(r"(?:DNS|IP Address):([^,\s]+)", done.stdout))
    return done.returncode == 0 and found == {*names, *_OWN}


def _sign(certificate: Path, key: Path, names: Sequence[str], authority: CertificateFiles | None) -> None:
    """Make a key and a certificate for it, signed by the CA; without one, it is a CA's own."""
    kinds = [("IP" if _is_address(name) else "DNS", name) for name in names]
    config = certificate.with_suffix(".cnf")
    text = _CONFIG.format(
        subject=names[0] if authority else f"Svev {names[0]}",
        names=", ".join(f"{kind}:{name}" for kind, name in kinds),
        permitted=", ".join(f"permitted;{kind}:{name}{_mask(name)}" for kind, name in kinds),
    )
    config.write_text(text, encoding="ascii")
    section, days = ("server", _SERVER_DAYS) if authority else ("ca", _CA_DAYS)
    signer = ["-CA", str(authority.authority), "-CAkey", str(authority.authority_key)] if authority else []
    _openssl(
        "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-noenc", "-sha256", "-config",
        str(config), "-extensions", section, "-days", str(days), "-keyout", str(key), "-out", str(certificate), *signer,
    )  # fmt: skip
    key.chmod(0o600)
    certificate.chmod(0o644)


def _check(certificate: Path, authority: Path, folder: Path) -> None:
    """Check that the CA may sign this certificate, as a client does."""
    if _run(["openssl", "verify", "-x509_strict", "-CAfile", str(authority), str(certificate)]).returncode:
        raise BadInputError(
            f"{folder}: its CA was made for other names, or has ended: make a new one with another --out, and install "
            "its ca.crt on the phones"
        )


def _openssl(*arguments: str) -> None:
    done = _run(["openssl", *arguments])
    if done.returncode:
        reason = (done.stderr.strip().splitlines() or ["no reason given"])[-1]
        raise ProcessDiedError(f"openssl failed ({reason}): look at the names, and try again")


def _run(command: Sequence[str]) -> "subprocess.CompletedProcess[str]":
    try:
        return subprocess.run(command, capture_output=True, text=True, timeout=_OPENSSL_S, check=False)
    except FileNotFoundError:
        raise ProcessDiedError("the program openssl is missing: sudo apt install openssl") from None


def _mask(name: str) -> str:
    """An address as a network of itself alone, as name constraints want it."""
    if not _is_address(name):
        return ""
    address = ip_address(name)
    return "/" + str(type(address)((1 << address.max_prefixlen) - 1))


def _is_address(name: str) -> bool:
    try:
        ip_address(name)
    except ValueError:
        return False
    return True


def _is_host_name(name: str) -> bool:
    labels = name.split(".")
    whole = name.isascii() and len(name) <= _NAME_MAX
    return whole and all(label.replace("-", "").isalnum() and label.strip("-") == label for label in labels)
