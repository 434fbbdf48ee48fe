"""A program of its own follows: it stands still for a recording, can be cancelled, and says how far it is."""

import pytest

from analysis.digitizing.desk import Desk
from bench.analysis.hill_logs import HillLog
from rig.api.digitizing import TrackOrder
from rig.errors import UnknownRecordingError
from tests.analysis.digitizing.hill import PATIENCE_S, Oriented, adopt, clicks
from tests.support.waiting import wait_until

ORDER = TrackOrder(things=["P1", "P2"], pulse=20, direction=1, most=10)


@pytest.mark.timeout(2 * PATIENCE_S)
def test_following_stands_still_while_a_recording_runs_and_cancelled_keeps_nothing(jump: HillLog, desk: Desk) -> None:
    recording = True
    waiting = Desk(desk.files, lambda: None, busy=lambda: recording)
    adopt(waiting, Oriented.of(desk))
    for click in clicks(desk, jump, 3, range(20, 21)):
        waiting.act("Anna", click.action())
    before = waiting.session("Anna").everything()
    follower = waiting.programs.follower
    assert waiting.programs.follow("Anna", ORDER).state == "tracking"
    wait_until(lambda: follower.state("Anna").paused, "it stands still")
    assert waiting.programs.follow("Anna", ORDER.model_copy(update={"things": ["P3"]})).paused  # nothing else begins
    assert follower.cancel("Anna").state == "none"
    follower.wait("Anna", 20)
    assert waiting.session("Anna").everything() == before
    assert waiting.programs.follow("Anna", ORDER).state == "tracking"
    wait_until(lambda: follower.state("Anna").paused, "it stands still again")
    recording = False
    wait_until(lambda: follower.state("Anna").share > 0.3, "it goes on, and says how far it is", PATIENCE_S)
    told = follower.wait("Anna", PATIENCE_S)
    assert told.tracked == {thing: list(range(21, 31)) for thing in ORDER.things}
    assert {why.code for why in told.stopped.values()} == {"hand_far"}
    with pytest.raises(UnknownRecordingError, match="the log has no pulse 999"):
        waiting.programs.follow("Anna", ORDER.model_copy(update={"pulse": 999}))
    waiting.close()
