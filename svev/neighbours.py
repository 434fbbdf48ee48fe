"""Finds services (`svev serve`) on this computer, to say which one has what a command needs."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rig.errors import BadInputError
from rig.settings.file import load_rig

_PROC: Final = Path("/proc")
_PORT: Final = "8000"
_HOST: Final = "127.0.0.1"
_ANYWHERE: Final = ("0.0.0.0", "::")  # noqa: S104 - recognised, not listened on


@dataclass(frozen=True, slots=True)
class RunningService:
    """A service on this computer.

    Attributes:
        pid: its process.
        rig: its rig file.
        host, port: where it was told to listen.
    """

    pid: int
    rig: Path
    host: str
    port: str

    @property
    def ctl(self) -> str:
        """The command that operates it, to which an act is added."""
        host = _HOST if self.host in _ANYWHERE else self.host
        return "svev ctl" if (host, self.port) == (_HOST, _PORT) else f"svev ctl --url http://{host}:{self.port}"


def running_services(proc: Path = _PROC) -> Iterator[RunningService]:
    """The services whose command lines can be read, in no order."""
    for folder in proc.glob("[0-9]*"):
        with suppress(OSError):  # it has ended, or its working folder is another user's secret
            words = (folder / "cmdline").read_bytes().decode(errors="replace").split("\0")
            if (options := _options_of_serve(words)) is None or (rig := _value(options, "--rig")) is None:
                continue
            path = Path(rig)
            path = path if path.is_absolute() else (folder / "cwd").readlink() / path
            host, port = (_value(options, name) for name in ("--host", "--port"))
            yield RunningService(int(folder.name), path, host or _HOST, port or _PORT)


def _options_of_serve(words: Sequence[str]) -> Sequence[str] | None:
    """What stands behind `svev serve`; None if the command line is another one."""
    for place in range(1, len(words)):
        if words[place] == "serve" and Path(words[place - 1]).name in {"svev", "svev.__main__"}:
            return words[place + 1 :]
    return None


def _value(words: Sequence[str], option: str) -> str | None:
    for place, word in enumerate(words):
        if word.startswith(f"{option}="):
            return word.partition("=")[2]
        if word == option and place + 1 < len(words):
            return words[place + 1]
    return None


@contextmanager
def naming_the_publisher(address: str) -> Iterator[None]:
    """Within, the refusal of an address at which an armed service publishes says so, and how the service is operated.

    Args:
        address: at which triplets are to be published.

    Raises:
        BadInputError: the address is in use.
    """
    try:
        yield
    except BadInputError as error:
        if error.said.code != "why_address_in_use":
            raise
        for service in running_services():
            if _publishes_at(service, address):
                raise BadInputError(
                    f"{address}: svev serve (process {service.pid}) has armed these cameras: record with it "
                    f"({service.ctl} start), or disarm it first ({service.ctl} disarm)"
                ) from None
        raise


def _publishes_at(service: RunningService, address: str) -> bool:
    try:
        return load_rig(service.rig).network.publish == address
    except BadInputError:
        return False  # its rig file was changed since it began
