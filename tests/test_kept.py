"""What many tests share is made once, by one of the processes that want it, and made anew when its inputs change."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support import kept

_ONE_WORKER = """
import sys, time
from pathlib import Path
from tests.support import kept

def make(folder):
    with (Path(sys.argv[1]) / "made.txt").open("a") as made:
        made.write("once\\n")
    (folder / "first").write_text("1")
    time.sleep(0.2)  # the other ones come meanwhile
    (folder / "second").write_text("2")

kept._KEPT = Path(sys.argv[1]) / "kept"
folder = kept.kept("dear", make)
assert (folder / "first").read_text() + (folder / "second").read_text() == "12"
"""


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where it is kept."""
    monkeypatch.setattr(kept, "_KEPT", tmp_path / "kept")
    return tmp_path / "kept"


def test_of_several_workers_one_makes_it_and_all_have_it_whole(tmp_path: Path) -> None:
    workers = [subprocess.Popen([sys.executable, "-c", _ONE_WORKER, str(tmp_path)]) for _ in range(3)]
    assert [worker.wait(60) for worker in workers] == [0, 0, 0]
    assert (tmp_path / "made.txt").read_text() == "once\n"


def test_other_inputs_and_other_sources_make_it_anew(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[int] = []

    def make() -> int:
        made.append(len(made))
        return len(made)

    assert [kept.kept_object("number", make, given) for given in (1, 1, 2)] == [1, 1, 2]
    monkeypatch.setattr(kept, "_sources", lambda: "another checkout")
    assert kept.kept_object("number", make, 1) == 3
    assert len([path for path in place.iterdir() if path.is_dir()]) == 3


def test_what_it_depends_on_are_sources_and_settings_and_nothing_that_programs_write(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kept, "_ROOT", tmp_path)
    known: set[str] = set()
    for name, new in {
        "service/recordings/code.py": True, "config/rig.toml": True, "recordings/jump.mcap": False,
        ".cache/tests/jump.mcap": False, "docs/page.md": False, "bench/results/1.json": False, "bench/results.py": True,
    }.items():  # fmt: skip
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("1")
        digest = kept._sources.__wrapped__()
        assert (digest not in known) is (new or not known), name
        known.add(digest)


def test_what_nobody_has_used_for_long_is_removed(place: Path) -> None:
    folders = [kept.kept(name, lambda folder: (folder / "log").touch()) for name in ("old", "young")]
    os.utime(folders[0], (0, 0))
    os.utime(place / f"{folders[0].name}.lock", (0, 0))
    kept.kept("third", lambda folder: (folder / "log").touch())
    assert {path.name.split("-")[0] for path in place.iterdir()} == {"young", "third"}


def test_what_was_begun_and_not_finished_is_made_anew(place: Path) -> None:
    def killed(folder: Path) -> None:
        (folder / "half").touch()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        kept.kept("dear", killed)
    folder = kept.kept("dear", lambda folder: (folder / "whole").touch())
    assert [path.name for path in folder.iterdir()] == ["whole"]
    assert folder.parent == place
