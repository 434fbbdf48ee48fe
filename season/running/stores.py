"""Logs and their results where they are: on disks of this computer, or in an object store (fsspec).

A result is whole or absent. On a disk its folder gets its name when everything in it is written; an object store has no
folders and no renaming, so there the file that says what came of the log is written last and removed first.
"""

import os
import shutil
import tempfile
import uuid
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from rig.errors import BadInputError
from rig.host.disk import replace_file, sync
from rig.host.object_store import Options, object_store, why_not

#: Ending of the folder with the result of a log.
RESULT: Final = ".season"
#: Name of the file in it that says what came of the log.
OUTCOME: Final = "season.json"
_LOG: Final = ".mcap"


@dataclass(frozen=True, slots=True)
class Entry:
    """A log as its store lists it.

    Attributes:
        url: a path, or an address of an object store.
        stamp: changes when the log does: size and time of change, or what the store calls its version.
    """

    url: str
    stamp: str


def is_remote(url: str) -> bool:
    """Whether a log is in an object store."""
    return "://" in url


def result_url(url: str) -> str:
    """The folder with the result of a log, beside it."""
    return url.removesuffix(_LOG) + RESULT


def listed(place: str, options: Options) -> list[Entry]:
    """The logs at a place.

    Args:
        place: a log, a folder, or a pattern.
        options: of the object store.

    Raises:
        BadInputError: there is none, or the store does not answer.
    """
    try:
        with _store(place, options) as (store, path):
            if any(each in path for each in "*?["):
                found = store.glob(path, detail=True)
            elif path.endswith(_LOG):
                found = {path: store.info(path)}
            else:
                found = store.glob(f"{path.rstrip('/')}/**/*{_LOG}", detail=True)
    except FileNotFoundError:
        found = {}
    except OSError as error:
        text = f"{place}: cannot be listed ({why_not(error)}); check address, keys and network"
        raise BadInputError(text) from error
    logs = {name: info for name, info in found.items() if name.endswith(_LOG) and info.get("type") == "file"}
    if not logs:
        raise BadInputError(f"{place}: no log (*{_LOG}) is there; correct the place in the campaign")
    scheme = place.partition("://")[0] + "://" if is_remote(place) else ""
    return [Entry(scheme + name, _stamp(info)) for name, info in sorted(logs.items())]


def read_results(urls: Sequence[str], name: str, options: Options) -> list[bytes | None]:
    """The files of a name in the results of logs, None where there is none, in the order of the logs.

    Raises:
        BadInputError: a store does not answer.
    """
    there: dict[str, bytes | None] = {}
    remote = [url for url in urls if is_remote(url)]
    for scheme in {url.partition("://")[0] for url in remote}:
        of_scheme = [url for url in remote if url.startswith(f"{scheme}://")]
        try:
            with _store(of_scheme[0], options) as (store, _):
                paths = {store._strip_protocol(f"{result_url(url)}/{name}"): url for url in of_scheme}
                found = store.cat(list(paths), on_error="return")
        except OSError as error:
            text = f"{of_scheme[0]}: its result cannot be read ({why_not(error)}); check address, keys and network"
            raise BadInputError(text) from error
        for path, content in found.items():
            if isinstance(content, Exception) and not isinstance(content, FileNotFoundError):
                raise BadInputError(f"{paths[path]}: its result cannot be read ({content}); check your rights")
            there[paths[path]] = content if isinstance(content, bytes) else None
    return [there[url] if is_remote(url) else _read_local(Path(result_url(url)) / name) for url in urls]


def read_outcomes(urls: Sequence[str], options: Options) -> list[bytes | None]:
    """What came of logs, None where nothing is there, in their order.

    Raises:
        BadInputError: a store does not answer.
    """
    return read_results(urls, OUTCOME, options)


