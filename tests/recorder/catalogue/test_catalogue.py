"""The catalogue over real folders with real logs."""

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from recorder.catalogue import log_index
from recorder.catalogue.entry import LogState, read_entry, unlisted_logs
from recorder.catalogue.folder import Catalogue
from recorder.log.triplet_buffers import TripletBuffers
from recorder.reading.info import info
from rig.errors import BadInputError, LogDamagedError, StorageError, UnknownRecordingError
from rig.frame import FrameStatus
from tests.recorder.logs import (
    ABSENT,
    ALL_OK,
    LOST,
    OK,
    PERIOD_NS,
    SESSION,
    SHAPE,
    START,
    make_tag,
    open_writer,
    write_log,
    write_pulse,
)
from tests.recorder.split import split_log
from tests.support.waiting import wait_until

JUMP = (ALL_OK, (OK, LOST, OK), (ABSENT,) * 3, ALL_OK)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    path = tmp_path / "recordings"
    path.mkdir()
    return path


def _count_looks(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """The paths that are really read from now on."""
    looks: list[Path] = []

    def counting(path: Path) -> object:
        looks.append(path)
        return read_entry(path)

    monkeypatch.setattr(log_index, "read_entry", counting)
    return looks


def test_an_entry_says_what_a_recording_is(folder: Path) -> None:
    write_log(folder / "2026-11-21T10-00-00Z.mcap", JUMP)
    (entry,) = Catalogue(folder).entries()
    assert entry == Catalogue(folder).entry("2026-11-21T10-00-00Z")
    assert (entry.id, entry.state, entry.deleted, entry.trouble) == (
        "2026-11-21T10-00-00Z", LogState.CLOSED, False, "",
    )  # fmt: skip
    assert entry.bytes == (folder / f"{entry.id}.mcap").stat().st_size
    assert entry.started == START + PERIOD_NS
    assert entry.duration_s == pytest.approx(3 * PERIOD_NS / 1e9)
    assert (entry.pulses, entry.complete, entry.partial, entry.missing) == (4, 2, 2, 0)
    assert entry.causes == {FrameStatus.LOST: 1, FrameStatus.ABSENT: 3}
    assert entry.failures == {"K1": {ABSENT: 1}, "K2": {LOST: 1, ABSENT: 1}, "K3": {ABSENT: 1}}
    assert (entry.cameras, entry.shape, entry.session) == (("K1", "K2", "K3"), SHAPE, SESSION)


def test_the_newest_comes_first_and_one_without_pulses_counts_from_its_file(folder: Path) -> None:
    for name in ("a", "b"):
        write_log(folder / f"{name}.mcap", (ALL_OK,))
    write_log(folder / "empty.mcap", ())
    assert [entry.id for entry in Catalogue(folder).entries()][1:] == ["b", "a"]
    assert Catalogue(folder).entry("empty").started is None
    os.utime(folder / "empty.mcap", ns=(0, 0))
    assert [entry.id for entry in Catalogue(folder).entries()] == ["b", "a", "empty"]


def test_a_missing_folder_holds_nothing(tmp_path: Path) -> None:
    assert Catalogue(tmp_path / "none").entries() == []
    assert Catalogue(tmp_path / "none").entries(deleted=True) == []
    assert Catalogue(tmp_path / "none").purge().recordings == 0


@pytest.mark.parametrize(
    "name",
    ["", ".", "..", "../secret", "..%2fsecret", "a/b", "/etc/passwd", ".hidden", "-rf", "a\0", "a\n", "å", "a:b",
     "x" * 101, "å" * 111, "a\\b", 'a"b', "a\u202eb", "a\u200bb", "a\x85", "sted-\udce5",
     ".trash/jump", "secret.mcap/../secret"],
)  # fmt: skip
def test_an_id_never_leaves_the_folder(folder: Path, name: str) -> None:
    for place in (folder.parent / "secret.mcap", folder / ".hidden.mcap", folder / "a:b.mcap"):
        write_log(place, (ALL_OK,))
    catalogue = Catalogue(folder)
    for ask in (catalogue.entry, catalogue.tags, catalogue.delete, catalogue.restore):
        with pytest.raises(UnknownRecordingError, match="no recording"):
            ask(name)
    with pytest.raises(UnknownRecordingError):
        catalogue.image(name, 1)
    with pytest.raises(UnknownRecordingError):
        catalogue.change_session(name, {"athlete": "x"})
    assert catalogue.entries() == []
    assert not list(folder.parent.glob("*.json"))


def test_files_of_other_names_are_passed_over(folder: Path) -> None:
    write_log(folder / "jump.mcap", (ALL_OK,))
    (folder / "notes.txt").write_text("wind from the left")
    write_log(folder / "jump.mcap.part", (ALL_OK,))
    (folder / "folder").mkdir()
    catalogue = Catalogue(folder)
    assert [entry.id for entry in catalogue.entries()] == ["jump"]
    for name in ("notes", "jump.mcap", "folder"):
        with pytest.raises(UnknownRecordingError):
            catalogue.entry(name)


def test_broken_logs_are_listed_as_what_they_are(folder: Path) -> None:
    write_log(folder / "whole.mcap", (ALL_OK,) * 6)
    data = (folder / "whole.mcap").read_bytes()
    chunk = data.index(b'"pulse":3')
    (folder / "empty.mcap").touch()
    (folder / "beheaded.mcap").write_bytes(data[:20])
    (folder / "cut.mcap").write_bytes(data[: len(data) // 2 + 100])
    (folder / "holed.mcap").write_bytes(data[: chunk - 3000] + bytes(6000) + data[chunk + 3000 :])
    found = {entry.id: entry for entry in Catalogue(folder).entries()}
    assert {name: entry.state.value for name, entry in found.items()} == {
        "whole": "closed", "empty": "damaged", "beheaded": "damaged", "cut": "unfinished", "holed": "damaged",
    }  # fmt: skip
    assert "is empty" in found["empty"].trouble
    assert "cut off" in found["beheaded"].trouble
    assert 0 < found["cut"].pulses < 6
    assert found["holed"].missing > 0


def test_a_log_that_is_being_written_grows_and_then_is_closed(folder: Path) -> None:
    buffers = TripletBuffers(SHAPE, 4)
    catalogue = Catalogue(folder)
    with open_writer(folder / "now.mcap", buffers) as log:
        write_pulse(log, buffers, make_tag(1))
        wait_until(lambda: catalogue.entry("now").pulses == 1, "the first pulse is seen")
        assert catalogue.entry("now").state is LogState.WRITING
        assert catalogue.image("now", 1).shape == SHAPE
        write_pulse(log, buffers, make_tag(2))
        wait_until(lambda: catalogue.entry("now").pulses == 2, "the second pulse is seen")
        second = catalogue.image("now", 2)
    buffers.close()
    assert catalogue.entry("now").state is LogState.CLOSED
    assert [tag.pulse for tag in catalogue.tags("now")] == [1, 2]
    assert np.array_equal(second, catalogue.image("now", 2))


def test_tags_and_images_are_those_that_were_written(folder: Path) -> None:
    written = write_log(folder / "jump.mcap", JUMP)
    catalogue = Catalogue(folder)
    assert catalogue.tags("jump") == tuple(pulse.tag for pulse in written)
    for pulse in written:
        if pulse.image is None:
            with pytest.raises(UnknownRecordingError, match="no image of pulse 3"):
                catalogue.image("jump", pulse.tag.pulse)
        else:
            assert np.array_equal(catalogue.image("jump", pulse.tag.pulse), pulse.image)
    with pytest.raises(UnknownRecordingError, match="no image of pulse 99"):
        catalogue.image("jump", 99)


def test_images_of_many_recordings_and_of_a_replaced_one(folder: Path) -> None:
    for number in range(6):
        write_log(folder / f"jump{number}.mcap", (ALL_OK,) * (number + 1))
    catalogue = Catalogue(folder)
    for _ in range(2):
        for number in range(6):
            assert catalogue.image(f"jump{number}", number + 1).shape == SHAPE
    write_log(folder / "other.mcap", (ALL_OK, (OK, LOST, OK)))
    (folder / "other.mcap").replace(folder / "jump5.mcap")
    assert not catalogue.image("jump5", 2)[:, 30:60].any()
    with pytest.raises(UnknownRecordingError):
        catalogue.image("jump5", 6)


def test_a_damaged_image_says_so(folder: Path) -> None:
    write_log(folder / "jump.mcap", (ALL_OK,) * 2)
    catalogue = Catalogue(folder)
    catalogue.image("jump", 1)
    data = (folder / "jump.mcap").read_bytes()
    with (folder / "jump.mcap").open("r+b") as file:
        file.seek(data.index(b"mono8"))
        file.write(b"rgb88")
    with pytest.raises(LogDamagedError, match="image of pulse 1 is damaged"):
        catalogue.image("jump", 1)


def test_what_has_not_changed_is_not_read_again(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("a", "b"):
        write_log(folder / f"{name}.mcap", (ALL_OK,))
    (folder / "video.mcap").write_bytes(b"RIFF....AVI ")
    looks = _count_looks(monkeypatch)
    catalogue = Catalogue(folder)
    for _ in range(3):
        catalogue.entries()
        catalogue.entry("a")
    catalogue.change_session("a", {"bib": "3"})
    assert sorted(path.stem for path in looks) == ["a", "b", "video"]
    (folder / "a.mcap").unlink()
    write_log(folder / "a.mcap", (ALL_OK, ALL_OK))
    assert catalogue.entry("a").pulses == 2
    assert [path.stem for path in looks[3:]] == ["a"]


def test_session_fields_change_beside_the_log(folder: Path) -> None:
    write_log(folder / "jump.mcap", (ALL_OK,))
    before = (folder / "jump.mcap").read_bytes()
    catalogue = Catalogue(folder)
    catalogue.change_session("jump", {"athlete": "Åse Ødegård", "notes": "two\nlines"})
    changed = catalogue.change_session("jump", {"wind": "0.8 m/s", "notes": ""})
    expected = {"athlete": "Åse Ødegård", "bib": "17", "notes": "", "wind": "0.8 m/s"}
    assert changed.session == expected
    assert Catalogue(folder).entry("jump").session == expected
    assert info(folder / "jump.mcap").session == expected
    assert (folder / "jump.mcap").read_bytes() == before
    assert sorted(path.name for path in folder.glob("[!.]*")) == ["jump.mcap", "jump.session.json"]


@pytest.mark.parametrize("text", ["{", "[]", '{"athlete": 3}', "null"])
def test_broken_changes_are_reported_and_never_written_over(folder: Path, text: str) -> None:
    write_log(folder / "jump.mcap", (ALL_OK,))
    (folder / "jump.session.json").write_text(text)
    catalogue = Catalogue(folder)
    entry = catalogue.entry("jump")
    assert entry.session == SESSION
    assert "jump.session.json: holds no session fields" in entry.trouble
    with pytest.raises(BadInputError, match="holds no session fields"):
        info(folder / "jump.mcap")
    with pytest.raises(BadInputError, match="holds no session fields"):
        catalogue.change_session("jump", {"athlete": "x"})
    assert (folder / "jump.session.json").read_text() == text


def test_deleted_recordings_wait_in_the_trash(folder: Path) -> None:
    write_log(folder / "jump.mcap", JUMP)
    catalogue = Catalogue(folder)
    catalogue.change_session("jump", {"bib": "3"})
    deleted = catalogue.delete("jump")
    assert (deleted.deleted, deleted.id, deleted.session["bib"]) == (True, "jump", "3")
    assert catalogue.delete("jump") == deleted
    assert catalogue.entries() == []
    assert catalogue.entries(deleted=True) == [deleted] == [catalogue.entry("jump")]
    assert catalogue.image("jump", 1).shape == SHAPE
    assert not list(folder.glob("jump*"))
    restored = catalogue.restore("jump")
    assert (restored.deleted, restored.session["bib"], restored.pulses) == (False, "3", 4)
    assert catalogue.restore("jump") == restored
    assert catalogue.entries(deleted=True) == []


def test_nothing_is_overwritten_when_names_collide(folder: Path) -> None:
    catalogue = Catalogue(folder)
    for pulses in (1, 2, 3):
        write_log(folder / "jump.mcap", (ALL_OK,) * pulses)
        catalogue.change_session("jump", {"bib": str(pulses)})
        (folder / "jump.truth.json").write_text(str(pulses))
        catalogue.delete("jump")
    write_log(folder / "jump.mcap", (ALL_OK,) * 4)
    found = {entry.id: (entry.pulses, entry.session["bib"]) for entry in catalogue.entries(deleted=True)}
    assert found == {"jump": (1, "1"), "jump-2": (2, "2"), "jump-3": (3, "3")}
    assert catalogue.restore("jump").id == "jump-4"
    found = {entry.id: (entry.pulses, entry.session["bib"]) for entry in catalogue.entries()}
    assert found == {"jump": (4, "17"), "jump-4": (1, "1")}
    assert {path.name: path.read_text() for path in folder.glob("*.truth.json")} == {"jump-4.truth.json": "1"}


def test_the_trash_is_emptied_of_what_is_old(folder: Path) -> None:
    catalogue = Catalogue(folder)
    write_log(folder / "jump.mcap", (ALL_OK,))
    os.utime(folder / "jump.mcap", ns=(0, 0))  # recorded long ago, deleted now
    catalogue.change_session("jump", {"bib": "3"})
    for kind in ("truth", "survey"):
        (folder / f"jump.{kind}.json").write_text("{}")
    catalogue.delete("jump")
    assert catalogue.purge(older_than_s=3600).recordings == 0
    assert catalogue.entry("jump").deleted
    assert catalogue.purge().recordings == 1
    assert list((folder / ".trash").iterdir()) == []


def test_a_disk_that_refuses_is_an_error_in_words(folder: Path) -> None:
    write_log(folder / "jump.mcap", (ALL_OK,))
    (folder / ".trash").write_text("in the way")
    with pytest.raises(StorageError, match=r"cannot be changed .*check the folder's permissions"):
        Catalogue(folder).delete("jump")
    assert not Catalogue(folder).entry("jump").deleted


def test_a_recording_that_goes_away_meanwhile_is_unknown(folder: Path) -> None:
    write_log(folder / "jump.mcap", (ALL_OK,))
    catalogue = Catalogue(folder)
    shutil.rmtree(folder)
    assert catalogue.entries() == []
    with pytest.raises(UnknownRecordingError):
        catalogue.entry("jump")


def test_the_changes_are_plain_json(folder: Path) -> None:
    write_log(folder / "jump.mcap", (ALL_OK,))
    Catalogue(folder).change_session("jump", {"bib": "3"})
    assert json.loads((folder / "jump.session.json").read_text()) == {"bib": "3"}


@pytest.mark.parametrize("name", ["jump (1)", "Åre, 2. omgang", "a+b%2f", "飛躍", "å" * 100, "😀" * 50, "a'&;=#~"])
def test_whatever_an_address_can_hold_is_listed_and_goes_to_the_trash_and_back(tmp_path: Path, name: str) -> None:
    for each in ("jump", name, "a:b", "sted-\udce5", ".hidden"):
        write_log(tmp_path / f"{each}.mcap", (ALL_OK,))
    assert unlisted_logs(tmp_path) == ["a:b.mcap", "sted-\udce5.mcap"]
    catalogue = Catalogue(tmp_path)
    assert {entry.id for entry in catalogue.entries()} == {"jump", name}
    catalogue.change_session(name, {"bib": "17"})
    assert catalogue.delete(name).deleted
    write_log(tmp_path / f"{name}.mcap", (ALL_OK,))
    second = catalogue.delete(name).id
    assert second != name
    assert {entry.id for entry in Catalogue(tmp_path).entries(deleted=True)} == {name, second}
    assert catalogue.restore(name).session["bib"] == "17"


def test_a_split_recording_is_one_entry(folder: Path) -> None:
    write_log(folder / "whole.mcap", ((OK, LOST, OK), *(ALL_OK,) * 9))
    parts = split_log(folder / "whole.mcap", folder / "r1.mcap", (4, 3))
    catalogue = Catalogue(folder)
    entries = {entry.id: entry for entry in catalogue.entries()}
    assert set(entries) == {"whole", "r1"}
    whole, split = entries["whole"], entries["r1"]
    assert split.parts == ("r1", "r1-part2", "r1-part3")
    assert split.bytes == sum(part.stat().st_size for part in parts)
    told = ("state", "started", "duration_s", "pulses", "complete", "missing", "causes", "failures", "pauses")
    assert [getattr(split, name) for name in told] == [getattr(whole, name) for name in told]
    assert catalogue.entry("r1") == split
    assert [tag.pulse for tag in catalogue.tags("r1")] == list(range(1, 11))
    assert np.array_equal(catalogue.image("r1", 9), catalogue.image("whole", 9))
    parts[0].rename(folder.parent / "r1.mcap")
    assert {entry.id: entry.parts for entry in catalogue.entries()} == {
        "whole": ("whole",), "r1-part2": ("r1-part2", "r1-part3"),
    }  # fmt: skip
