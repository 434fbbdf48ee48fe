"""Sessions end, and guessing is slowed down, by the clock."""

from dataclasses import dataclass
from pathlib import Path

from rig.phrase import Phrase
from webpanel.door.logins import SESSION_S, Brake, Sessions
from webpanel.door.roles import Role
from webpanel.door.session_file import NAME, SessionFile
from webpanel.door.tokens import Tokens


@dataclass
class Clock:
    """A clock that stands still until it is set."""

    now: float = 100.0

    def __call__(self) -> float:
        """The time, s."""
        return self.now


def test_a_session_ends_after_its_time() -> None:
    clock = Clock()
    sessions = Sessions(clock)
    key = sessions.begin(Role.OPERATE)
    clock.now += SESSION_S - 1
    assert sessions.role_of(key) is Role.OPERATE
    clock.now += 2
    assert not sessions.role_of(key)


def test_a_session_from_before_the_clock_was_set_back_ends() -> None:
    clock = Clock()
    sessions = Sessions(clock)
    key = sessions.begin(Role.WATCH)
    clock.now -= 1
    assert sessions.role_of(key) is Role.WATCH
    clock.now -= 60
    assert not sessions.role_of(key)


def test_sessions_outlive_the_service_but_not_their_end_nor_the_tokens(tmp_path: Path) -> None:
    clock, told = Clock(), list[Phrase]()
    tokens = Tokens({b"one-token-of-16-letters": Role.WATCH})
    mark = tokens.mark(b"secret", b"sessions").hex()
    file = SessionFile(tmp_path, mark, told.append)
    sessions = Sessions(clock, file)
    keys = [sessions.begin(role) for role in (Role.WATCH, Role.OPERATE, Role.WATCH)]
    sessions.end(keys[2])
    assert file.wait(20)
    written = (tmp_path / NAME).read_text()
    assert not [key for key in keys if key in written]

    again = Sessions(clock, SessionFile(tmp_path, mark, told.append))
    assert [again.role_of(key) for key in keys] == [Role.WATCH, Role.OPERATE, None]
    clock.now += SESSION_S
    assert not again.role_of(keys[0])
    clock.now -= SESSION_S
    other = Tokens({b"one-token-of-16-letters": Role.OPERATE}).mark(b"secret", b"sessions").hex()
    assert not Sessions(clock, SessionFile(tmp_path, other, told.append)).role_of(keys[0])
    (tmp_path / NAME).chmod(0o666)
    assert not Sessions(clock, SessionFile(tmp_path, mark, told.append)).role_of(keys[0])
    (tmp_path / NAME).write_text("[")
    assert not Sessions(clock, SessionFile(tmp_path, mark, told.append)).role_of(keys[0])
    assert not told


def test_who_cannot_keep_sessions_says_so_once_and_goes_on(tmp_path: Path) -> None:
    told = list[Phrase]()
    file = SessionFile(tmp_path / "gone", "", told.append)
    sessions = Sessions(Clock(), file)
    for _ in range(2):
        assert sessions.role_of(sessions.begin(Role.WATCH)) is Role.WATCH
        assert file.wait(20)
    (said,) = told
    assert "everybody logs in again" in said.text


def test_no_two_sessions_have_one_key() -> None:
    sessions = Sessions()
    assert len({sessions.begin(Role.OPERATE) for _ in range(50)}) == 50
    assert not sessions.role_of("")
    assert not sessions.role_of("\udcff")


def test_sessions_are_bounded_the_oldest_goes() -> None:
    sessions = Sessions()
    keys = [sessions.begin(Role.OPERATE) for _ in range(201)]
    assert not sessions.role_of(keys[0])
    assert all(sessions.role_of(key) for key in keys[1:])


def test_the_brake_lets_go_after_a_minute() -> None:
    clock = Clock()
    brake = Brake(clock)
    for guess in range(9):
        assert brake.wrong("a", str(guess)) == guess + 1
    assert brake.wrong("a", "8") == 0, "the same wrong token again is no further guess"
    assert brake.seconds_to_wait("a") == 0
    brake.wrong("a", "9")
    assert brake.seconds_to_wait("a") == 60
    assert brake.seconds_to_wait("b") == 0
    clock.now += 60
    assert brake.seconds_to_wait("a") == 0
    assert brake.wrong("a", "9") == 1
    assert brake.seconds_to_wait("a") == 0


def test_the_brake_remembers_a_bounded_number_of_clients() -> None:
    brake = Brake(Clock())
    for client in range(5000):
        brake.wrong(str(client), "guess")
    assert len(brake._wrong) == 1000
