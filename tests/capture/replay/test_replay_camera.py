"""What a replayed camera does where the log says that no frame came; what every camera does: `test_conformance`."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.typing import NDArray

from capture.replay.camera import ReplayCamera
from capture.replay.timeline import Timeline
from capture.seam import Arrival
from rig.clocks import UtcNs, host_now
from rig.errors import CameraError, CameraNotFoundError
from rig.frame import FrameRecord, FrameStatus, StampedPixels
from rig.settings.camera import CameraSettings, Region
from rig.transport.ring import CameraRing
from tests.capture.replay.test_timeline import ABSENT, DAMAGED, LOST, MISSED, OK, Log, make_log
from tests.capture.whole import whole_frames

#: How late a crowded machine may let a camera return.
LATE_NS = 250_000_000
SETTINGS = CameraSettings(name="K1", backend="replay", address="log.mcap", region=Region(width=4, height=3))


@pytest.fixture
def ring() -> Iterator[CameraRing]:
    made = CameraRing.create("K1", SETTINGS.frame_bytes, 4)
    yield made
    made.close()


def _collect(camera: ReplayCamera, ring: CameraRing, count: int) -> list[tuple[Arrival, int]]:
    """The next arrivals, each with the place in the log that its pixels name, -1 without pixels."""
    collected: list[tuple[Arrival, int]] = []
    deadline = host_now() + 10_000_000_000
    while len(collected) < count and host_now() < deadline:
        if (arrival := camera.receive(0.05)) is not None:
            collected.append((arrival, int(ring.frame(arrival.slot)[0]) if isinstance(arrival, FrameRecord) else -1))
            if isinstance(arrival, FrameRecord):
                ring.return_slot(arrival.slot)
    assert len(collected) == count
    return collected


def _replay(log: Log, ring: CameraRing) -> tuple[ReplayCamera, Timeline]:
    timeline = Timeline(log, host_now())
    camera = ReplayCamera(SETTINGS, ring, timeline)
    camera.start()
    return camera, timeline


def test_the_log_is_played_again_and_again_and_nothing_is_left_out(ring: CameraRing) -> None:
    camera, _ = _replay(make_log([OK, LOST, OK, MISSED, DAMAGED, OK]), ring)
    arrivals = _collect(camera, ring, 14)
    camera.close()
    order = [0, 2, -1, 5]
    seen = [place for _, place in arrivals]
    first = order.index(seen[0])
    assert seen == [order[(first + n) % 4] for n in range(14)]
    whole = [(place, arrival) for arrival, place in arrivals if isinstance(arrival, FrameRecord)]
    ids = {(one[0], two[0]): two[1].frame_id - one[1].frame_id for one, two in pairwise(whole)}
    assert ids == {(0, 2): 2, (2, 5): 2, (5, 0): 1}
    times = [arrival.device_time for arrival, _ in arrivals if arrival.device_time is not None]
    assert len(times) == 14
    assert times == sorted(set(times))


def test_an_absent_camera_is_gone_and_comes_back_when_it_came_back_in_the_log(ring: CameraRing) -> None:
    log = make_log([OK] * 10 + [ABSENT] * 20 + [OK] * 30)
    camera, timeline = _replay(log, ring)
    with pytest.raises(CameraError, match=r"camera K1 is not there in log\.mcap at this time: wait for its return"):
        _collect(camera, ring, 20)
    camera.close()
    again = ReplayCamera(SETTINGS, ring, timeline)  # it returns within the time that the grabber would wait anyway
    returned = host_now()
    assert timeline.pulse_time(29) < returned < timeline.pulse_time(30) + LATE_NS
    again.start()
    assert timeline.next_pulse(returned) <= _collect(again, ring, 2)[0][1] <= timeline.next_pulse(host_now())
    again.close()


def test_a_camera_that_stays_away_for_long_is_not_waited_for(ring: CameraRing) -> None:
    with pytest.raises(CameraNotFoundError, match="at this time: wait for its return"):
        _replay(make_log([ABSENT] * 500 + [OK]), ring)


def test_a_camera_that_is_absent_throughout_says_what_to_do(ring: CameraRing) -> None:
    with pytest.raises(CameraNotFoundError, match=r"absent in the whole of log\.mcap: take it out of the rig file"):
        _replay(make_log([ABSENT] * 3), ring)


def test_a_connection_that_began_anew_in_the_log_begins_anew(ring: CameraRing) -> None:
    log, later = make_log([OK] * 10, first_id=90), make_log([OK] * 90, device=lambda at: at)
    times = make_log([OK] * 100).times
    log.times = times[:10] + [UtcNs(time + LATE_NS) for time in times[10:]]  # so that a crowded machine is in time
    log.tags += later.tags
    camera, timeline = _replay(log, ring)
    with pytest.raises(CameraError):
        _collect(camera, ring, 20)
    camera.close()
    again = ReplayCamera(SETTINGS, ring, timeline)
    again.start()
    arrivals = _collect(again, ring, 2)
    again.close()
    assert arrivals[0][1] == 10, "no pulse is lost in between"
    assert whole_frames([arrivals[0][0]])[0].frame_id == 1
    latch = again.latch()
    assert abs((latch.host - timeline.pulse_time(10)) - latch.device) < 1_000_000


def test_a_signature_in_the_pixels_is_passed_on_in_the_frame_s_own_columns(ring: CameraRing) -> None:
    log = make_log([OK] * 20)
    log.tags = [replace(tag, columns=(640, 644), stamped=(2, 641, 3)) for tag in log.tags]
    camera, _ = _replay(log, ring)
    ((arrival, _),) = _collect(camera, ring, 1)
    camera.close()
    assert whole_frames([arrival])[0].stamped == StampedPixels(2, 1, 3)


class _Torn(Log):
    """A log whose second frame cannot be read."""

    def read_into(self, out: NDArray[np.uint8], place: int) -> bool:
        return super().read_into(out, place) and place != 1


def test_a_frame_that_the_log_has_lost_comes_damaged(ring: CameraRing) -> None:
    intact = make_log([OK] * 20)
    camera, timeline = _replay(_Torn(intact.times, intact.tags), ring)
    arrivals = [arrival for arrival, _ in _collect(camera, ring, 20)]
    camera.close()
    (torn,) = [arrival for arrival in arrivals if not isinstance(arrival, FrameRecord)]
    assert torn.device_time in {timeline.frame_device_time(1), timeline.frame_device_time(21)}
    assert FrameStatus.OK is intact.tags[1].status
    assert [ring.take_slot() for _ in range(4)] == [0, 1, 2, 3], "its slot was given back"
    ring.reclaim()
