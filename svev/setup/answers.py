"""The answers that a hill is set up with, and those of today: what its files say already."""

import re
from dataclasses import dataclass, replace
from ipaddress import AddressValueError, IPv4Address
from pathlib import Path
from typing import Literal, get_args

from rig.errors import BadInputError
from rig.settings.camera import Backend, CameraSettings
from rig.settings.file import load_rig
from rig.settings.model import RigSettings
from svev.setup.options_file import ServiceOptions

RIG, TOKEN, TLS, OPTIONS = "rig.toml", "token", "tls", "options"
Source = Literal["external", "triggerbox", "gpio", "action", "software", "iidc-broadcast"]
SOURCES: tuple[Source, ...] = get_args(Source)
Language = Literal["en", "nb"]
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,15}")


@dataclass(frozen=True, slots=True)
class CameraAnswer:
    """One camera of the rig.

    Attributes:
        address: IPv4 address (back end aravis) or GUID (iidc).
        region: size of its whole sensor, columns and rows, for a camera that is new in the rig file; None: not known.
    """

    name: str
    backend: Backend
    address: str
    region: tuple[int, int] | None = None

    @property
    def option(self) -> str:
        """The camera as the value of --camera."""
        return f"{self.name}={self.address}"

    def called(self, name: str) -> "CameraAnswer":
        """The camera under another name."""
        return replace(self, name=name)

    def with_region(self, region: tuple[int, int] | None) -> "CameraAnswer":
        """The camera with the size of its sensor."""
        return replace(self, region=region)


@dataclass(frozen=True, slots=True)
class Answers:
    """Everything that is asked.

    Attributes:
        cameras: from left to right.
        input: input of GigE Vision cameras that the trigger cable leads to; None: of no interest.
        port, line: of a trigger box, of a line of this computer; None: of no interest.
        survey: file of the balls; None: none yet.
        recordings: folder, absolute.
        phones: whether other computers reach the page, under these names and addresses, and by HTTPS.
        packet_size: the largest packets that come through from all cameras, bytes; None: keep what is set.
    """

    language: Language
    name: str
    cameras: tuple[CameraAnswer, ...]
    source: Source
    rate_hz: float
    input: str | None
    port: str | None
    line: str | None
    survey: Path | None
    recordings: Path
    phones: bool
    names: tuple[str, ...]
    https: bool
    packet_size: int | None = None

    @property
    def survey_name(self) -> str:
        """Name of the survey beside the rig file; its end says which format it has."""
        return f"survey{self.survey.suffix}" if self.survey is not None else ""

    def command_line(self) -> list[str]:
        """The answers as options of `svev setup`."""
        words = ["--language", self.language, "--name", self.name]
        for camera in self.cameras:
            words += ["--camera", camera.option]
        words += ["--trigger", self.source, "--rate", f"{self.rate_hz:g}"]
        for option, value in (("--trigger-input", self.input), ("--trigger-port", self.port)):
            words += [option, value] if value is not None else []
        words += ["--trigger-line", self.line] if self.line is not None else []
        words += ["--survey", str(self.survey.absolute())] if self.survey is not None else []
        words += ["--phones" if self.phones else "--no-phones"]
        for name in self.names if self.phones else ():
            words += ["--call", name]
        return words + ["--https" if self.https else "--no-https"] * self.phones


@dataclass(frozen=True, slots=True)
class Today:
    """What the files of a folder say.

    Attributes:
        rig: the rig file; None: there is none.
        options: of the service.
    """

    rig: RigSettings | None
    options: ServiceOptions

    @classmethod
    def of(cls, folder: Path) -> "Today":
        """Read the files.

        Raises:
            BadInputError: the rig file is broken.
        """
        path = folder / RIG
        return cls(load_rig(path) if path.exists() else None, ServiceOptions.read(folder / OPTIONS))

    @property
    def cameras(self) -> tuple[CameraSettings, ...]:
        """The real cameras of the rig file."""
        if self.rig is None or self.rig.simulation is not None:
            return ()
        return tuple(camera for camera in self.rig.cameras if camera.backend in {"aravis", "iidc"})


def camera_of(text: str, today: tuple[CameraSettings, ...]) -> CameraAnswer:
    """A camera as it is named on the command line or typed: an address, or NAME=ADDRESS.

    Args:
        text: what was given.
        today: cameras of the rig file, whose names are kept.

    Returns:
        The camera; its name is "" if nobody has given it one.

    Raises:
        BadInputError: it is no address, or no name.
    """
    name, _, address = text.strip().rpartition("=")
    address = address.strip().lower().removeprefix("0x")
    backend: Backend = "iidc" if re.fullmatch(r"[0-9a-f]{16}", address) else "aravis"
    if backend == "aravis":
        try:
            IPv4Address(address)
        except AddressValueError:
            raise BadInputError(
                f"{text}: is no address of a camera; give an IP address such as 192.168.11.2, or the 16 digits of a "
                "FireWire camera's label"
            ) from None
    known = next((camera.name for camera in today if camera.address.lower().removeprefix("0x") == address), "")
    name = name.strip() or known
    if name and not _NAME.fullmatch(name):
        raise BadInputError(f"{name}: is no name of a camera; give a letter and up to 15 letters or digits, e.g. K1")
    return CameraAnswer(name, backend, address)
