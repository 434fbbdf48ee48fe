"""What is said of a source whose frames are not to be measured in."""

import pytest

from rig.settings.trigger import ExternalTrigger, SoftwareTrigger, Trigger
from tests.triggering.feed import Feed
from triggering.alarms.notices import SpreadTeller, set_up_only
from triggering.sources.choice import trigger_source

SOFTWARE = SoftwareTrigger(source="software")


def _fed(cameras: int, apart: float) -> Feed:
    """A feed whose frames of a pulse lie so many periods apart."""
    feed = Feed(cameras)
    for pulse in range(20):
        for camera in range(cameras):
            feed.frame(camera, pulse + apart * camera / max(1, cameras - 1), pulse + 1)
        feed.advance(feed.time_of(pulse + 1))
    return feed


@pytest.mark.parametrize(
    ("settings", "cameras", "text"),
    [
        (ExternalTrigger(), 3, None),
        (SOFTWARE, 3, "software trigger, frames of a pulse lie up to 1.7 ms apart: for set-up only, not to measure in"),
        (SOFTWARE, 1, "the camera is triggered by software: for set-up only, not to measure in"),
    ],
)
def test_the_spread_is_said_of_a_source_that_is_for_set_up_only(
    settings: Trigger, cameras: int, text: str | None
) -> None:
    said = set_up_only(trigger_source(settings), _fed(cameras, 0.05).pairer.health())
    assert (said and said.text) == text


def test_it_is_told_when_it_is_known_and_again_when_it_has_become_twice_as_large() -> None:
    teller = SpreadTeller(trigger_source(SOFTWARE))
    assert teller.tell(Feed().pairer.health()) is None
    spreads = [0.01, 0.012, 0.03, 0.05]
    told = [teller.tell(_fed(3, spread).pairer.health()) is not None for spread in spreads]
    assert told == [True, False, True, False]
