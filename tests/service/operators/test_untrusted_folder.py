"""A data folder in which somebody has put links and pipes under the names of the service's own files."""

import os
from pathlib import Path

import pytest

from rig.errors import BadInputError
from service.exports.jobs import FOLDER
from service.jumpers.keeper import NAME, UNDO_NAME
from service.rehearsals import NAME as REHEARSAL
from svev.claims import LOCK, folder_claim
from tests.capture.rigs import write_rig
from tests.service.serving import serving
from tests.support.commands import run_svev
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until
from webpanel.door.tokens import read_tokens


@pytest.mark.timeout(120)
def test_the_service_comes_up_beside_pipes_and_links_and_says_so(tmp_path: Path, loopback: Loopback) -> None:
    data, dear = tmp_path / "data", tmp_path / "dear"
    data.mkdir()
    dear.write_text("dear")
    for name in (
        NAME,
        FOLDER,
        REHEARSAL,
        ".svev-catalogue.db",
        ".svev-catalogue.db-wal",
        "jump.mcap",
        "jump.jumper.json",
        "jump.session.json",
    ):
        os.mkfifo(data / name)
    (data / UNDO_NAME).symlink_to(dear)
    (data / "jump 10:30.mcap").touch()
    with serving(tmp_path, write_rig(tmp_path, "sim", loopback), loopback) as service:
        assert service.data == data
        messages = service.log.read_text().splitlines()
        assert any(NAME in each and "a device or a pipe" in each for each in messages), messages
        assert any(FOLDER in each and "exports cannot be kept there" in each for each in messages), messages
        assert any("1 logs in" in each and "such as jump 10:30.mcap: rename them" in each for each in messages), (
            messages
        )
        assert service.get("/api/recordings")[0]["verdict"]["level"] == "error"
        service.call_table(b"bib,athlete\n17,Ola Nordmann\n")
        wait_until(lambda: not (data / UNDO_NAME).is_symlink(), "the start list is kept")
    assert dear.read_text() == "dear"


def test_a_link_as_lock_is_refused_and_what_it_leads_to_stays(tmp_path: Path) -> None:
    (tmp_path / "dear").write_text("dear")
    (tmp_path / ".svev.lock").symlink_to("dear")
    with pytest.raises(BadInputError, match="is a link, and links are not followed: remove it"):
        folder_claim(tmp_path, "svev serve", "--data").__enter__()
    assert (tmp_path / "dear").read_text() == "dear"
    (tmp_path / ".svev.lock").unlink()
    os.mkfifo(tmp_path / ".svev.lock")
    with pytest.raises(BadInputError, match="is no regular file: remove it"):
        folder_claim(tmp_path, "svev serve", "--data").__enter__()


@pytest.mark.timeout(20)
def test_a_pipe_as_token_file_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "token")
    with pytest.raises(BadInputError, match="is no file, but a device or a pipe"):
        read_tokens(tmp_path / "token", {})


@pytest.mark.timeout(120)
def test_record_keeps_out_of_the_folder_of_a_service(tmp_path: Path, loopback: Loopback) -> None:
    rig = write_rig(tmp_path, "sim", loopback)
    with serving(tmp_path, rig, loopback) as service:
        record = ("record", "--rig", str(rig), "--seconds", "1", "--out", str(service.data))
        done = run_svev(*record)
        assert done.returncode == 2
        holder = f"another svev serve (process {service.pid})"
        assert f"{holder} uses it: record with it (svev ctl start), or choose another --out" in done.stderr
        (service.data / LOCK).unlink()
        done = run_svev(*record)
        assert done.returncode == 2
        assert "another svev uses it" in done.stderr
        assert list(service.data.glob("*.mcap")) == []
