"""Where the files of a hill go: the folder of the installed service, or one of one's own."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final

#: The folder that the installed service reads (`systemd/places`), its data, and where what belongs to its unit goes.
SERVICE: Final = Path("/etc/svev")
_STATE: Final = Path("/var/lib/svev")
_UNITS: Final = Path("/etc/systemd/system")
_OWN: Final = "svev-hill"


@dataclass(frozen=True, slots=True)
class Places:
    """Where the files go.

    Attributes:
        folder: of the rig file, the token and the certificate.
        units: folder of systemd's units; None: no service reads these files.
        state: folder of the service's data; None: there is no service.
    """

    folder: Path
    units: Path | None = None
    state: Path | None = None

    @classmethod
    def of(cls, folder: Path | None) -> "Places":
        """The places for a folder; None: that of the service if this user may write there, otherwise one of his own."""
        if folder is None:
            folder = SERVICE if os.geteuid() == 0 or os.access(SERVICE, os.W_OK) else Path.home() / _OWN
        folder = folder.absolute()
        return cls(folder, _UNITS, _STATE) if folder == SERVICE else cls(folder)

    @property
    def recordings(self) -> Path:
        """Folder of the recordings, unless another one is named."""
        return (self.state or self.folder) / "recordings"
