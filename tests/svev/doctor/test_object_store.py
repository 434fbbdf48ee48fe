"""The doctor looks at the object store of `[offload]`: a real S3 server on loopback."""

import socket

import pytest

from rig.settings.model import OffloadSettings, RigSettings
from svev.doctor import object_store as examined
from svev.doctor.finding import Level
from tests.support.loopback import Loopback
from tests.support.object_store import KEYS, object_store, put, versions
from tests.support.rigs import SIM


@pytest.fixture(autouse=True)
def keys(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in KEYS.items():
        monkeypatch.setenv(name, value)


def _rig(address: str, bucket: str = "hill") -> RigSettings:
    offload = OffloadSettings(store=f"s3://{bucket}/jumps", store_options={"endpoint_url": address})
    return SIM.model_copy(update={"offload": offload})


def test_a_store_takes_copies_or_says_why_not_and_nothing_stays(loopback: Loopback) -> None:
    assert [*examined.look_at_store(SIM)] == []
    with object_store(loopback) as address:
        put(address, "hill")
        (finding,) = examined.look_at_store(_rig(address))
        assert (finding.level, finding.remedy) == (Level.PASS, "")
        assert finding.what == "s3://hill/jumps (offload.store) takes copies and gives them back"
        assert versions(address, "hill") == {}
        (finding,) = examined.look_at_store(_rig(address, "valley"))
    assert finding.level is Level.WARN
    assert "does not take copies (The specified bucket does not exist)" in finding.what
    assert finding.remedy == "until then recordings stay here, and none is released"


@pytest.mark.long
def test_a_store_that_is_not_there_is_said_to_be(loopback: Loopback) -> None:
    (finding,) = examined.look_at_store(_rig(f"http://{loopback.host}:{loopback.free_port()}"))
    assert (finding.level, "does not take copies (Could not connect" in finding.what) == (Level.WARN, True), finding


def test_a_store_that_is_silent_is_said_to_be(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(examined, "LOOK_S", 1.0)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        (finding,) = examined.look_at_store(_rig(f"http://127.0.0.1:{silent.getsockname()[1]}"))
    assert (finding.level, "did not answer within 1 s" in finding.what) == (Level.WARN, True), finding
