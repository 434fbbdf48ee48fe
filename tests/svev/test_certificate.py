"""Certificates of one's own: a service that speaks HTTPS, and clients that verify it against the CA."""

import json
import os
import ssl
import subprocess
from contextlib import closing
from pathlib import Path

import httpx
import pytest

from rig.errors import BadInputError, ProcessDiedError
from svev import cli
from svev.rest_client import RestClient
from svev.serving.certificates import CertificateFiles, make_certificate
from tests.support.loopback import Loopback
from tests.webpanel.memory_service import MemoryService
from tests.webpanel.serving import serving
from webpanel.door.access import Access
from webpanel.door.tls import Tls

TOKEN = "a-token-for-the-tests-only"  # noqa: S105


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, loopback: Loopback) -> Path:
    """A folder with a CA and a certificate for this test's address."""
    made = tmp_path_factory.mktemp("tls") / "new"
    assert cli.main(["certificate", "--name", "hillpc.local", "--name", loopback.host, "--out", str(made)]) == 0
    return made


def test_clients_that_trust_the_ca_reach_the_panel(
    folder: Path, loopback: Loopback, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = CertificateFiles.within(folder)
    access = Access.for_address(loopback.host, environment={"SVEV_TOKEN": TOKEN})
    with (
        closing(MemoryService(tmp_path)) as service,
        serving(service, access, Tls.of(files.certificate, files.key)) as panel,
    ):
        assert panel.url.startswith("https:")
        trust = ssl.create_default_context(cafile=files.authority)
        trust.verify_flags |= ssl.VERIFY_X509_STRICT
        with panel.client(verify=trust) as client:
            answer = client.post("/api/login", json={"token": TOKEN}, headers={"Origin": panel.url})
            assert "; Secure" in answer.headers["set-cookie"]
            assert client.get("/api/status").json()["state"] == "idle"
        with panel.client() as stranger, pytest.raises(httpx.ConnectError, match="CERTIFICATE_VERIFY_FAILED"):
            stranger.get("/healthz")
        with httpx.Client() as plain, pytest.raises(httpx.HTTPError):
            plain.get(panel.url.replace("https:", "http:"))
        ctl = RestClient(panel.url, TOKEN)
        with pytest.raises(ProcessDiedError, match="CERTIFICATE_VERIFY_FAILED"):
            ctl.call("GET", "/api/status")
        monkeypatch.setenv("SVEV_CA", str(files.authority))
        assert ctl.call("GET", "/api/status")["state"] == "idle"


def test_a_ca_signs_again_for_its_own_names_only(folder: Path, loopback: Loopback) -> None:
    files = CertificateFiles.within(folder)
    before = {path: path.read_bytes() for path in (files.authority, files.authority_key, files.certificate, files.key)}
    make_certificate([loopback.host], folder)
    after = {path: path.read_bytes() for path in before}
    assert [after[path] == content for path, content in before.items()] == [True, True, False, False]
    with pytest.raises(BadInputError, match="made for other names"):
        make_certificate(["bank.example"], folder)
    assert {path: path.read_bytes() for path in before} == after
    assert {path.name for path in folder.iterdir()} == {path.name for path in before}
    assert [path.stat().st_mode & 0o777 for path in before] == [0o644, 0o600, 0o644, 0o600]
    shown = subprocess.run(
        ["/usr/bin/openssl", "x509", "-in", str(files.certificate), "-noout", "-text"],
        capture_output=True, text=True, timeout=30, check=True,
    ).stdout  # fmt: skip
    assert f"IP Address:{loopback.host}, DNS:localhost, IP Address:127.0.0.1" in shown


def test_what_cannot_be_used_is_said_before_the_service_starts(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = CertificateFiles.within(folder)
    with pytest.raises(BadInputError, match="give both"):
        Tls.of(files.certificate, None)
    with pytest.raises(BadInputError, match="svev certificate"):
        Tls.of(files.certificate, files.authority_key)
    with pytest.raises(BadInputError, match="No such file"):
        Tls.of(tmp_path / "none", files.key)
    os.mkfifo(tmp_path / "pipe")
    for pair in ((tmp_path / "pipe", files.key), (files.certificate, tmp_path / "pipe")):
        with pytest.raises(BadInputError, match="is no file, but a device or a pipe"):
            Tls.of(*pair)
    for name in ("", "two words", "x/CN=y", "-a", "a,DNS:b"):
        assert cli.main(["certificate", "--name", name, "--out", str(tmp_path / "other")]) == 2
    assert not (tmp_path / "other").exists()
    assert cli.main(["certificate", "--name", "::1", "--out", str(tmp_path / "six"), "--json"]) == 0
    assert set(json.loads(capsys.readouterr().out)) == {"authority", "authority_key", "certificate", "key"}
