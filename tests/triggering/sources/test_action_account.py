"""What is counted and said of the answers to action commands."""

from rig.clocks import HostNs
from triggering.sources.action_account import DEADLINE_NS, ActionAccount
from triggering.sources.action_command import Acknowledge, ActionStatus

S = 1_000_000_000
MS = 1_000_000
CAMERAS = [("10.0.0.1", "K1"), ("10.0.0.2", "K2")]


def _counted(account: ActionAccount) -> list[tuple[int, int, int, int]]:
    return [(each.acknowledged, each.late, each.refused, each.unanswered) for each in account.counts]


def test_each_answer_is_counted_for_its_camera() -> None:
    account = ActionAccount(CAMERAS)
    statuses = [(0, 0), (ActionStatus.LATE, 0), (0, ActionStatus.NO_REFERENCE_TIME), (ActionStatus.OVERFLOW, 0x8FFF)]
    for number, (first, second) in enumerate(statuses, start=1):
        now = HostNs(number * 33 * MS)
        account.sent(number, now, {0, 1})
        account.answered("10.0.0.1", Acknowledge(number, first), now)
        account.answered("10.0.0.2", Acknowledge(number, second), now)
    account.expire(HostNs(S))
    assert _counted(account) == [(2, 1, 1, 0), (2, 0, 2, 0)]
    assert [str(said).split(":")[0] for said in account.told()] == [
        "K1 gets action commands after their time",
        "K2 has no reference time, so it does not expose",
        "K1 holds no more scheduled action commands",
        "K2 refuses action commands (status 0x8fff)",
    ]


def test_an_answer_that_does_not_come_in_time_is_lost_and_counts_once() -> None:
    account = ActionAccount(CAMERAS)
    account.sent(1, HostNs(0), {0, 1})
    account.answered("10.0.0.1", Acknowledge(1, 0), HostNs(DEADLINE_NS - 1))
    account.expire(HostNs(DEADLINE_NS))
    account.answered("10.0.0.2", Acknowledge(1, 0), HostNs(DEADLINE_NS + 1))
    account.expire(HostNs(2 * DEADLINE_NS))
    assert _counted(account) == [(1, 0, 0, 0), (0, 0, 0, 1)]
    assert account.told() == []  # one answer may get lost


def test_answers_of_strangers_and_second_answers_count_nothing() -> None:
    account = ActionAccount(CAMERAS)
    account.sent(1, HostNs(0), {0})
    for address, number in (("10.0.0.9", 1), ("10.0.0.2", 1), ("10.0.0.1", 2), ("10.0.0.1", 1), ("10.0.0.1", 1)):
        account.answered(address, Acknowledge(number, 0), HostNs(1))
    assert _counted(account) == [(1, 0, 0, 0), (0, 0, 0, 0)]


def test_a_camera_that_answers_nothing_is_told_by_name_once_and_again_after_it_had_answered_for_long() -> None:
    account, said = ActionAccount(CAMERAS), list[str]()
    silent = [*range(1, 40), *range(600, 640)]
    for number in range(1, 700):
        now = HostNs(number * 33 * MS)
        account.expire(now)
        account.sent(number, now, {0, 1})
        account.answered("10.0.0.1", Acknowledge(number, 0), now)
        if number not in silent:
            account.answered("10.0.0.2", Acknowledge(number, 0), now)
        said += map(str, account.told())
    account.expire(HostNs(99 * S))
    assert account.counts[1].unanswered == len(silent)
    assert [each[:37] for each in said] == ["K2 does not answer action commands: c"] * 2
