"""Options of an object store in a file that others read."""

from typing import Annotated, Final

from pydantic import AfterValidator

#: Last words of the options by which the packages of fsspec take secrets (s3fs, gcsfs, adlfs, ...).
_SECRETS: Final = frozenset({"key", "secret", "token", "password", "credential", "credentials", "string"})

_Options = dict[str, str | bool | int]


def _without_secrets(options: _Options) -> _Options:
    for name in options:
        if name.lower().rpartition("_")[2] in _SECRETS:
            raise ValueError(
                f"{name} is a secret, and others read this file: remove it here, and set it where the package of the "
                "store looks for it, as in the environment (AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY)"
            )
    return options


#: As fsspec takes them (`endpoint_url`, `anon`, ...), without secrets.
StoreOptions = Annotated[_Options, AfterValidator(_without_secrets)]
