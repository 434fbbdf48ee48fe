"""Who has what a command needs is named: an armed service, and how it is operated."""

from pathlib import Path

import pytest

from svev.cli import main
from svev.neighbours import running_services
from tests.service.serving import serving
from tests.support.loopback import Loopback
from tests.support.rigs import write_rig


@pytest.mark.parametrize(
    ("words", "found"),
    [
        ("python3 /opt/svev/bin/svev serve --rig /etc/svev/rig.toml", [("/etc/svev/rig.toml", "svev ctl")]),
        (
            "python -m svev serve --port 8080 --host 0.0.0.0 --rig=/rig.toml",
            [("/rig.toml", "svev ctl --url http://127.0.0.1:8080")],
        ),
        ("python -m svev record --rig /rig.toml", []),
        ("nginx serve --rig /rig.toml", []),
    ],
)
def test_services_are_known_by_their_command_lines(tmp_path: Path, words: str, found: list[tuple[str, str]]) -> None:
    process = tmp_path / "17"
    process.mkdir()
    (process / "cmdline").write_text(words.replace(" ", "\0") + "\0")
    assert [(str(service.rig), service.ctl) for service in running_services(tmp_path)] == found


@pytest.mark.long
def test_what_an_armed_service_has_is_told_with_the_command_that_operates_it(
    tmp_path: Path, loopback: Loopback, capsys: pytest.CaptureFixture[str]
) -> None:
    rig = write_rig(tmp_path, loopback, backend="sim")
    with serving(tmp_path, rig, loopback) as service:
        service.arm()
        ctl = f"svev ctl --url {service.url}"
        assert main(["record", "--rig", str(rig), "--seconds", "1", "--out", str(tmp_path / "logs")]) == 2
        said = capsys.readouterr().err
        assert f"svev serve (process {service.pid}) has armed these cameras: record with it ({ctl} start)" in said
        assert f"disarm it first ({ctl} disarm)" in said
        host, port = service.url.removeprefix("http://").split(":")
        other = ["--host", host, "--port", port, "--data", str(tmp_path / "other")]
        assert main(["serve", "--rig", str(rig), *other]) == 2
        said = capsys.readouterr().err
        assert f"svev serve (process {service.pid}) runs there; operate it by {ctl}" in said
        assert said.count(f"{host}:{port}") == 2  # the address, and that of the service
