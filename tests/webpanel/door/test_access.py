"""The rules of access: which addresses need a token, what a token is, which names are ours."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from starlette.requests import HTTPConnection

from rig.errors import BadInputError
from rig.settings.file import CONFIG
from webpanel.door.access import Access, is_loopback, site_of
from webpanel.door.roles import Role

TOKEN = "a-token-for-the-tests-only"  # noqa: S105
EVERYWHERE = "0.0.0.0"  # noqa: S104 - nothing listens there


@pytest.mark.parametrize("host", ["127.0.0.1", "127.10.3.1", "::1", "[::1]", "localhost"])
def test_on_loopback_no_token_is_needed(host: str) -> None:
    assert is_loopback(host)
    assert not Access.for_address(host, environment={}).tokens


@pytest.mark.parametrize("host", [EVERYWHERE, "::", "192.168.1.5", "hillpc", "", "128.0.0.1", "localhost.evil.org"])
def test_elsewhere_it_is(host: str) -> None:
    with pytest.raises(BadInputError, match="--token-file"):
        Access.for_address(host, environment={})
    assert Access.for_address(host, environment={"SVEV_TOKEN": TOKEN}).tokens.role_of(TOKEN) is Role.ADMINISTER


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
    tokens = Access.for_address(EVERYWHERE, file, environment={"SVEV_TOKEN": "another-token-altogether"}).tokens
    assert tokens.role_of(TOKEN) is Role.ADMINISTER
    assert tokens.role_of("another-token-altogether") is None


def test_only_the_whole_token_is_the_token() -> None:
    tokens = Access.for_address(EVERYWHERE, environment={"SVEV_TOKEN": TOKEN}).tokens
    assert tokens.role_of(TOKEN)
    for wrong in ("", TOKEN[:-1], TOKEN + "x", TOKEN.upper(), "å" * 26, "\udcff"):
        assert tokens.role_of(wrong) is None
    assert Access("127.0.0.1").tokens.role_of("") is None


ROLES = f"""# who is at the hill
watch a-token-to-watch-with

operate\t{TOKEN}
administer #a-token-for-all-things
"""


def test_a_file_holds_a_token_for_each_role(tmp_path: Path) -> None:
    file = tmp_path / "tokens"
    file.write_text(ROLES)
    tokens = Access.for_address(EVERYWHERE, file).tokens
    given = ("a-token-to-watch-with", TOKEN, "#a-token-for-all-things", "watch")
    assert [tokens.role_of(token) for token in given] == [Role.WATCH, Role.OPERATE, Role.ADMINISTER, None]


def test_a_file_that_all_may_read_is_warned_about(tmp_path: Path) -> None:
    file = tmp_path / "token"
    file.write_text(TOKEN)
    warnings = []
    for mode in (0o600, 0o640, 0o644):
        file.chmod(mode)
        warnings.append(Access.for_address(EVERYWHERE, file).tokens.warning)
    assert warnings[:2] == ["", ""]
    assert warnings[2].endswith(f"chmod 600 {file}")


FORWARDED = [
    ("10.0.0.1", "192.168.1.7", "https", "192.168.1.7", True),
    ("10.0.0.1", "1.2.3.4, 192.168.1.7, 10.0.0.9", "http, https", "192.168.1.7", True),  # 1.2.3.4 is made up
    ("10.0.0.1", "nonsense", "http", "10.0.0.1", False),
    ("192.168.1.7", "1.2.3.4", "https", "192.168.1.7", False),  # no proxy of ours
]


@pytest.mark.parametrize(("peer", "named", "scheme", "client", "https"), FORWARDED)
def test_only_trusted_proxies_are_believed(peer: str, named: str, scheme: str, client: str, https: bool) -> None:
    access = Access.for_address("127.0.0.1", environment={}, proxies=["10.0.0.0/24"])
    headers = [(b"x-forwarded-for", named.encode()), (b"x-forwarded-proto", scheme.encode())]
    request = HTTPConnection({"type": "http", "scheme": "http", "client": (peer, 1), "headers": headers})
    assert access.client_of(request) == client
    assert access.is_https(request) is https


def test_a_proxy_is_an_address() -> None:
    with pytest.raises(BadInputError, match="--proxy gateway"):
        Access.for_address("127.0.0.1", environment={}, proxies=["gateway"])


def test_a_network_of_ipv6_addresses_is_one_client() -> None:
    assert site_of("2001:db8::1") == site_of("2001:db8::ffff:1") != site_of("2001:db8:0:1::1")
    assert site_of("10.0.0.1") == "10.0.0.1"


def test_a_token_is_never_printed() -> None:
    assert TOKEN not in repr(Access.for_address(EVERYWHERE, environment={"SVEV_TOKEN": TOKEN}))


@pytest.mark.parametrize(
    "content",
    [
        "",
        "# only a remark",
        f"rule {TOKEN}",
        f"watch {TOKEN}\noperate {TOKEN}",
        "watch short",
        "short",
        "two words are not a token",
        "x" * 1001,
        "nøkkel-nøkkel-nøkkel",
    ],
)
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
