"""Makes the files of a hill beside their places, checks them, and puts them there together; former ones are kept.

Until the last moment nothing is changed: whoever ends it before finds everything as it was.
"""

import os
import pwd
import secrets
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from rig.errors import BadInputError
from rig.host.disk import sync
from rig.host.endings import counted_endings
from rig.settings.file import load_rig
from svev.serving.certificates import CertificateFiles, is_signed_for, make_certificate
from svev.setup.answers import OPTIONS, RIG, TLS, TOKEN, Answers, Today
from svev.setup.places import Places
from svev.setup.rig_text import rig_text

_USER: Final = "svev"
_DROP_IN: Final = "svev.service.d/recordings.conf"
_TOKEN_BYTES: Final = 16


@dataclass(frozen=True, slots=True)
class Target:
    """One file.

    Attributes:
        name: in the folder that is made beside the real one.
        path: where it goes.
        mode: its rights.
        service: whether it belongs to the service, which may change it; otherwise it may only read it.
    """

    name: str
    path: Path
    mode: int = 0o640
    service: bool = False


@dataclass(slots=True)
class Written:
    """What became of the files.

    Attributes:
        written, kept: those that are new, and those that are as they were.
        backups: the former ones.
        token: of the page; "": it has none of ours.
        authority: certificate that phones are to trust; None: there is none.
    """

    written: list[Path] = field(default_factory=list)
    kept: list[Path] = field(default_factory=list)
    backups: list[Path] = field(default_factory=list)
    token: str = ""
    authority: Path | None = None


def write(answers: Answers, today: Today, places: Places) -> Written:
    """Write the files, and make the folder of the recordings.

    Raises:
        BadInputError: a file cannot be written, or the answers make no rig.
        ProcessDiedError: openssl is not installed.
    """
    made = Written()
    folder = places.folder
    try:
        with _folder(folder), tempfile.TemporaryDirectory(prefix=".setup-", dir=folder) as name:
            stage = Path(name)
            targets = _make(answers, today, places, stage, made)
            _check(stage / RIG, folder / RIG)
            with counted_endings():  # whoever wants to end it now waits for some milliseconds
                _make_recordings(answers.recordings, places)
                _put(stage, targets, places, made)
    except OSError as error:
        raise BadInputError(
            f"{error.filename or folder}: cannot be written ({error.strerror}); call svev with sudo, or choose another "
            "--folder"
        ) from None
    return made


@contextmanager
def _folder(folder: Path) -> Iterator[None]:
    """A folder, made if missing; if it comes to nothing, it is as it was."""
    missing = not folder.exists()
    folder.mkdir(parents=True, exist_ok=True)
    try:
        yield
    except BaseException:
        if missing:
            folder.rmdir()
        raise


def _check(made: Path, shown: Path) -> None:
    """Check that the answers make a rig.

    Raises:
        BadInputError: they do not; the message names the file that was to be written.
    """
    try:
        load_rig(made)
    except BadInputError as error:
        raise BadInputError(str(error).replace(str(made), str(shown))) from None


def _make(answers: Answers, today: Today, places: Places, stage: Path, made: Written) -> list[Target]:
    """Make all files in a folder of their own; the rig file is the last that is put into its place."""
    folder, targets = places.folder, list[Target]()
    access: list[str] = []
    if answers.phones:
        host = today.options.host if today.options.phones else "0.0.0.0"  # noqa: S104 - a token guards it
        token = Path(next(iter(today.options.values("--token-file")), folder / TOKEN))
        if not token.exists():
            token = folder / TOKEN
            made.token = secrets.token_hex(_TOKEN_BYTES)
            (stage / TOKEN).write_text(f"{made.token}\n", encoding="ascii")
            targets.append(Target(TOKEN, token))
        else:
            made.kept.append(token)
        access = ["--host", host, "--token-file", str(token)]
        for name in answers.names:
            access += ["--allow-host", name]
        if answers.https:
            certificate = _make_certificate(answers.names, today, folder, stage, targets, made)
            access += ["--tls-certificate", str(certificate.certificate), "--tls-key", str(certificate.key)]
    if answers.survey is not None:
        # Beside the rig file: the service sees no home folders.
        name = answers.survey_name
        shutil.copyfile(answers.survey, stage / name)
        targets.append(Target(name, folder / name, 0o644))
    drop_in = _drop_in(answers.recordings, places)
    if drop_in is not None and places.units is not None:
        (stage / "drop-in").write_text(drop_in, encoding="utf-8")
        targets.append(Target("drop-in", places.units / _DROP_IN, 0o644))
    (stage / OPTIONS).write_text(today.options.with_access(access).text, encoding="utf-8")
    targets.append(Target(OPTIONS, folder / OPTIONS, 0o644))
    before = folder / RIG
    text = rig_text(before.read_text(encoding="utf-8") if before.exists() else None, answers)
    (stage / RIG).write_text(text, encoding="utf-8")
    return [*targets, Target(RIG, before, service=True)]