@contextmanager
def at_hand(url: str, options: Options) -> Iterator[Path]:
    """A log as a file of this computer: itself, or a copy for the while; with the changes of its session beside it.

    Raises:
        OSError: it cannot be read.
    """
    if not is_remote(url):
        yield Path(url)
        return
    from recorder.log.session_changes import session_path  # noqa: PLC0415 - only logs elsewhere need it

    with tempfile.TemporaryDirectory(prefix="svev-season-") as folder:
        with _store(url, options) as (store, path):
            log = Path(folder) / path.rsplit("/", 1)[1]
            store.get_file(path, str(log))
            beside = session_path(log)
            try:
                store.get_file(f"{path.rsplit('/', 1)[0]}/{beside.name}", str(beside))
            except FileNotFoundError:
                beside.unlink(missing_ok=True)
        yield log


@contextmanager
def new_result(url: str, options: Options) -> Iterator[Path]:
    """A folder to write the result of a log into; when the block ends without an error, it takes its place whole.

    Raises:
        OSError: it cannot be written.
    """
    if is_remote(url):
        with tempfile.TemporaryDirectory(prefix="svev-season-") as folder:
            yield Path(folder)
            _upload(Path(folder), url, options)
        return
    target = Path(result_url(url))
    # Left by a killed worker. A worker that lost the scheduler and still works on this log fails by this, which
    # is right: its result is not wanted any more.
    for left in left_behind([url]):
        shutil.rmtree(left)
    made = target.with_name(f".{target.name}.{uuid.uuid4().hex}")
    made.mkdir()
    try:
        yield made
        for path in made.iterdir():
            sync(path)
        old = made.with_name(f"{made.name}.old")
        if os.path.lexists(target):
            target.rename(old)
        made.rename(target)
        sync(target.parent)
        shutil.rmtree(old, ignore_errors=True)
    except BaseException:
        shutil.rmtree(made, ignore_errors=True)
        raise


def left_behind(urls: Iterable[str]) -> list[Path]:
    """Hidden folders beside logs of this computer in which killed workers wrote results."""
    names: dict[Path, set[str]] = {}
    for target in (Path(result_url(url)) for url in urls if not is_remote(url)):
        names.setdefault(target.parent, set()).add(target.name)
    return [
        path
        for folder, targets in names.items()
        for path in folder.glob(f".*{RESULT}.*")
        if path.name[1:].rpartition(f"{RESULT}.")[0] + RESULT in targets
    ]


def replace_outcome(url: str, content: bytes, options: Options) -> None:
    """Replace the file that says what came of a log; the other files of its result stay.

    Raises:
        OSError: it cannot be written.
    """
    if is_remote(url):
        with _store(f"{result_url(url)}/{OUTCOME}", options) as (store, path):
            store.pipe_file(path, content)
    else:
        replace_file(Path(result_url(url)) / OUTCOME, content, links=False)


def _upload(folder: Path, url: str, options: Options) -> None:
    with _store(result_url(url), options) as (store, target):
        if store.exists(target):
            before = [str(path) for path in store.find(target)]
            outcome = f"{target}/{OUTCOME}"
            if outcome in before:
                store.rm_file(outcome)
            for path in before:
                if path != outcome:
                    store.rm_file(path)
        names = sorted((path.name for path in folder.iterdir()), key=lambda name: name == OUTCOME)
        for name in names:  # what came of it is the last one
            store.put_file(str(folder / name), f"{target}/{name}")


def _read_local(path: Path) -> bytes | None:
    try:
        return path.read_bytes()
    except (FileNotFoundError, NotADirectoryError):
        return None


def _store(url: str, options: Options) -> AbstractContextManager[tuple[Any, str]]:
    """The store of an address, or the disk of a path, and the path in it."""
    return object_store(url, options if is_remote(url) else {})


def _stamp(info: Mapping[str, Any]) -> str:
    if "ino" in info:
        return f"{info['size']}-{Path(info['name']).stat().st_mtime_ns}"
    version = info.get("ETag") or info.get("etag") or info.get("LastModified") or info.get("mtime") or ""
    return f"{info['size']}-{str(version).strip(chr(34))}"
