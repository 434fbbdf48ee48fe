"""Encrypted publication: who has the key gets everything, others get nothing; keys stay secret."""

import os
import subprocess
from contextlib import closing
from pathlib import Path

import pytest
import zmq
from zmq.auth import load_certificate

from recorder.log.triplet_buffers import TripletBuffers
from recorder.publishing.keys import exposure, load_keys, make_keys
from recorder.publishing.publisher import Publisher
from rig.errors import BadInputError
from svev import cli
from tests.capture.rigs import make_rig, write_rig
from tests.recorder.logs import acquire
from tests.service.serving import serving
from tests.support.commands import run_svev
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until

SHAPE = (240, 960)


def _guard(sub: "zmq.Socket[bytes]", server: bytes) -> None:
    sub.linger = 0
    sub.curve_publickey, sub.curve_secretkey = zmq.curve_keypair()
    sub.curve_serverkey = server


def test_only_who_has_the_key_is_served(tmp_path: Path, loopback: Loopback) -> None:
    secret, public = make_keys(tmp_path / "hill")
    make_keys(tmp_path / "other")
    buffers = TripletBuffers(SHAPE, 16)
    with (
        closing(Publisher(loopback.endpoint(), keys=load_keys(secret))) as publisher,
        zmq.Context() as context,
        context.socket(zmq.SUB) as good,
        context.socket(zmq.SUB) as plain,
        context.socket(zmq.SUB) as stranger,
    ):
        _guard(good, load_certificate(public)[0])
        _guard(stranger, load_certificate(tmp_path / "other.key")[0])
        plain.linger = 0
        for sub in (plain, stranger, good):
            sub.subscribe(b"triplet")
            sub.connect(publisher.address)
        assert publisher.wait_for_subscriber(20)
        for pulse in range(50):
            wait_until(lambda: publisher.held < 4, "ZeroMQ let go of slots that were received")
            slot = acquire(buffers)
            buffers.pixels(slot).fill(pulse)
            publisher.triplet(b"%d" % pulse, buffers, slot)
            buffers.release(slot)
            assert good.poll(20_000)
            assert good.recv_multipart() == [b"triplet", b"%d" % pulse, bytes([pulse]) * (SHAPE[0] * SHAPE[1])]
        assert not plain.poll(0)
        assert not stranger.poll(0)


def test_the_secret_key_is_for_its_owner_alone(tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        secret, public = make_keys(tmp_path / "hill")
    finally:
        os.umask(before)
    assert secret.stat().st_mode & 0o777 == 0o600
    assert load_certificate(secret) == (load_keys(secret).public, load_keys(secret).secret)
    assert load_certificate(public) == (load_keys(secret).public, None)
    secret.chmod(0o640)
    with pytest.raises(BadInputError, match="others than its owner may read the secret key; run: chmod 600 "):
        load_keys(secret)
    with pytest.raises(BadInputError, match="exists already and is never overwritten"):
        make_keys(tmp_path / "hill")
    with pytest.raises(BadInputError, match=r"holds no secret key; name the file \.key_secret"):
        load_keys(public)
    with pytest.raises(BadInputError, match=r"keys cannot be read \(.*\); make them with svev keys"):
        load_keys(tmp_path / "none")
    (tmp_path / "odd").write_bytes(b'public-key\nsecret-key = "\xff"\n')
    with pytest.raises(BadInputError, match="holds no secret key"):
        load_keys(tmp_path / "odd")
    with pytest.raises(BadInputError, match="cannot be written"):
        make_keys(tmp_path / "none" / "hill")


def test_the_command_makes_keys(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["keys", str(tmp_path / "hill")]) == 0
    assert "curve_key_file" in capsys.readouterr().out
    assert load_keys(tmp_path / "hill.key_secret")
    assert cli.main(["keys", str(tmp_path / "hill")]) == 2


@pytest.mark.parametrize(
    ("address", "exposed"),
    [
        ("tcp://127.0.0.1:5556", False),
        ("tcp://127.1.2.3:*", False),
        ("tcp://[::1]:5556", False),
        ("tcp://lo:5556", False),
        ("ipc:///run/svev/live", False),
        ("tcp://*:5556", True),
        ("tcp://0.0.0.0:5556", True),
        ("tcp://192.168.1.5:5556", True),
        ("tcp://eth0:5556", True),
        ("tcp://[::]:5556", True),
    ],
)
def test_an_address_that_others_reach_is_warned_of(address: str, exposed: bool, tmp_path: Path) -> None:
    assert bool(exposure(address, None)) is exposed
    assert not exposure(address, load_keys(make_keys(tmp_path / "hill")[0]))


def _record(rig: Path, out: Path) -> "subprocess.CompletedProcess[str]":
    return run_svev("record", "--rig", str(rig), "--seconds", "1", "--out", str(out), timeout_s=90)


def test_a_recording_with_keys_in_the_rig_file(tmp_path: Path, loopback: Loopback) -> None:
    make_keys(tmp_path / "hill")
    rig = write_rig(tmp_path, "sim", loopback, curve_key_file="hill.key_secret")
    assert make_rig(tmp_path, "sim", loopback, curve_key_file="hill.key_secret").network.curve_key_file == (
        tmp_path / "hill.key_secret"
    )
    assert "30 complete" in _record(rig, tmp_path / "out").stdout
    (tmp_path / "hill.key_secret").chmod(0o644)
    done = _record(rig, tmp_path / "none")
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert "run: chmod 600" in done.stderr
    assert not (tmp_path / "none").exists()


@pytest.mark.long
def test_whoever_publishes_to_everybody_is_warned(tmp_path: Path, loopback: Loopback) -> None:
    rig = write_rig(tmp_path, "sim", loopback)
    rig.write_text(rig.read_text().replace(f"tcp://{loopback.host}:", "tcp://0.0.0.0:"))
    assert "publisher whoever reaches tcp://0.0.0.0:" in _record(rig, tmp_path / "out").stderr
    with serving(tmp_path, rig, loopback) as service:
        service.arm()
        assert "publisher: whoever reaches tcp://0.0.0.0:" in service.log.read_text()
