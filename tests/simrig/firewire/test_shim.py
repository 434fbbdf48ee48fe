"""The shim: compiled without a complaint, once; invisible to everything that is not FireWire."""

import errno
import os
import socket
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from rig.errors import BadInputError
from simrig.firewire.host import build, wire
from simrig.firewire.host.abi import Ioctl
from simrig.gpio import build as gpio_build
from simrig.preload.build import COMMON, OPTIONS
from tests.simrig.firewire.conftest import Program, StartHill, StartProgram

#: How the kernel's header makes the code of an ioctl: direction, size of the argument, '#', number.
WRITES = 1 << 30


@pytest.mark.parametrize("sources", [build.SOURCES, gpio_build.SOURCES, COMMON], ids=["firewire", "gpio", "common"])
def test_it_compiles_without_a_warning(sources: Path, tmp_path: Path) -> None:
    for source in sorted(sources.glob("*.c")):
        command = ["gcc", *OPTIONS, "-Wshadow", "-Wconversion", "-Wno-sign-conversion", "-c", str(source)]
        done = subprocess.run([*command, "-o", str(tmp_path / "out.o")], capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, ""), source.name


def test_many_ask_for_it_at_once_and_it_is_compiled_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with ThreadPoolExecutor(4) as pool:
        libraries = set(pool.map(lambda _: build.shim(), range(4)))
    (library,) = libraries
    assert list((tmp_path / "svev").iterdir()) == [library], "nothing but the library is left"
    before = library.stat().st_mtime_ns
    assert build.shim() == library
    assert library.stat().st_mtime_ns == before


def test_a_missing_compiler_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(BadInputError, match=r"^emulated devices need a C compiler.*apt install gcc linux"):
        build.shim()


def test_a_cache_that_cannot_be_written_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    with pytest.raises(BadInputError, match=r"cannot be written.*set XDG_CACHE_HOME"):
        build.shim()


def test_without_a_bus_nothing_changes() -> None:
    code = "import os; print(sorted(os.listdir('/dev')), os.path.exists('/dev/fw0'), open('/dev/null', 'rb').read())"
    plain = {key: value for key, value in os.environ.items() if key != wire.VARIABLE}
    outputs = [
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True)
        for environment in (plain, {**plain, "LD_PRELOAD": str(build.shim())})
    ]
    assert outputs[0].stdout == outputs[1].stdout
    assert outputs[1].stderr == ""


def test_a_bus_that_is_not_there_is_a_machine_without_firewire(start_hill: StartHill) -> None:
    hill = start_hill()
    environment = {**hill.environment, wire.VARIABLE: "@nobody-listens-here"}
    program = Program(environment)
    try:
        assert program("listing")["listed"] == []
        assert program("cameras") == []
        assert program("opens", "/dev/fw1") == "FileNotFoundError"
    finally:
        program.close()


def test_python_sees_the_nodes_too(start_hill: StartHill, start_program: StartProgram) -> None:
    seen = start_program(start_hill(2))("listing")
    nodes = ["fw0", "fw1", "fw2"]
    assert seen == {
        "listed": nodes, "found": nodes, "exist": [True] * 3, "readable": [True] * 3, "others": True, "nowhere": False,
    }  # fmt: skip


def test_many_threads_at_once(start_hill: StartHill, start_program: StartProgram) -> None:
    assert start_program(start_hill())("hammer", "/dev/fw1", 8, 25) == []


def test_nodes_without_permission(start_hill: StartHill, start_program: StartProgram) -> None:
    program = start_program(start_hill(1, permitted=False))
    seen = program("listing")
    assert (seen["listed"], seen["readable"]) == (["fw0", "fw1"], [False, False])
    assert program("opens", "/dev/fw1") == "PermissionError"
    assert program("cameras") == []


@pytest.mark.parametrize("packet", [b"", b"nonsense", bytes(16), bytes([2]) + bytes(15), bytes([9]) + bytes(15)])
def test_a_stranger_who_talks_nonsense_is_hung_up_on(start_hill: StartHill, packet: bytes) -> None:
    hill = start_hill()
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as stranger:
        stranger.settimeout(5)
        stranger.connect("\0" + hill.environment[wire.VARIABLE][1:])
        stranger.send(packet)
        assert stranger.recv(100) == b""
    assert hill.bus_state().nodes == ("fw0", "fw1"), "the bus goes on"


@pytest.mark.parametrize(
    ("number", "size", "expected"),
    [
        (Ioctl.START_ISO, 16, errno.EINVAL),  # no context yet
        (Ioctl.CREATE_ISO_CONTEXT, 32, errno.EINVAL),  # for transmission
        (Ioctl.DEALLOCATE_ISO_RESOURCE, 4, errno.EINVAL),  # nothing is allocated
        (Ioctl.SEND_BROADCAST_REQUEST, 40, errno.EACCES),  # to the kernel's registers
        (0x13, 40, errno.ENOTTY),  # stream packets
        (Ioctl.START_ISO, 8, errno.EINVAL),  # half an argument
    ],
)
def test_ioctls_are_refused_as_the_kernel_does(
    start_hill: StartHill, start_program: StartProgram, number: int, size: int, expected: int
) -> None:
    program = start_program(start_hill())
    assert program("ioctl", "/dev/fw1", WRITES | size << 16 | ord("#") << 8 | number, size) == expected
