"""Paths that are no UTF-8, as sticks, old archives and Samba give them: everything works, texts have them escaped."""

import json
import os
from pathlib import Path

import pytest

from rig.errors import BadInputError
from rig.events import Event, Level
from rig.phrase import escaped, phrase, plain
from rig.transport import wire
from tests.capture.rigs import write_rig
from tests.service.serving import serving
from tests.support.commands import run_svev
from tests.support.loopback import Loopback

NAME = os.fsdecode(b"sted-\xe5")


@pytest.mark.parametrize(
    ("text", "shown"), [(NAME, r"sted-\xe5"), ("bakke-å", "bakke-å"), ("\ud800", r"\xed\xa0\x80"), ("", "")]
)
def test_texts_have_the_bytes_of_a_name_escaped(text: str, shown: str) -> None:
    assert escaped(text) == shown
    assert plain(text).text == shown
    assert phrase("x", "{path} is full", path=text).values == {"path": shown}
    assert str(BadInputError(text)) == shown
    Event.now(Level.INFO, "service", phrase("x", "{path}", path=text)).to_protobuf()


@pytest.mark.parametrize("name", [NAME, "bakke-å", "a b"])
def test_a_path_goes_over_the_wire_as_it_is(name: str) -> None:
    assert wire.decoder(Path).decode(wire.encode(Path("/data", name))) == Path("/data", name)


def test_the_service_arms_and_records_in_a_folder_whose_name_is_no_utf8(tmp_path: Path, loopback: Loopback) -> None:
    data = tmp_path / NAME
    with serving(tmp_path, write_rig(tmp_path, "sim", loopback), loopback, data=data) as service:
        service.arm()
        recording = service.post("/api/recordings", {"athlete": "Ola"})["id"]
        service.await_pulses(10)
        service.post(f"/api/recordings/{recording}/stop")
        assert service.get(f"/api/recordings/{recording}")["verdict"]["level"] == "good"
    log = data / f"{recording}.mcap"
    recovered = data / f"{NAME}.mcap"
    for command in (("verify", str(log)), ("recover", str(log), "-o", str(recovered)), ("info", str(recovered))):
        done = run_svev(*command)
        assert done.returncode == 0, done
        assert r"sted-\xe5" in done.stdout + done.stderr
    done = run_svev("recover", str(log), "-o", str(recovered))
    assert done.returncode == 2
    assert r"sted-\xe5" in done.stderr


def test_record_records_in_a_folder_whose_name_is_no_utf8(tmp_path: Path, loopback: Loopback) -> None:
    rig = write_rig(tmp_path, "sim", loopback)
    done = run_svev("record", "--rig", str(rig), "--seconds", "0.5", "--out", str(tmp_path / NAME), "--json")
    assert done.returncode == 0, done
    assert Path(json.loads(done.stdout)["log"]).is_file()
