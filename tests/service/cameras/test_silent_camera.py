"""A camera that freezes or dies during a recording: the recorder reports it, and the grabber sets it up again."""

from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path

import pytest

from recorder.checking.verify import verify
from recorder.reading.triplets import triplets
from rig.api.recordings import Counts
from rig.clocks import NS_PER_S, host_now
from rig.frame import FrameStatus
from rig.tag import TripletTag
from service.headless import HeadlessRig
from service.processes.simulation import simulated_hill
from simrig.programs.simulated_hill import SimulatedHill
from tests.capture.rigs import make_rig
from tests.support.loopback import Loopback
from tests.support.reliability import FaultTable

pytestmark = pytest.mark.long

#: After the third frame of the others: a processor that others want too.
NOTICED_NS = NS_PER_S // 5
#: The recording ends when so many triplets are whole again.
WHOLE_AGAIN = 30


@pytest.mark.parametrize("how", ["freeze", "kill"])
def test_a_camera_that_falls_silent_is_noticed_and_comes_back(
    tmp_path: Path, loopback: Loopback, fault_table: FaultTable, how: str
) -> None:
    rig, epoch = make_rig(tmp_path, "aravis", loopback), host_now()
    path, said = tmp_path / "log.mcap", list[str]()
    with simulated_hill(rig, epoch) as hill:
        assert isinstance(hill, SimulatedHill)

        def on_event(line: str) -> None:
            """Unfreeze or restart the camera when its loss has been reported."""
            said.append(line)
            if line.startswith("K2 gone"):
                hill.thaw("K2") if how == "freeze" else hill.restart("K2")

        def on_progress(counts: Counts) -> None:
            """Freeze or kill the camera, once, when the recording has some pulses, and wait until it is back."""
            whole.append(counts.complete)
            if counts.pulses > 20 and not gone:
                gone.append(len(said))
                hill.freeze("K2") if how == "freeze" else hill.kill("K2")
            elif gone and not back and any(line.startswith("K2 connected") for line in said[gone[0] :]):
                back.append(counts.complete)

        gone, back, whole = list[int](), list[int](), [0]
        with HeadlessRig(rig, "", on_event, lambda _: nullcontext({})) as running:
            running.wait_until_warm()
            running.start_recording(path, session={}, seconds=60)
            running.wait_until_finished(on_progress, lambda: bool(back) and whole[-1] >= back[0] + WHOLE_AGAIN)
    tags = [tag for tag, _ in triplets(path)]
    others = [tag.cameras[i].status for tag in tags for i in (0, 2)]
    assert FrameStatus.ABSENT not in others, "the others went on"
    assert others.count(FrameStatus.OK) > 0.9 * len(others), "a busy machine loses frames of theirs too, but few"
    fates = [tag.cameras[1].status for tag in tags]
    lost = _hole(fates)
    assert all(fates[number] is not FrameStatus.OK for number in lost), "one hole"
    assert fates[-1] is FrameStatus.OK, said
    report = verify(path)
    messages = [event.message.partition(":")[0] for event in report.events if event.name == "K2"]
    assert report.recounted.agrees, report.recounted.differences
    assert messages[0] == "silent"
    assert "connected" in messages
    noticed = next(event for event in report.events if event.name == "K2")
    assert noticed.time - _arrived(tags[lost[0] : lost[0] + 3]) < NOTICED_NS
    fault = "a camera freezes, and goes on" if how == "freeze" else "a camera loses its power, and comes back"
    words = f"K2 {noticed.message}; after that K2 connected"
    fault_table.tell("Cameras and pulses", fault, lost=f"none: {len(lost)} frames of K2, lost or absent", said=words)


def _hole(fates: Sequence[FrameStatus]) -> range:
    """The pulses around those of which the camera was absent, until a whole frame on both sides."""
    first = fates.index(FrameStatus.ABSENT)
    end = len(fates) - fates[::-1].index(FrameStatus.ABSENT)
    while first and fates[first - 1] is not FrameStatus.OK:
        first -= 1
    while end < len(fates) and fates[end] is not FrameStatus.OK:
        end += 1
    return range(first, end)


def _arrived(tags: Sequence[TripletTag]) -> int:
    """When the frames of the cameras that went on had come: the machine may be busy with other things; UTC, ns."""
    return max(tag.cameras[i].host_time or 0 for tag in tags for i in (0, 2))
