"""The keeper of the trash, and what a full disk is said to need."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from recorder.catalogue.folder import Catalogue
from rig.errors import StorageError
from rig.events import Event
from rig.host.disk import ask_free_bytes
from rig.settings.file import load_rig
from rig.settings.model import RigSettings
from service.recordings.storage import bytes_per_s, check_room_for
from service.recordings.trash_keeper import TrashKeeper
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
