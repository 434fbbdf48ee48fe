"""`svev.client`: triplets for a program of one's own, from publishers and from reliable replays."""

import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import zmq

from recorder.publishing.keys import load_keys, make_keys
from recorder.publishing.replay import ReplayOptions, replay
from rig.errors import BadInputError
from rig.pulse import PulseNumber
from svev.client import Client, Triplet
from tests.recorder.logs import ABSENT, ALL_OK, LOST, OK, Written, make_image, make_tag, write_log
from tests.support.loopback import Loopback

PULSES = (ALL_OK, (OK, LOST, OK), (ABSENT,) * 3, ALL_OK, ALL_OK)
EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
_QUIET_S = 0.3


@contextmanager
def _replaying(path: Path, options: ReplayOptions) -> Iterator[None]:
    """A log replayed beside the test."""
    stop = threading.Event()
    thread = threading.Thread(target=replay, args=(path, options), kwargs={"stop": stop})
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join(30)


def _check(triplets: list[Triplet], written: list[Written]) -> None:
    assert [each.tag for each in triplets] == [each.tag for each in written]
    for triplet, was in zip(triplets, written, strict=True):
        there = {camera.name: camera.columns for camera in was.tag.cameras if camera.status is OK}
        assert list(triplet.frames) == list(there)
        assert triplet.complete is (len(there) == 3)
        assert (triplet.side_by_side is None) is (was.image is None)
        for name, columns in there.items():
            assert was.image is not None
            assert np.array_equal(triplet.frames[name], was.image[:, slice(*columns)])


@pytest.mark.parametrize("reliable", [False, True], ids=["published", "reliable"])
def test_published_and_replayed_triplets_come_alike(tmp_path: Path, loopback: Loopback, *, reliable: bool) -> None:
    written = write_log(tmp_path / "a.mcap", PULSES)
    options = ReplayOptions(loopback.endpoint(), speed=None, reliable=reliable)
    with Client(options.address, reliable=reliable, timeout_s=10.0) as client:
        with _replaying(tmp_path / "a.mcap", options):
            triplets = []
            for triplet in client:
                triplets.append(triplet)
                if len(triplets) == len(written):
                    break
        assert client.next(0.0) is None
        assert (client.missed, client.refused) == (0, 0)
    _check(triplets, written)


def test_pulses_that_did_not_come_are_counted_in_each_recording(tmp_path: Path, loopback: Loopback) -> None:
    address = loopback.endpoint()
    with zmq.Context() as context, context.socket(zmq.PUSH) as server, Client(address, reliable=True) as client:
        server.bind(address)
        for recording, pulse in (("r1", 4), ("r1", 5), ("r1", 8), ("r2", 1), ("r2", 3)):
            tag = make_tag(pulse).encode().replace(b'"r1"', f'"{recording}"'.encode())
            server.send_multipart([b"triplet", tag, b""])
        got = [client.next(10.0) for _ in range(5)]
    assert [each.pulse for each in got if each is not None] == [PulseNumber(n) for n in (4, 5, 8, 1, 3)]
    assert client.missed == 3


def test_what_is_no_whole_triplet_is_refused(loopback: Loopback) -> None:
    address, tag = loopback.endpoint(), make_tag(1)
    whole = make_image(tag).tobytes()
    with zmq.Context() as context, context.socket(zmq.PUSH) as server, Client(address, reliable=True) as client:
        server.bind(address)
        for parts in ([tag.encode(), whole[:-1]], [b"{}", whole], [tag.encode()], [tag.encode(), whole]):
            server.send_multipart([b"triplet", *parts])
        triplet = client.next(10.0)
    assert triplet is not None
    assert np.array_equal(triplet.frames["K3"], make_image(tag)[:, 60:90])
    assert client.refused == 3


def test_nothing_within_the_timeout_ends_the_iteration(loopback: Loopback) -> None:
    with Client(loopback.endpoint(), timeout_s=_QUIET_S) as client:
        assert list(client) == []
        assert client.next(0.0) is None


