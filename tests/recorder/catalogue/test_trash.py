"""The trash: what it holds and frees, what is removed for good, and in which order."""

import os
import time
from pathlib import Path
from stat import S_ISREG

import pytest

from recorder.catalogue.entry import LogState, read_entry
from recorder.catalogue.folder import Catalogue
from recorder.catalogue.trash import remove_for_good, trashed_logs
from rig.errors import BadInputError, StorageError, UnknownRecordingError
from tests.recorder.logs import ALL_OK, write_log
from tests.support.waiting import wait_until


def _delete(catalogue: Catalogue, name: str) -> int:
    """Record, correct and delete a jump, not in the same instant as any other.

    Returns:
        The room that it takes, with the file of its corrections.
    """
    log = catalogue.directory / f"{name}.mcap"
    write_log(log, (ALL_OK,))
    catalogue.change_session(name, {"notes": "x" * 3000})
    beside = log.with_name(f"{name}.session.json")
    taken = (log.stat().st_blocks + beside.stat().st_blocks) * 512
    before = time.time()
    catalogue.delete(name)
    wait_until(lambda: _now(catalogue.directory) > before, "the file system's clock goes on", poll_s=0.001)
    return taken


def _now(folder: Path) -> float:
    (folder / ".clock").touch()
    return (folder / ".clock").stat().st_ctime


def test_the_room_of_the_trash_is_what_its_removal_gives(tmp_path: Path) -> None:
    catalogue = Catalogue(tmp_path)
    assert (catalogue.trash().recordings, catalogue.trash().bytes) == (0, 0)
    taken = _delete(catalogue, "first") + _delete(catalogue, "second")
    assert (catalogue.trash().recordings, catalogue.trash().bytes) == (2, taken)
    os.link(tmp_path / ".trash" / "first.mcap", tmp_path / "other name")
    assert 0 < catalogue.trash().bytes < taken
    (tmp_path / "other name").unlink()
    gone = catalogue.purge()
    assert (gone.recordings, gone.bytes) == (2, taken)
    assert list((tmp_path / ".trash").iterdir()) == []


def test_room_is_made_from_what_was_deleted_first(tmp_path: Path) -> None:
    catalogue = Catalogue(tmp_path)
    sizes = {name: _delete(catalogue, name) for name in ("b", "c", "a")}
    assert [log.path.stem for log in trashed_logs(tmp_path)] == ["b", "c", "a"]
    assert catalogue.make_room(0).recordings == 0
    assert catalogue.make_room(sizes["b"] + 1).bytes == sizes["b"] + sizes["c"]
    assert {entry.id for entry in catalogue.entries(deleted=True)} == {"a"}
    assert catalogue.make_room(1e15).recordings == 1


def test_one_recording_is_removed_for_good_and_only_from_the_trash(tmp_path: Path) -> None:
    catalogue = Catalogue(tmp_path)
    _delete(catalogue, "jump")
    _delete(catalogue, "other")
    write_log(tmp_path / "jump.mcap", (ALL_OK,) * 2)
    assert catalogue.remove("jump").recordings == 1
    with pytest.raises(UnknownRecordingError, match="only what was deleted can be removed"):
        catalogue.remove("jump")
    assert catalogue.entry("jump").pulses == 2
    assert {entry.id for entry in catalogue.entries(deleted=True)} == {"other"}


def test_links_are_listed_and_never_followed(tmp_path: Path) -> None:
    folder, elsewhere = tmp_path / "recordings", tmp_path / "elsewhere.mcap"
    folder.mkdir()
    write_log(elsewhere, (ALL_OK,))
    (folder / "link.mcap").symlink_to(elsewhere)
    write_log(folder / "jump.mcap", (ALL_OK,))
    (tmp_path / "private.json").write_text('{"notes": "private"}')
    (folder / "jump.session.json").symlink_to(tmp_path / "private.json")
    catalogue = Catalogue(folder)
    link = catalogue.entry("link")
    assert (link.state, link.pulses) == (LogState.DAMAGED, 0)
    assert "links are not followed" in link.trouble
    for ask in (catalogue.file, catalogue.tags, lambda name: catalogue.image(name, 1)):
        with pytest.raises(BadInputError, match="links are not followed"):
            ask("link")
    assert "private" not in catalogue.entry("jump").session.values()
    assert "links are not followed" in catalogue.entry("jump").trouble

    assert catalogue.delete("link").deleted
    assert not catalogue.restore("link").deleted
    catalogue.delete("link")
    catalogue.delete("jump")
    assert catalogue.purge().recordings == 2
    assert elsewhere.exists()
    assert (tmp_path / "private.json").exists()


def test_a_link_that_gets_the_name_after_the_look_at_it_is_not_followed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, elsewhere = tmp_path / "recordings", tmp_path / "elsewhere.mcap"
    folder.mkdir()
    write_log(elsewhere, (ALL_OK,))
    log = folder / "jump.mcap"
    write_log(log, (ALL_OK,))
    look = Path.lstat

    def replaced(path: Path) -> os.stat_result:
        status = look(path)
        if path == log and S_ISREG(status.st_mode):
            log.unlink()
            log.symlink_to(elsewhere)
        return status

    monkeypatch.setattr(Path, "lstat", replaced)
    entry = read_entry(log)
    assert (entry.pulses, entry.state) == (0, LogState.DAMAGED)
    assert "links are not followed" in entry.trouble


def test_a_link_as_trash_is_refused_and_what_it_leads_to_stays(tmp_path: Path) -> None:
    folder, elsewhere = tmp_path / "recordings", tmp_path / "elsewhere"
    folder.mkdir()
    elsewhere.mkdir()
    write_log(elsewhere / "dear.mcap", (ALL_OK,))
    write_log(folder / "jump.mcap", (ALL_OK,))
    (folder / ".trash").symlink_to(elsewhere)
    catalogue = Catalogue(folder)
    with pytest.raises(StorageError, match="is a link, and links are not followed"):
        catalogue.purge()
    with pytest.raises(StorageError, match="is a link, and links are not followed"):
        catalogue.remove("dear")
    with pytest.raises(StorageError, match="is a link, and links are not followed"):
        catalogue.make_room(1e15)
    with pytest.raises(StorageError, match="is a link, and links are not followed"):
        catalogue.entries(deleted=True)
    with pytest.raises(StorageError, match="is a link, and links are not followed"):
        catalogue.delete("jump")
    with pytest.raises(UnknownRecordingError):
        catalogue.restore("dear")
    with pytest.raises(UnknownRecordingError):
        catalogue.change_session("dear", {"bib": "1"})
    assert catalogue.trash().recordings == 0
    assert [path.name for path in elsewhere.iterdir()] == ["dear.mcap"]
    assert not catalogue.entry("jump").deleted


def test_a_trash_that_becomes_a_link_while_it_is_emptied_loses_nothing_elsewhere(tmp_path: Path) -> None:
    catalogue = Catalogue(tmp_path)
    _delete(catalogue, "jump")
    (log,) = trashed_logs(tmp_path)
    (tmp_path / ".trash").rename(tmp_path / "elsewhere")
    (tmp_path / ".trash").symlink_to("elsewhere")
    with pytest.raises(OSError, match="links are not followed"):
        remove_for_good(log)
    assert (tmp_path / "elsewhere" / "jump.mcap").exists()
