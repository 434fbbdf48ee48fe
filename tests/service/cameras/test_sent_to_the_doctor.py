"""What the page prints of cameras that do not answer sends to the doctor with the service's own rig file."""

import json
from pathlib import Path

from tests.service.serving import PATIENCE_S, serving
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until


def test_the_page_names_the_rig_file_for_the_doctor(tmp_path: Path, loopback: Loopback) -> None:
    rig = tmp_path / "rig.toml"
    address = f"{loopback.host.rpartition('.')[0]}.201"
    rig.write_text(
        f'name = "not there"\n[network]\npublish = "{loopback.endpoint()}"\n[trigger]\nsettle_s = 0.1\n'
        f'[[cameras]]\nname = "K1"\nbackend = "aravis"\naddress = "{address}"\n'
    )
    with serving(tmp_path, rig, loopback) as service:
        service.call("POST", "/api/arm")
        wait_until(lambda: "svev doctor" in json.dumps(service.get("/api/status")), "the doctor is named", PATIENCE_S)
        assert f"svev doctor --rig {rig}" in json.dumps(service.get("/api/status"))
