"""The orders to the program that copies logs: into a folder, or into an object store."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from rig.background.messages import Order
from rig.settings.model import OffloadSettings

PROGRAM: Final = "service.offloading.copying"


class Copy(Order):
    """Copy files and folders into the folder `to`, each whole or absent; what is there already stays."""

    paths: tuple[Path, ...]
    to: Path


class Confirm(Order):
    """Compare a log, its copy and the checksum beside the copy; if they differ, the copy loses its checksum."""

    log: Path
    copy: Path


class Upload(Order):
    """Copy files and folders into an object store, each file whole or absent; what is there already stays."""

    paths: tuple[Path, ...]
    store: str
    options: Mapping[str, str | bool | int]


class ConfirmUpload(Order):
    """Compare a log, its copy in an object store and the checksum beside that; if they differ, that is removed."""

    log: Path
    store: str
    options: Mapping[str, str | bool | int]


class TryStore(Order):
    """Write a small object into an object store, read it back and remove it."""

    store: str
    options: Mapping[str, str | bool | int]


def copying(paths: Sequence[Path], offload: OffloadSettings) -> Order:
    """The order to copy a log and what belongs to it."""
    if offload.to is not None:
        return Copy(paths=tuple(paths), to=offload.to)
    return Upload(paths=tuple(paths), store=offload.place, options=offload.store_options)


def confirming(log: Path, offload: OffloadSettings) -> Order:
    """The order to compare a log with its copy."""
    if offload.to is not None:
        return Confirm(log=log, copy=offload.to / log.name)
    return ConfirmUpload(log=log, store=offload.place, options=offload.store_options)
