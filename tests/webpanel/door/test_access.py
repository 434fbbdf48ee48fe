"""The rules of access: which addresses need a token, what a token is, which names are ours."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from rig.errors import BadInputError
from rig.settings.file import CONFIG
from webpanel.door.access import Access, is_loopback

TOKEN = "a-token-for-the-tests-only"  # noqa: S105
EVERYWHERE = "0.0.0.0"  # noqa: S104 - nothing listens there


@pytest.mark.parametrize("host", ["127.0.0.1", "127.10.3.1", "::1", "[::1]", "localhost"])
def test_on_loopback_no_token_is_needed(host: str) -> None:
    assert is_loopback(host)
    assert Access.for_address(host, environment={}).token is None


@pytest.mark.parametrize("host", [EVERYWHERE, "::", "192.168.1.5", "hillpc", "", "128.0.0.1", "localhost.evil.org"])
def test_elsewhere_it_is(host: str) -> None:
    with pytest.raises(BadInputError, match="--token-file"):
        Access.for_address(host, environment={})
    assert Access.for_address(host, environment={"SVEV_TOKEN": TOKEN}).token == TOKEN.encode()


def test_the_service_does_not_start_without_it(tmp_path: Path) -> None:
    rig = str(CONFIG / "rigs" / "sim.toml")
    command = [sys.executable, "-m", "svev", "serve", "--rig", rig, "--host", EVERYWHERE]
    environment = {name: text for name, text in os.environ.items() if name != "SVEV_TOKEN"}
    done = subprocess.run(
        [*command, "--port", "0", "--data", str(tmp_path)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        env=environment,
    )
    assert done.returncode == 2
    assert "--token-file" in done.stderr
    assert len(done.stderr.strip().splitlines()) <= 3


def test_the_token_comes_from_a_file_before_the_environment(tmp_path: Path) -> None:
    file = tmp_path / "token"
    file.write_text(f"{TOKEN}\n")
    access = Access.for_address(EVERYWHERE, file, environment={"SVEV_TOKEN": "another-token-altogether"})
    assert access.knows(TOKEN)
    assert not access.knows("another-token-altogether")


def test_only_the_whole_token_is_the_token() -> None:
    access = Access.for_address(EVERYWHERE, environment={"SVEV_TOKEN": TOKEN})
    assert access.knows(TOKEN)
    for wrong in ("", TOKEN[:-1], TOKEN + "x", TOKEN.upper(), "å" * 26, "\udcff"):
        assert not access.knows(wrong)
    assert not Access("127.0.0.1").knows("")


def test_a_token_is_never_printed() -> None:
    assert TOKEN not in repr(Access.for_address(EVERYWHERE, environment={"SVEV_TOKEN": TOKEN}))


@pytest.mark.parametrize("content", ["", "short", "two words are not a token", "x" * 1001, "nøkkel-nøkkel-nøkkel"])
def test_a_bad_token_is_refused_and_not_quoted(tmp_path: Path, content: str) -> None:
    file = tmp_path / "token"
    file.write_text(content)
    with pytest.raises(BadInputError, match="openssl rand") as caught:
        Access.for_address(EVERYWHERE, file, environment={})
    assert not content or content not in str(caught.value)


def test_an_unreadable_token_file(tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match="check path and permissions"):
        Access.for_address("127.0.0.1", tmp_path / "none", environment={})


@pytest.mark.parametrize(
    "header", ["hillpc.local", "HillPC.local:8000", "127.0.0.1:1", "localhost", "[::1]:80", "10.0.0.7:8000"]
)
def test_own_names(header: str) -> None:
    access = Access.for_address(EVERYWHERE, None, ["hillpc.local"], {"SVEV_TOKEN": TOKEN})
    assert access.allows_host(header, "10.0.0.7")


@pytest.mark.parametrize(
    "header",
    [
        "evil.org",
        "hillpc.local.evil.org",
        "evil.org:8000",
        "",
        ":8000",
        "10.0.0.8",
        "127.0.0.1.evil.org",
        "a@127.0.0.1",
    ],
)
def test_foreign_names(header: str) -> None:
    access = Access.for_address(EVERYWHERE, None, ["hillpc.local"], {"SVEV_TOKEN": TOKEN})
    assert not access.allows_host(header, "10.0.0.7")
