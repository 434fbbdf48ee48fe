"""The certificate with which the panel speaks HTTPS itself."""

import os
import ssl
from dataclasses import dataclass
from pathlib import Path

from rig.errors import BadInputError
from rig.host.files import open_regular


@dataclass(frozen=True, slots=True)
class Tls:
    """Certificate and key of the server, PEM; `of` makes it.

    Attributes:
        certificate: file of the certificate, with those between it and the CA if there are any.
        key: file of its private key, without passphrase.
    """

    certificate: Path
    key: Path

    @classmethod
    def of(cls, certificate: Path | None, key: Path | None) -> "Tls | None":
        """Certificate and key that a server can use, None if neither is given.

        Raises:
            BadInputError: only one is given, or they cannot be read or do not belong together.
        """
        if certificate is None and key is None:
            return None
        if certificate is None or key is None:
            raise BadInputError(
                "--tls-certificate and --tls-key belong together: give both; svev certificate makes them"
            )
        try:
            for each in (certificate, key):
                os.close(open_regular(each, links=True))  # OpenSSL would wait for a pipe
            # An encrypted key would have OpenSSL ask at the terminal, which a service has not: an empty answer fails.
            ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(certificate, key, password="")
        except OSError as error:
            raise BadInputError(
                f"{certificate}, {key}: no certificate with its key that can be read ({error.strerror or error}); "
                "check path and permissions, or make them with svev certificate"
            ) from None
        return cls(certificate, key)
