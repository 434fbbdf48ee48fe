"""One bad file is one bad entry: it says what is wrong, and the others are listed as if it were not there."""

import os
import shutil
import threading
from pathlib import Path

import pytest

from recorder.catalogue.entry import LogState
from recorder.catalogue.folder import Catalogue
from rig.errors import BadInputError, StorageError, UnknownRecordingError
from tests.recorder.catalogue.bad_files import GOOD, write_bad_files
from tests.recorder.catalogue.unprivileged import unprivileged
from tests.recorder.logs import ALL_OK, write_log


@pytest.mark.timeout(60)
def test_every_bad_file_is_one_bad_entry(tmp_path: Path) -> None:
    bad = write_bad_files(tmp_path)
    catalogue = Catalogue(tmp_path)
    entries = {entry.id: entry for entry in catalogue.entries()}
    assert set(entries) == bad | {GOOD}
    assert (entries[GOOD].state, entries[GOOD].pulses, entries[GOOD].trouble) == (LogState.CLOSED, 6, "")
    for name in bad:
        entry = entries[name]
        assert entry.state is not LogState.CLOSED or "session.json: " in entry.trouble, entry
        assert len(entry.trouble) < 1000
        assert entry.trouble.isprintable()
        assert catalogue.entry(name) == entry


def test_a_damaged_head_is_not_the_end_of_a_recording(tmp_path: Path) -> None:
    write_bad_files(tmp_path)
    for name in ("headless", "other_profile"):
        entry = Catalogue(tmp_path).entry(name)
        assert entry.state is LogState.DAMAGED
        assert "or its beginning is damaged; try svev recover" in entry.trouble


@pytest.mark.parametrize("name", ["directory", "pipe", "dangling", "loop", "zero", "foreign"])
def test_asking_for_the_content_of_a_bad_file_is_bad_input(tmp_path: Path, name: str) -> None:
    write_bad_files(tmp_path)
    catalogue = Catalogue(tmp_path)
    with pytest.raises(BadInputError):
        catalogue.tags(name)
    with pytest.raises(BadInputError):
        catalogue.image(name, 1)
    if name not in {"zero", "foreign"}:
        with pytest.raises(BadInputError):
            catalogue.file(name)


@pytest.mark.parametrize("name", ["pipe", "dangling", "loop", "zero", "foreign"])
def test_bad_files_go_to_the_trash_and_for_good(tmp_path: Path, name: str) -> None:
    write_bad_files(tmp_path)
    (tmp_path / ".trash").mkdir()
    (tmp_path / ".trash" / f"{name}.mcap").symlink_to("nowhere")  # the name is taken
    catalogue = Catalogue(tmp_path)
    assert catalogue.delete(name).id == f"{name}-2"
    with pytest.raises(UnknownRecordingError):
        catalogue.file(f"{name}-9")
    assert catalogue.purge().recordings == 2
    assert not os.path.lexists(tmp_path / f"{name}.mcap")


def test_a_folder_in_the_trash_is_never_removed(tmp_path: Path) -> None:
    write_bad_files(tmp_path)
    catalogue = Catalogue(tmp_path)
    (tmp_path / "directory.mcap" / "thesis.tex").touch()
    catalogue.delete("directory")
    catalogue.delete(GOOD)
    assert catalogue.purge().recordings == 1
    catalogue.restore("directory")
    assert (tmp_path / "directory.mcap" / "thesis.tex").exists()


def test_what_may_not_be_read_says_so(open_folder: Path) -> None:
    for name in ("jump", "closed"):
        write_log(open_folder / f"{name}.mcap", (ALL_OK,))
    (open_folder / "closed.mcap").chmod(0)
    (open_folder / "jump.session.json").write_text("{}")
    (open_folder / "jump.session.json").chmod(0)
    with unprivileged():
        catalogue = Catalogue(open_folder)
        entries = {entry.id: entry for entry in catalogue.entries()}
        assert entries["closed"].state is LogState.DAMAGED
        assert "cannot be read (Permission denied); check its permissions" in entries["closed"].trouble
        assert "session.json: cannot be read (Permission denied)" in entries["jump"].trouble
        assert entries["jump"].pulses == 1
        with pytest.raises(BadInputError, match="Permission denied"):
            catalogue.file("closed")


def test_a_folder_that_may_not_be_read_is_no_empty_one(open_folder: Path) -> None:
    write_log(open_folder / "jump.mcap", (ALL_OK,))
    open_folder.chmod(0o311)
    try:
        with unprivileged(), pytest.raises(StorageError, match="check the folder's permissions"):
            Catalogue(open_folder).entries()
    finally:
        open_folder.chmod(0o755)


def test_files_may_come_and_go_while_they_are_listed(tmp_path: Path) -> None:
    write_log(tmp_path / "stays.mcap", (ALL_OK,))
    ended = threading.Event()

    def come_and_go() -> None:
        while not ended.is_set():
            for name in ("a", "b", "c"):
                shutil.copyfile(tmp_path / "stays.mcap", tmp_path / f"{name}.mcap")
            for name in ("a", "b", "c"):
                (tmp_path / f"{name}.mcap").unlink()

    thread = threading.Thread(target=come_and_go)
    thread.start()
    try:
        catalogue = Catalogue(tmp_path)
        for _ in range(300):
            assert "stays" in {entry.id for entry in catalogue.entries()}
    finally:
        ended.set()
        thread.join()
