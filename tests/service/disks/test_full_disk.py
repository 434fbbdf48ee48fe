"""A disk that fills up while recording: the recording ends, its log is readable, and the service goes on."""

from pathlib import Path

import pytest

from recorder.checking.verify import verify
from tests.capture.rigs import write_rig
from tests.service.serving import PATIENCE_S, serving
from tests.support.loopback import Loopback
from tests.support.other_disk import may_mount
from tests.support.waiting import wait_until

pytestmark = pytest.mark.long


def test_a_full_disk_ends_the_recording_and_the_service_lives_on(tmp_path: Path, loopback: Loopback) -> None:
    """A disk of 300 MB, mounted in a mount namespace of the service's own."""
    if not may_mount():
        pytest.skip("no mount namespace of our own is allowed here: a small disk cannot be made")
    rig = write_rig(tmp_path, "sim", loopback)
    rig.write_text(rig.read_text().replace("[network]", "[recorder]\nreserve_gb = 0\njump_s = 4\n[network]"))
    small, kept = tmp_path / "small", tmp_path / "kept.mcap"
    small.mkdir()
    script = 'mount -t tmpfs -o size=300m none "$0" && exec "$@"'
    prefix = ("unshare", "--mount", "sh", "-c", script, str(small))
    with serving(tmp_path, rig, loopback, prefix=prefix, data=small) as service:
        service.arm()
        recording = service.post("/api/recordings", {"preroll_s": 0})
        wait_until(lambda: service.state() == "armed", "the disk is full", PATIENCE_S, 0.1)
        statement = service.get("/api/status")["statement"]
        assert statement["code"] == "recording_ended"
        assert "the disk is full" in statement["text"]
        status, problem = service.call("POST", "/api/recordings", {})
        assert (status, problem["code"]) == (507, "storage")
        assert "delete recordings" in problem["detail"]
        found = service.get(f"/api/recordings/{recording['id']}")
        assert found["counts"]["complete"] == found["counts"]["pulses"] > 100
        assert found["verdict"]["code"] == "verdict_disk_full"
        (listed,) = service.get("/api/recordings")
        assert listed["verdict"] == found["verdict"]
        kept.write_bytes(Path(f"/proc/{service.pid}/root{small}/{recording['id']}.mcap").read_bytes())
        service.get("/api/doctor")

        # What is deleted makes room by itself when it is needed, and is counted as room before.
        assert service.get("/api/status")["disk"]["jumps_left"] == 0
        assert service.call("DELETE", f"/api/recordings/{recording['id']}")[0] == 200
        wait_until(
            lambda: service.get("/api/status")["disk"]["jumps_left"] or not service.get("/api/trash")["recordings"],
            "the trash counts as room", PATIENCE_S, 0.1,
        )  # fmt: skip
        assert service.post("/api/recordings", {"duration_s": 1})["state"] == "recording"
        assert service.get("/api/trash") == {"recordings": 0, "bytes": 0}
    report = verify(kept)
    assert report.ledger.complete == report.ledger.pulses > 100
    assert not report.damaged