def test_another_thread_stops_a_client_that_waits(loopback: Loopback) -> None:
    with Client(loopback.endpoint()) as client:
        got: list[Triplet] = []
        thread = threading.Thread(target=lambda: got.extend(client))
        thread.start()
        client.stop()
        client.stop()
        thread.join(10)
        assert not thread.is_alive()
        assert got == []
    client.close()
    client.stop()


def test_a_signal_handler_stops_it(loopback: Loopback) -> None:
    before = signal.getsignal(signal.SIGUSR1)
    with Client(loopback.endpoint(), timeout_s=20.0) as client:
        signal.signal(signal.SIGUSR1, lambda *_: client.stop())
        try:
            threading.Timer(_QUIET_S, signal.pthread_kill, (threading.main_thread().ident, signal.SIGUSR1)).start()
            assert list(client) == []
        finally:
            signal.signal(signal.SIGUSR1, before)


def test_keys_are_needed_where_the_publisher_has_them(tmp_path: Path, loopback: Loopback) -> None:
    secret, public = make_keys(tmp_path / "hill")
    write_log(tmp_path / "a.mcap", PULSES)
    options = ReplayOptions(loopback.endpoint(), speed=None, keys=load_keys(secret))
    with Client(options.address, key=public) as client, _replaying(tmp_path / "a.mcap", options):
        assert client.next(10.0) is not None


def test_a_wrong_address_or_key_is_said_at_once(tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match="cannot connect"):
        Client("127.0.0.1")
    with pytest.raises(BadInputError, match="holds no public key"):
        Client(key=tmp_path / "none.key")


def test_it_loads_no_camera_no_service_and_no_analysis() -> None:
    heavy = {"scipy", "cv2", "gi", "fastapi"}
    code = f"import svev.client, sys; print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip() == "[]"


def _said(triplets: list[Written]) -> list[str]:
    """What the examples print of these triplets."""
    lines = []
    for each in triplets:
        words = [f"pulse {each.tag.pulse}:"]
        for camera in each.tag.cameras:
            frame = None if each.image is None or camera.status is not OK else each.image[camera.part]
            words += [camera.name, str(camera.status) if frame is None else f"{frame.mean():.2f}"]
        lines.append(" ".join(words))
    return lines


@pytest.mark.long
def test_the_example_in_cpp_is_compiled_and_receives_every_triplet(tmp_path: Path, loopback: Loopback) -> None:
    compiler = shutil.which("g++")
    assert compiler is not None, "no g++: run make test, which installs it"
    program = tmp_path / "triplets"
    flags = ["-std=c++17", "-Wall", "-Wextra", "-Werror"]
    subprocess.run([compiler, *flags, EXAMPLES / "triplets.cpp", "-o", program, "-lzmq"], timeout=120, check=True)
    _receives_every_triplet([program], tmp_path, loopback)


_OCTAVE = shutil.which("octave-cli")


@pytest.mark.long
@pytest.mark.skipif(_OCTAVE is None, reason="no Octave here: apt install octave octave-zeromq")
def test_the_example_in_octave_receives_every_triplet(tmp_path: Path, loopback: Loopback) -> None:
    _receives_every_triplet([_OCTAVE or "", "--no-history", EXAMPLES / "triplets.m"], tmp_path, loopback)


def _receives_every_triplet(command: Sequence[str | Path], folder: Path, loopback: Loopback) -> None:
    """Start a program with the address of a replay; it has to print what is in each triplet."""
    written = write_log(folder / "a.mcap", PULSES)
    options = ReplayOptions(loopback.endpoint(), speed=None)
    with subprocess.Popen([*command, options.address], stdout=subprocess.PIPE, text=True) as process:
        try:
            with _replaying(folder / "a.mcap", options):
                assert process.stdout is not None
                lines = [process.stdout.readline().rstrip("\n") for _ in written]
        finally:
            process.kill()
    assert lines == _said(written)
