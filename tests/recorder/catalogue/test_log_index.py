"""What was read is kept for the next service, and never believed in vain."""

import os
import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from recorder.catalogue import log_index
from recorder.catalogue.database import FILES, NAME
from recorder.catalogue.entry import Entry, LogState, read_entry
from recorder.catalogue.folder import Catalogue
from recorder.log.triplet_buffers import TripletBuffers
from rig.api.recordings import RecordingQuery
from tests.recorder.catalogue.unprivileged import unprivileged
from tests.recorder.logs import ABSENT, ALL_OK, LOST, OK, SHAPE, make_tag, open_writer, write_log, write_pulse

JUMP = (ALL_OK, (OK, LOST, OK), (ABSENT,) * 3, ALL_OK)


@pytest.fixture
def looks(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The ids of the logs that are really read."""
    found: list[str] = []

    def counting(path: Path) -> Entry:
        found.append(path.stem)
        return read_entry(path)

    monkeypatch.setattr(log_index, "read_entry", counting)
    return found


def test_a_new_catalogue_reads_only_what_is_new(tmp_path: Path, looks: list[str]) -> None:
    for name in ("a", "b", "c"):
        write_log(tmp_path / f"{name}.mcap", JUMP)
    first = Catalogue(tmp_path)
    first.delete("c")
    looks.clear()
    shown, trash = first.entries(), first.entries(deleted=True)
    assert sorted(looks) == ["a", "b"]
    looks.clear()
    assert (Catalogue(tmp_path).entries(), Catalogue(tmp_path).entries(deleted=True)) == (shown, trash)
    assert looks == []
    write_log(tmp_path / "d.mcap", (ALL_OK,))
    assert [entry.id for entry in Catalogue(tmp_path).entries()] == ["d", "b", "a"]
    assert looks == ["d"]


def test_a_program_that_ends_does_not_read_on_and_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("a", "b", "c"):
        write_log(tmp_path / f"{name}.mcap", JUMP)
    ending, read = Catalogue(tmp_path), []

    def end(path: Path) -> Entry:
        read.append(path.stem)
        ending.end_reading()
        return read_entry(path)

    monkeypatch.setattr(log_index, "read_entry", end)
    first = ending.entries()
    assert [entry.id for entry in first] == read
    assert len(read) == 1
    ending.close()
    assert [entry.id for entry in Catalogue(tmp_path).entries()] == ["c", "b", "a"]
    assert sorted(read) == ["a", "b", "c"]


def test_changed_session_fields_are_those_beside_the_log(tmp_path: Path) -> None:
    write_log(tmp_path / "a.mcap", JUMP)
    Catalogue(tmp_path).entries()
    (tmp_path / "a.session.json").write_text('{"bib": "99"}')
    assert Catalogue(tmp_path).entries()[0].session["bib"] == "99"


def test_a_log_that_was_changed_or_replaced_is_read_again(tmp_path: Path, looks: list[str]) -> None:
    for name in ("changed", "replaced", "same"):
        write_log(tmp_path / f"{name}.mcap", JUMP)
    Catalogue(tmp_path).entries()
    changed = tmp_path / "changed.mcap"
    stat, data = changed.stat(), bytearray(changed.read_bytes())
    place = data.index(b'"pulse":2')
    data[place - 500 : place + 500] = bytes(1000)
    changed.write_bytes(data)
    os.utime(changed, ns=(stat.st_atime_ns, stat.st_mtime_ns))  # same name, inode, size and time
    shutil.copy2(tmp_path / "replaced.mcap", tmp_path / "copy")
    (tmp_path / "copy").replace(tmp_path / "replaced.mcap")
    looks.clear()
    states = {entry.id: entry.state for entry in Catalogue(tmp_path).entries()}
    assert states == {"changed": LogState.DAMAGED, "replaced": LogState.CLOSED, "same": LogState.CLOSED}
    assert sorted(looks) == ["changed", "replaced"]


def test_files_that_are_gone_are_not_kept(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_log(tmp_path / f"{name}.mcap", JUMP)
    Catalogue(tmp_path).entries()
    (tmp_path / "a.mcap").unlink()
    write_log(tmp_path / "c.mcap", JUMP)
    Catalogue(tmp_path).entries()
    with closing(sqlite3.connect(tmp_path / NAME)) as kept:
        assert kept.execute("SELECT path FROM logs ORDER BY path").fetchall() == [("b.mcap",), ("c.mcap",)]
        assert kept.execute("SELECT id FROM recordings ORDER BY id").fetchall() == [("b",), ("c",)]


def test_a_log_that_grew_after_it_was_kept_is_read_again(tmp_path: Path) -> None:
    write_log(tmp_path / "old.mcap", JUMP)
    buffers = TripletBuffers(SHAPE, 4)
    with open_writer(tmp_path / "now.mcap", buffers) as log:
        write_pulse(log, buffers, make_tag(1))
        assert Catalogue(tmp_path).entry("now").state is LogState.WRITING
        Catalogue(tmp_path).entries()
        write_pulse(log, buffers, make_tag(2))
    buffers.close()
    (found,) = (entry for entry in Catalogue(tmp_path).entries() if entry.id == "now")
    assert (found.state, found.pulses) == (LogState.CLOSED, 2)


def test_no_flipped_byte_makes_a_wrong_entry(tmp_path: Path) -> None:
    """Every 307th byte, so that all parts of rows, indices and heads are among them."""
    for name in ("a", "b"):
        write_log(tmp_path / f"{name}.mcap", JUMP)
    index, right = tmp_path / NAME, _listed(tmp_path)
    kept = index.read_bytes()
    for place in range(0, len(kept), 307):
        index.write_bytes(kept[:place] + bytes([kept[place] ^ 1 << place % 8]) + kept[place + 1 :])
        assert _listed(tmp_path) == right, place
        assert _listed(tmp_path) == right, place


def _listed(folder: Path) -> list[Entry]:
    """What a new catalogue lists, and what it finds by a word of the session, which must be the same."""
    with closing(Catalogue(folder)) as catalogue:
        found = list(catalogue.find(RecordingQuery(search="anna berg")).entries)
        assert catalogue.entries() == found
        return found


def _writable_by_all(index: Path) -> None:
    index.chmod(0o666)


def _of_another_user(index: Path) -> None:
    if os.geteuid() != 0:
        pytest.skip("only root can give a file away")
    os.chown(index, 65534, 65534)


def _link(index: Path) -> None:
    index.rename(index.with_name("elsewhere"))
    index.symlink_to("elsewhere")


def _pipe(index: Path) -> None:
    index.unlink()
    os.mkfifo(index)


def _cut(index: Path) -> None:
    index.write_bytes(index.read_bytes()[:-4096])


def _of_another_version(index: Path) -> None:
    with closing(sqlite3.connect(index)) as connection:
        connection.execute("PRAGMA user_version = 9")


def _huge(index: Path) -> None:
    os.truncate(index, 1 << 40)


@pytest.mark.parametrize("spoil", [_writable_by_all, _of_another_user, _link, _pipe, _cut, _of_another_version, _huge])
def test_a_file_not_to_be_believed_is_thrown_away(
    tmp_path: Path, looks: list[str], spoil: Callable[[Path], None]
) -> None:
    write_log(tmp_path / "a.mcap", JUMP)
    right = Catalogue(tmp_path).entries()
    looks.clear()
    spoil(tmp_path / NAME)
    assert Catalogue(tmp_path).entries() == right
    assert looks == ["a"]
    assert Catalogue(tmp_path).entries() == right
    assert looks == ["a"], "it was replaced by a good one"


def test_what_stands_in_the_way_is_left_alone(tmp_path: Path, looks: list[str]) -> None:
    write_log(tmp_path / "a.mcap", JUMP)
    (tmp_path / NAME).mkdir()
    (tmp_path / "precious").write_text("precious")
    (tmp_path / FILES[1]).symlink_to("precious")
    for _ in range(2):
        assert [entry.pulses for entry in Catalogue(tmp_path).entries()] == [4]
    assert looks == ["a", "a"]
    assert (tmp_path / "precious").read_text() == "precious"


def test_a_folder_that_cannot_be_written_is_read_all_the_same(open_folder: Path, looks: list[str]) -> None:
    write_log(open_folder / "a.mcap", JUMP)
    with unprivileged():
        for _ in range(2):
            assert [entry.pulses for entry in Catalogue(open_folder).entries()] == [4]
    assert looks == ["a", "a"]
    assert not (open_folder / NAME).exists()
