"""Changes of a folder by whomever are told by name; what cannot be told means that everything has changed."""

import json
import os
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recorder.catalogue import folder_watch
from recorder.catalogue.database import FILES
from recorder.catalogue.entry import Entry
from recorder.catalogue.folder import Catalogue
from recorder.catalogue.folder_watch import FolderWatch
from recorder.log.session_changes import session_path
from tests.recorder.logs import ALL_OK, LOST, OK, write_log


def test_names_that_change_are_told_once(tmp_path: Path) -> None:
    (tmp_path / "there").touch()
    watch = FolderWatch(tmp_path)
    assert watch.changed() is None
    assert watch.changed() == set()
    (tmp_path / "new").write_text("x")
    (tmp_path / "there").rename(tmp_path / "renamed")
    assert watch.changed() == {"new", "there", "renamed"}
    assert watch.changed() == set()
    with (tmp_path / "new").open("a") as file:  # in place: the folder itself does not change
        file.write("y")
        file.flush()
    assert watch.changed() == {"new"}


def test_another_folder_of_the_name_is_looked_at_as_a_whole(tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    watch = FolderWatch(folder)
    watch.changed()
    folder.rename(tmp_path / "old")
    with pytest.raises(FileNotFoundError):
        watch.changed()
    folder.mkdir()
    assert watch.changed() is None
    (folder / "a").touch()
    assert watch.changed() == {"a"}


def test_changes_that_were_lost_or_told_to_nobody_mean_everything(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    watch = FolderWatch(tmp_path)
    watch.changed()
    for number in range(int(Path("/proc/sys/fs/inotify/max_queued_events").read_text()) // 2 + 1):
        (tmp_path / f"{number % 2}").touch()
        (tmp_path / f"{number % 2}").unlink()
    assert watch.changed() is None
    assert watch.changed() == set()
    os.utime(tmp_path, ns=(1, 1))  # as after a change by another computer, of which this kernel knows nothing
    watch._told()
    assert watch.changed() is None
    monkeypatch.setattr(folder_watch._LIBC, "inotify_init1", lambda _: -1)
    watch.forget()
    assert [watch.changed(), watch.changed()] == [None, None]


_NAMES = st.sampled_from(["a", "b", "c"])
_ACTS = st.lists(
    st.tuples(st.sampled_from(["add", "remove", "rename", "overwrite", "session", "trash", "list"]), _NAMES, _NAMES),
    max_size=8,
)


@settings(max_examples=25)
@given(acts=_ACTS)
def test_whatever_people_do_in_the_folder_the_list_is_that_of_a_new_catalogue(acts: list[tuple[str, str, str]]) -> None:
    with TemporaryDirectory() as name:
        folder = Path(name)
        catalogue = Catalogue(folder)
        for act, one, other in acts:
            _act(folder, catalogue, act, folder / f"{one}.mcap", folder / f"{other}.mcap")
        listed = _both(catalogue)
        catalogue.close()
        kept = _both(again := Catalogue(folder))
        again.close()
        for file in FILES:
            (folder / file).unlink(missing_ok=True)
        fresh = _both(again := Catalogue(folder))
        again.close()
        assert listed == kept == fresh


def _act(folder: Path, catalogue: Catalogue, act: str, log: Path, other: Path) -> None:
    if act == "list":
        _both(catalogue)
    elif act == "add" and not log.exists():
        write_log(log, (ALL_OK, (OK, LOST, OK)))
    elif act == "session":
        session_path(log).write_text(json.dumps({"athlete": other.stem}))
    elif log.exists():
        if act == "remove":
            log.unlink()
        elif act == "rename":
            log.rename(other)
        elif act == "trash":
            catalogue.delete(log.stem)
        elif act == "overwrite":
            write_log(folder / "other", (ALL_OK,))
            shutil.copyfile(folder / "other", log)


def _both(catalogue: Catalogue) -> list[list[Entry]]:
    return [catalogue.entries(), catalogue.entries(deleted=True)]
