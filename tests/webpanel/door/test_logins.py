"""Sessions end, and guessing is slowed down, by the clock."""

from dataclasses import dataclass

from webpanel.door.logins import SESSION_S, Brake, Sessions
from webpanel.door.roles import Role


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
