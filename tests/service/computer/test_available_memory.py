"""The memory that is available: of the machine, of cgroups of both versions."""

from pathlib import Path

import pytest

from service.processes.memory import available_bytes

MB = 1024 * 1024


@pytest.fixture
def root(tmp_path: Path) -> Path:
    (tmp_path / "proc/self").mkdir(parents=True)
    (tmp_path / "proc/meminfo").write_text("MemTotal: 9000 kB\nMemAvailable:    4096000 kB\n")
    (tmp_path / "proc/self/cgroup").write_text("")
    return tmp_path


def _group(folder: Path, **files: str) -> None:
    folder.mkdir(parents=True)
    for name, text in files.items():
        (folder / name.replace("__", ".")).write_text(text)


def test_this_machine_tells() -> None:
    assert available_bytes() > 100 * MB


def test_without_limits_it_is_what_the_machine_has(root: Path) -> None:
    assert available_bytes(root) == 4000 * MB


def test_the_narrowest_cgroup_counts(root: Path) -> None:
    (root / "proc/self/cgroup").write_text("0::/system.slice/svev.service\n")
    slice_ = root / "sys/fs/cgroup/system.slice"
    used = f"{500 * MB}\n"
    _group(
        slice_, memory__max=f"{2000 * MB}\n", memory__current=used, memory__stat=f"anon 5\ninactive_file {100 * MB}\n"
    )
    _group(slice_ / "svev.service", memory__max="max\n", memory__current=used)
    assert available_bytes(root) == 1600 * MB
    (slice_ / "svev.service/memory.max").write_text(f"{600 * MB}\n")
    assert available_bytes(root) == 100 * MB
    (slice_ / "svev.service/memory.max").write_text(f"{400 * MB}\n")
    assert available_bytes(root) == 0


def test_cgroups_of_the_first_version_count_too(root: Path) -> None:
    (root / "proc/self/cgroup").write_text("9:name=systemd:/\n4:memory:/box\n0::/\n")
    top = root / "sys/fs/cgroup/memory"
    _group(top, memory__limit_in_bytes="9223372036854771712\n", memory__usage_in_bytes="5\n")
    _group(top / "box", memory__limit_in_bytes=f"{300 * MB}\n", memory__usage_in_bytes=f"{100 * MB}\n")
    assert available_bytes(root) == 200 * MB
