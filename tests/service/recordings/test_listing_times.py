"""Times of recordings as the API gives them."""

import pytest

from recorder.catalogue.search import in_ns
from rig.clocks import UtcNs
from service.recordings.listing import utc


@pytest.mark.parametrize("ns", [0, 1, 499, 500, 999, 1000, 1_795_858_504_893_996_600, 1_795_858_504_893_997_499])
def test_what_came_since_a_time_holds_what_came_then(ns: int) -> None:
    """Whoever asks for recordings since the time of one gets this one, and asking until then does not."""
    since = in_ns(utc(UtcNs(ns)))
    assert since <= ns < since + 1000
