"""The name of a file in the making, and the one that it gets when it is whole."""

import errno
import os
from pathlib import Path

import pytest

from rig.host import file_names
from rig.host.file_names import NAME_MAX, give_name, unfinished_path


def test_a_file_in_the_making_is_hidden_beside_its_place() -> None:
    assert unfinished_path(Path("a/jump.mcap"), ".part") == Path("a/.jump.mcap.part")


@pytest.mark.parametrize("letter", ["a", "ø", "\udce5"])
def test_long_names_are_cut_and_still_differ(letter: str, tmp_path: Path) -> None:
    most = letter * (NAME_MAX // len(os.fsencode(letter)) - 1)
    paths = [unfinished_path(tmp_path / f"{most}{last}", ".part") for last in "bc"]
    for path in paths:
        path.touch()
    assert len(set(tmp_path.iterdir())) == 2
    assert all(path.name.startswith(f".{letter * 100}") and path.name.endswith(".part") for path in paths)


@pytest.mark.parametrize("without", [(), ("_rename_exclusively",), ("_rename_exclusively", "os.link")])
@pytest.mark.parametrize("error", [errno.ENOTSUP, errno.ENOSYS, errno.EMLINK, errno.EPERM])
class TestEveryFileSystem:
    """Some take no exclusive renaming, some no links either."""

    def test_gives_the_file_its_name(
        self, without: tuple[str, ...], error: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        _forbid(monkeypatch, without, error)
        file, name = tmp_path / ".part", tmp_path / "name"
        file.write_text("whole")
        give_name(file, name)
        assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("name", "whole")]

    def test_replaces_nothing(
        self, without: tuple[str, ...], error: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        _forbid(monkeypatch, without, error)
        file, name = tmp_path / ".part", tmp_path / "name"
        file.write_text("whole")
        for make in (lambda: name.write_text("precious"), lambda: name.symlink_to("nowhere")):
            make()
            before = name.lstat().st_ino
            with pytest.raises(FileExistsError):
                give_name(file, name)
            assert (file.read_text(), name.lstat().st_ino) == ("whole", before)
            name.unlink()


def test_a_disk_that_refuses_leaves_the_file(tmp_path: Path) -> None:
    file = tmp_path / ".part"
    file.write_text("whole")
    with pytest.raises(FileNotFoundError):
        give_name(file, tmp_path / "no folder" / "name")
    assert file.read_text() == "whole"


def _forbid(monkeypatch: pytest.MonkeyPatch, calls: tuple[str, ...], error: int) -> None:
    def refuses(*_: object, **__: object) -> None:
        raise OSError(error, os.strerror(error))

    for call in calls:
        monkeypatch.setattr(*(("os.link", refuses) if call == "os.link" else (file_names, call, refuses)))
