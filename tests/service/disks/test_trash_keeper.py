"""The keeper of the trash, and what a full disk is said to need."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from recorder.catalogue.folder import Catalogue
from rig.errors import StorageError
from rig.events import Event
from rig.host.disk import ask_free_bytes
from rig.settings.file import load_rig
from rig.settings.model import RigSettings
from service.recordings.storage import bytes_per_s, check_room_for
from service.recordings.trash_keeper import SteadyClock, TrashKeeper
from tests.recorder.logs import ALL_OK, write_log

SIM = load_rig(Path("config/rigs/sim.toml"))


@contextmanager
def _without_room(folder: Path, spare_s: float = 0.0) -> Iterator[RigSettings]:
    """A rig whose reserve takes all the disk, but for so many seconds of recording."""
    reserve_gb = (ask_free_bytes(folder) - spare_s * bytes_per_s(SIM)) / 1e9
    yield SIM.model_copy(update={"recorder": SIM.recorder.model_copy(update={"reserve_gb": reserve_gb})})


def _deleted(folder: Path, *names: str) -> Catalogue:
    catalogue = Catalogue(folder)
    for name in names:
        write_log(folder / f"{name}.mcap", (ALL_OK,) * 4)
        catalogue.delete(name)
    return catalogue


def test_room_is_made_only_when_it_runs_short(tmp_path: Path) -> None:
    events: list[Event] = []
    catalogue = _deleted(tmp_path, "a", "b")
    plenty = SIM.model_copy(update={"recorder": SIM.recorder.model_copy(update={"reserve_gb": 0.0, "jump_s": 0.01})})
    keeper = TrashKeeper(lambda: plenty, catalogue, events.append)
    keeper.make_room(0.01)
    assert catalogue.trash().recordings == 2
    with _without_room(tmp_path, spare_s=100) as rig:
        TrashKeeper(lambda: rig, catalogue, events.append).look()
        assert catalogue.trash().recordings == 2, "they were deleted just now, and there is room for a while"
    with _without_room(tmp_path) as rig:
        TrashKeeper(lambda: rig, catalogue, events.append).look()
    assert catalogue.trash().recordings == 0
    assert [event.message.partition(";")[2] for event in events] == [" room was needed"]
    assert "2 recordings" in events[0].message


def test_a_full_disk_is_said_to_need_what_really_helps(tmp_path: Path) -> None:
    with _without_room(tmp_path) as rig, pytest.raises(StorageError, match="delete recordings and then empty the tr"):
        check_room_for(rig, tmp_path, 10)
    catalogue = _deleted(tmp_path, "a")
    with _without_room(tmp_path) as rig, pytest.raises(StorageError, match=r"frees 0\.0 GB, then delete recordings"):
        check_room_for(rig, tmp_path, 1000)
    large = tmp_path / ".trash" / "a.mcap"
    with large.open("ab") as file:
        file.write(bytes(60_000_000))
    with _without_room(tmp_path) as rig, pytest.raises(StorageError, match=r"empty the trash, which frees 0\.1 GB$"):
        check_room_for(rig, tmp_path, 0.5)
    assert catalogue.purge().bytes >= 60_000_000


@dataclass
class _Times:
    """The clocks of a computer: the one that people set, and the one that only goes on."""

    utc_s: float = 0.0
    running_s: float = 0.0

    def go_on(self, seconds: float) -> None:
        self.utc_s += seconds
        self.running_s += seconds


def test_a_clock_is_trusted_when_it_is_kept_right_and_was_not_set_for_an_hour() -> None:
    times, kept = _Times(), [True]
    clock = SteadyClock(lambda: times.utc_s, lambda: times.running_s, lambda: kept[0])
    assert not clock.trusted(), "nobody has watched it yet"
    times.go_on(3601)
    assert clock.trusted()
    kept[0] = False
    assert not clock.trusted()
    kept[0] = True
    for step in (32 * 86400, -32 * 86400):
        times.utc_s += step
        assert not clock.trusted()
        times.go_on(3599)
        assert not clock.trusted()
        times.go_on(2)
        assert clock.trusted()


def test_what_is_old_goes_one_an_hour_and_never_by_a_clock_that_was_just_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    catalogue = _deleted(tmp_path, "a", "b")
    times = _Times(time.time(), 0.0)
    monkeypatch.setattr("recorder.catalogue.folder.time.time", lambda: times.utc_s)
    plenty = SIM.model_copy(update={"recorder": SIM.recorder.model_copy(update={"reserve_gb": 0.0, "jump_s": 0.01})})
    clock = SteadyClock(lambda: times.utc_s, lambda: times.running_s, lambda: True)
    events: list[Event] = []
    keeper = TrashKeeper(lambda: plenty, catalogue, events.append, clock, lambda: times.running_s)

    def left() -> int:
        keeper.look()
        return catalogue.trash().recordings

    times.go_on(4000)
    assert left() == 2, "they are an hour old"
    times.utc_s += 32 * 86400
    assert left() == 2
    times.utc_s -= 32 * 86400
    times.go_on(5000)
    assert left() == 2
    times.go_on(31 * 86400)
    assert [left(), left()] == [1, 1]
    times.go_on(3601)
    assert left() == 0
    assert all("it was older than 30 days" in event.message for event in events)


def test_a_clock_that_nobody_keeps_right_ages_nothing_but_room_is_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on a hill without a network: what was deleted stays until its room is needed."""
    catalogue = _deleted(tmp_path, "a", "b")
    times = _Times(time.time(), 0.0)
    monkeypatch.setattr("recorder.catalogue.folder.time.time", lambda: times.utc_s)
    plenty = SIM.model_copy(update={"recorder": SIM.recorder.model_copy(update={"reserve_gb": 0.0, "jump_s": 0.01})})
    clock = SteadyClock(lambda: times.utc_s, lambda: times.running_s, lambda: False)
    rigs, events = [plenty], list[Event]()
    keeper = TrashKeeper(lambda: rigs[-1], catalogue, events.append, clock, lambda: times.running_s)
    for _ in range(3):
        times.go_on(400 * 86400)
        keeper.look()
    assert catalogue.trash().recordings == 2
    with _without_room(tmp_path) as rig:
        rigs.append(rig)
        keeper.look()
    assert catalogue.trash().recordings == 0
    assert ["room was needed" in event.message for event in events] == [True]
