"""Copies a log and all that belongs to it into an object store (fsspec), and reads both once more later.

An object is there whole or not at all, so a file whose copy broke off is begun anew. As on a disk a log counts as
copied when it was read back and its checksum stands beside it.
"""

import hashlib
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from rig.background.messages import End
from rig.background.program import Teller
from rig.errors import StorageError
from rig.host.files import open_to_read
from rig.host.object_store import object_store, why_not
from rig.phrase import phrase
from service.offloading.orders import ConfirmUpload, TryStore, Upload
from service.offloading.verified_copy import (
    PIECE,
    SUM,
    another_log,
    bytes_of,
    changed_copy,
    checksum,
    digest_of,
    files_of,
    progress_of,
    sum_line,
)

_LOG: Final = ".mcap"
#: Bytes of a piece of an upload: the least of S3 is 5 MB, and it takes 10 000 pieces.
_BLOCK: Final = 1 << 26
#: The object that a trial leaves where it may not be removed.
_TRIAL: Final = ".svev-doctor"


def upload(asked: Upload, tell: Teller) -> End:
    """Copy files and folders.

    Raises:
        StorageError: the store does not answer or refuses, or another log of this name is there.
    """
    with _opened(asked) as (store, base):
        wanted = [source for source in asked.paths if source.exists() and not _is_copied(source, store, base)]
        told = progress_of(bytes_of(wanted), tell)
        for source in wanted:
            if source.suffix == _LOG:
                _upload_log(source, store, f"{base}/{source.name}", told)
            else:
                _upload_beside(source, store, f"{base}/{source.name}", told)
    return End()


def confirm_upload(asked: ConfirmUpload, _: Teller) -> End:
    """Compare a log, its copy and the checksum beside that.

    Raises:
        StorageError: they differ, or the store does not answer.
    """
    with _opened(asked) as (store, base):
        copy = f"{base}/{asked.log.name}"
        wanted = store.cat_file(copy + SUM).decode().partition(" ")[0]
        if checksum(asked.log, lambda _: None) != wanted or _checksum(store, copy, lambda _: None) != wanted:
            store.rm_file(copy + SUM)
            raise changed_copy(f"{asked.store}/{asked.log.name}")
    return End()


def try_store(asked: TryStore, _: Teller) -> End:
    """See whether a store takes an object, gives it back and removes it.

    Raises:
        StorageError: it does not.
    """
    with _opened(asked) as (store, base):
        path, content = f"{base}/{_TRIAL}", uuid.uuid4().bytes
        store.pipe_file(path, content)
        if store.cat_file(path) != content:
            raise StorageError(f"{asked.store}: does not give back what was written; check the object store")
        try:
            store.rm_file(path)
        except OSError as error:
            text = "{store}: takes copies and removes none ({why}); let its keys delete, for results that change"
            raise StorageError(phrase("store_keeps_all", text, store=asked.store, why=why_not(error))) from error
    return End()


@contextmanager
def _opened(asked: Upload | ConfirmUpload | TryStore) -> Iterator[tuple[Any, str]]:
    """The store, and the path in it.

    Raises:
        StorageError: its package is missing, or whatever the store does not do in the block.
    """
    try:
        with object_store(asked.store, asked.options) as (store, base):
            yield store, base.rstrip("/")
    except OSError as error:
        text = "{store}: does not take copies ({why}); check address, keys and network, and the copy is made"
        raise StorageError(phrase("copying_no_store", text, store=asked.store, why=why_not(error))) from error


def _is_copied(source: Path, store: Any, base: str) -> bool:
    """Whether a log is there, read back; results and notes are always copied anew.

    Raises:
        StorageError: another log of this name is there.
    """
    target = f"{base}/{source.name}"
    if source.suffix != _LOG or not store.exists(target):
        return False
    if store.info(target)["size"] != source.stat().st_size:
        raise another_log(target)
    return bool(store.exists(target + SUM))


def _upload_log(source: Path, store: Any, target: str, told: Callable[[int], None]) -> None:
    """Copy a log, or accept what is there if it is the same; then its checksum."""
    if store.exists(target):
        digest = checksum(source, told)
        if _checksum(store, target, told) != digest:
            raise another_log(target)
    else:
        digest = _put(source, store, target, told)
    store.pipe_file(target + SUM, sum_line(digest, source.name))


def _upload_beside(source: Path, store: Any, target: str, told: Callable[[int], None]) -> None:
    """Copy a file or the files of a folder, and remove what is not in the folder any more."""
    if not source.is_dir():
        _put(source, store, target, told)
        return
    before = set(store.find(target)) if store.exists(target) else set()
    for path in files_of(source):
        name = f"{target}/{path.relative_to(source).as_posix()}"
        _put(path, store, name, told)
        before.discard(name)
    for name in before:
        store.rm_file(name)


def _put(source: Path, store: Any, target: str, told: Callable[[int], None]) -> str:
    """Copy a file and read it back.

    Returns:
        SHA-256 of the file, hexadecimal.

    Raises:
        StorageError: what was read back is not what was written; it is removed.
    """
    digest = hashlib.sha256()
    writer = store.open(target, "wb", block_size=_BLOCK)
    try:
        with open_to_read(source, links=False) as reader:
            while piece := reader.read(PIECE):
                writer.write(piece)
                digest.update(piece)
                told(len(piece))
    except BaseException:
        writer.discard()  # closing would make an object of what has come
        raise
    writer.close()
    wanted = digest.hexdigest()
    if _checksum(store, target, told) != wanted:
        store.rm_file(target)
        raise StorageError(f"{target}: what was read back is not what was written; check the object store")
    return wanted


def _checksum(store: Any, target: str, told: Callable[[int], None]) -> str:
    """SHA-256 of an object, hexadecimal."""
    with store.open(target, "rb", block_size=PIECE, cache_type="readahead") as reader:
        return digest_of(reader, told)
