"""Messages far outside of the pulses are named by `verify`, and are no damage."""

from pathlib import Path

import pytest

from recorder.checking.verify import verify
from recorder.log.triplet_buffers import TripletBuffers
from rig.clocks import NS_PER_S, UtcNs
from rig.events import Event, Level
from tests.recorder.logs import SHAPE, make_tag, open_writer, write_pulse


@pytest.mark.parametrize(
    ("after_s", "said"),
    [
        (30, []),
        (7 * 86400, ["messages on /events stand 7.0 days after the last pulse: "]),
        (-5400, ["messages on /events stand 1.5 h before the first pulse: "]),
    ],
)
def test_an_event_far_from_the_pulses_is_named(tmp_path: Path, after_s: int, said: list[str]) -> None:
    buffers = TripletBuffers(SHAPE, 4)
    with open_writer(tmp_path / "log.mcap", buffers) as log:
        for pulse in (1, 2):
            write_pulse(log, buffers, make_tag(pulse))
        time = make_tag(2 if after_s > 0 else 1).time + after_s * NS_PER_S
        log.write_event(Event(UtcNs(time), Level.INFO, "recorder", "far away"))
    buffers.close()
    report = verify(tmp_path / "log.mcap")
    assert report.verdict == "clean"
    assert [text.partition("the computer")[0] for text in report.off_time] == said