def _make_certificate(
    names: tuple[str, ...], today: Today, folder: Path, stage: Path, targets: list[Target], made: Written
) -> CertificateFiles:
    """A certificate for the names: the one that is there if it fits, or a new one, of the same authority if it may."""
    there = next(iter(today.options.values("--tls-certificate")), None)
    files = CertificateFiles.within(Path(there).parent if there is not None else folder / TLS)
    if files.certificate.exists() and is_signed_for(names, files.certificate):
        made.authority = files.authority if files.authority.exists() else None
        made.kept.append(files.certificate)
        return files
    files, new = CertificateFiles.within(folder / TLS), CertificateFiles.within(stage / TLS)
    new.key.parent.mkdir()
    signs = files.authority.exists() and files.authority_key.exists()
    if signs:
        shutil.copyfile(files.authority, new.authority)
        shutil.copyfile(files.authority_key, new.authority_key)
    try:
        make_certificate(names, stage / TLS)
    except BadInputError:
        if not signs:
            raise
        # The authority was made for other names: phones are told to trust a new one.
        new.authority.unlink()
        new.authority_key.unlink()
        make_certificate(names, stage / TLS)
    # The authority's key is for whoever administers this computer, the server's for the service.
    modes = {"ca.crt": 0o644, "server.crt": 0o644, "server.key": 0o640, "ca.key": 0o600}
    targets += [Target(f"{TLS}/{name}", folder / TLS / name, mode) for name, mode in modes.items()]
    made.authority = files.authority
    return files


def _drop_in(recordings: Path, places: Places) -> str | None:
    """What the unit has to be told of a folder outside the service's own; None: nothing."""
    if places.state is None or recordings.is_relative_to(places.state):
        return None
    return f"# Written by svev setup.\n[Unit]\nRequiresMountsFor={recordings}\n[Service]\nReadWritePaths={recordings}\n"


def _make_recordings(recordings: Path, places: Places) -> None:
    if recordings.exists():
        return
    recordings.mkdir(parents=True, mode=0o750)
    _give(recordings, places, service=True)


def _put(stage: Path, targets: list[Target], places: Places, made: Written) -> None:
    """Put the files into their places, those that differ from what is there.

    Raises:
        OSError: one cannot be written; then all are as they were.
    """
    stamp = datetime.now(UTC).strftime("%Y-%m-%dT%H-%M-%SZ")
    ready: list[tuple[Path, Path]] = []
    try:
        for target in targets:
            new, path = stage / target.name, target.path
            path.parent.mkdir(parents=True, exist_ok=True)
            if path.exists():
                if path.read_bytes() == new.read_bytes():
                    made.kept.append(path)
                    continue
                made.backups.append(path.with_name(f"{path.name}.{stamp}"))
                shutil.copy2(path, made.backups[-1])
            _set_rights(new, target, places)
            sync(new)
            ready.append((new, path))
    except OSError:
        for backup in made.backups:
            backup.unlink(missing_ok=True)
        raise
    for new, path in ready:
        shutil.move(new, path)  # renamed; copied only if it is on another disk, as systemd's folder may be
        made.written.append(path)
    for folder in {path.parent for _, path in ready}:
        sync(folder)


def _set_rights(new: Path, target: Target, places: Places) -> None:
    """Give a file the rights of the one that it renews: an administrator may have taken that from the service."""
    if not target.path.exists():
        new.chmod(target.mode)
        _give(new, places, service=target.service)
        return
    before = target.path.stat()
    new.chmod(before.st_mode & 0o777)
    if os.geteuid() == 0:
        os.chown(new, before.st_uid, before.st_gid)


def _give(path: Path, places: Places, *, service: bool) -> None:
    """Give a file of the service to its user, or to its group to read; elsewhere it is of who calls."""
    if places.state is None or os.geteuid() != 0:
        return
    with suppress(KeyError):  # the service is not installed yet: nobody has this name
        user = pwd.getpwnam(_USER)
        os.chown(path, user.pw_uid if service else 0, user.pw_gid)
