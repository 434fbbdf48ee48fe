"""Recordings are released only by a rule, and only when their copy is what was recorded."""

import os
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from recorder.catalogue.folder import Catalogue
from rig.background.messages import End
from rig.events import Event
from rig.settings.model import OffloadSettings
from service.offloading.copying import _copy
from service.offloading.notes import CopyNotes, mark_of
from service.offloading.orders import Copy
from service.offloading.releasing import Releasing, Removal
from tests.recorder.logs import ALL_OK, write_log
from tests.recorder.split import split_log
from tests.support.other_disk import other_disk
from tests.support.rigs import SIM

DAY_S = 86400
#: The inode of a file changes when the test makes it, so the time at which recordings are released is later.
LATER_S = 50 * DAY_S


class Bench:
    """A folder with two recordings, of 40 and of 20 days ago, both copied."""

    def __init__(self, folder: Path, to: Path) -> None:
        self.folder, self.to = folder / "here", to / "there"
        self.to.mkdir()
        self.folder.mkdir()
        self.said: list[str] = []
        self.clock_is_right = True
        self.catalogue = Catalogue(self.folder)
        self.notes = CopyNotes(self.folder, lambda _: None)
        for name, days in (("old", 40), ("new", 20)):
            log = self.log(name)
            write_log(log)
            self.copied(log, days)

    def copied(self, log: Path, days: float) -> None:
        """Let a log be so many days old, and copied."""
        then = time.time() + LATER_S - days * DAY_S
        os.utime(log, (then, then))
        mark = mark_of(log)
        assert _copy(Copy(paths=(log,), to=self.to), lambda *_, **__: None) == End()  # type: ignore[arg-type]
        self.notes.note(log, mark, None)

    def log(self, name: str) -> Path:
        return self.folder / f"{name}.mcap"

    def release(self, *, later_s: float = LATER_S, **rules: Any) -> list[str]:
        """Release what the rules let go so much later; returns what is left."""
        rig = SIM.model_copy(update={"offload": OffloadSettings(to=self.to, **rules)})
        removal = Removal(self.catalogue.delete, lambda: self.catalogue.trash().bytes, lambda: self.clock_is_right)
        now = time.time() + later_s
        releasing = Releasing(self.folder, lambda: rig, self.notes, removal, self._hear, lambda: now)
        while (log := releasing.next()) is not None:
            releasing.release(log, busy=lambda: False, wanted=lambda: True)
        return sorted(path.stem for path in self.folder.glob("*.mcap"))

    def _hear(self, event: Event) -> None:
        self.said.append(event.message)


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with other_disk() as other:
        made = Bench(tmp_path, other)
        with closing(made.catalogue):
            yield made


def test_a_copy_on_the_same_disk_releases_nothing(tmp_path: Path) -> None:
    assert Bench(tmp_path, tmp_path).release(keep_days=30) == ["new", "old"]


def test_without_a_rule_everything_stays(bench: Bench) -> None:
    assert bench.release() == ["new", "old"]
    assert not bench.said


def test_what_is_older_than_the_rule_goes_into_the_trash(bench: Bench) -> None:
    bench.clock_is_right = False
    assert bench.release(keep_days=30) == ["new", "old"]
    bench.clock_is_right = True
    assert bench.release(keep_days=30) == ["new"]
    assert bench.said == [f"old is released: it lies in {bench.to}, and here in the trash"]
    assert [entry.id for entry in bench.catalogue.entries(deleted=True)] == ["old"]
    assert (bench.to / "old.mcap").exists()


def test_room_is_kept_free_by_releasing_the_oldest(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    size = bench.log("old").stat().st_size
    monkeypatch.setattr("service.offloading.releasing.free_bytes", lambda _: 1_000_000_000)
    assert bench.release(keep_free_GB=1.0) == ["new", "old"]
    assert bench.release(keep_free_GB=1.0 + size / 2e9) == ["new"]  # what lies in the trash counts as free
    assert bench.release(keep_free_GB=100.0) == []


def _from_the_trash(bench: Bench, log: Path) -> None:
    bench.catalogue.restore(log.stem)


def _from_its_copy(bench: Bench, log: Path) -> None:
    shutil.copy2(bench.to / log.name, log)


@pytest.mark.parametrize("fetch", [_from_the_trash, _from_its_copy])
def test_what_a_person_has_fetched_stays_for_a_day_and_then_counts_as_new(
    bench: Bench, fetch: Callable[[Bench, Path], None]
) -> None:
    log = bench.log("fetched")
    write_log(log)
    bench.copied(log, 90)  # long before its inode changed
    bench.catalogue.delete(log.stem)
    fetch(bench, log)
    assert bench.release(later_s=0.9 * DAY_S, keep_days=0.5, keep_free_GB=1e9) == ["fetched"]
    assert bench.release(later_s=2 * DAY_S, keep_days=5) == ["fetched"], "it is new"
    assert bench.release(later_s=6 * DAY_S, keep_days=5) == []


def test_a_split_recording_is_released_whole(bench: Bench, tmp_path: Path) -> None:
    write_log(tmp_path / "whole.mcap", (ALL_OK,) * 9)
    parts = split_log(tmp_path / "whole.mcap", bench.log("long"), (4, 3))
    for part, days in zip(parts, (40, 35, 20), strict=True):
        bench.copied(part, days)
    assert bench.release(keep_days=30) == ["long", "long-part2", "long-part3", "new"], "its end is not old enough"
    bench.copied(parts[2], 31)
    bench.notes.note(parts[1], "another", None)
    assert bench.release(keep_days=30) == ["long", "long-part2", "long-part3", "new"], "its middle is not safe"
    bench.copied(parts[1], 35)
    assert bench.release(keep_days=30) == ["new"]
    assert bench.said[-1].startswith("long is released")
    (entry,) = [entry for entry in bench.catalogue.entries(deleted=True) if entry.id == "long"]
    assert entry.parts == ("long", "long-part2", "long-part3")


def _another_copy(bench: Bench) -> None:
    copy = bench.to / "old.mcap"
    data = bytearray(copy.read_bytes())
    data[-100] ^= 1
    copy.write_bytes(data)


@pytest.mark.parametrize(
    ("harm", "said"),
    [
        (_another_copy, "old is not released: "),
        (lambda bench: (bench.to / "old.mcap").unlink(), ""),
        (lambda bench: (bench.to / "old.mcap.sha256").unlink(), ""),
        (lambda bench: bench.to.rename(bench.to.with_name("gone")), ""),
        (lambda bench: (bench.folder / "old.session.json").write_text('{"athlete": "Kari"}'), ""),
    ],
    ids=["another copy", "no copy", "no checksum", "no disk", "changed since"],
)
def test_what_is_not_safe_stays(bench: Bench, harm: Callable[[Bench], object], said: str) -> None:
    harm(bench)
    assert bench.release(keep_days=30) == ["new", "old"]
    assert [text[: len(said)] for text in bench.said] == ([said] if said else [])
    if said:
        assert not bench.notes.is_copied(bench.log("old"))
        assert not (bench.to / "old.mcap.sha256").exists()
