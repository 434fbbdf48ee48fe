"""All cameras lose their power while a line of the computer goes on making pulses: real processes, real libgpiod."""

import tempfile
from contextlib import nullcontext
from pathlib import Path

import pytest

from recorder.checking.verify import verify
from recorder.reading.triplets import tags
from rig.api.recordings import Counts
from rig.clocks import NS_PER_S, UtcAnchor, host_now
from rig.frame import FrameStatus
from rig.settings.file import load_rig
from service.headless import HeadlessRig
from service.processes.simulation import simulated_hill
from simrig.gpio.build import environment
from simrig.gpio.chip import GpioChip
from simrig.programs.simulated_hill import SimulatedHill
from tests.capture.rigs import write_rig
from tests.support.loopback import Loopback

pytestmark = pytest.mark.long

NAMES = ("K1", "K2")
RATE_HZ = 10.0
LINE, GATE = 1, 2


def test_each_pulse_of_the_line_is_tagged_absent_and_no_other(
    tmp_path: Path, loopback: Loopback, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While no camera is there, a gate stops the pulses for a while: their rhythm tells nothing of that."""
    monkeypatch.setenv("LD_PRELOAD", environment()["LD_PRELOAD"])  # for the processes of the rig
    with tempfile.TemporaryDirectory() as folder, GpioChip(Path(folder) / "gpiochip0") as chip:
        path = write_rig(tmp_path, "aravis", loopback, names=NAMES, source="gpio", rate_hz=RATE_HZ)
        keys = f'source = "gpio"\nchip = "{chip.path}"\nline = {LINE}\npulse_ms = 2.0\ngate = {{ line = {GATE} }}'
        path.write_text(path.read_text().replace('source = "gpio"', keys))
        rig, log = load_rig(path), tmp_path / "log.mcap"
        killed, gone, closed = list[int](), set[str](), list[int]()

        def on_event(line: str) -> None:
            if " gone" in line:
                gone.add(line.partition(" ")[0])

        def on_progress(counts: Counts) -> None:
            if counts.pulses > 5 and not killed:
                killed.append(len(chip.edges))
                for name in NAMES:
                    hill.kill(name)
            elif len(gone) == len(NAMES) and not closed:
                closed.append(len(chip.edges))
                chip.drive(GATE, high=False)
            elif closed and host_now() > chip.edges[-1].time + NS_PER_S:
                chip.drive(GATE, high=True)

        chip.drive(GATE, high=True)
        with simulated_hill(rig, host_now()) as made:
            assert isinstance(made, SimulatedHill)
            hill = made
            with HeadlessRig(rig, "", on_event, lambda _: nullcontext({})) as running:
                running.wait_until_warm()
                running.start_recording(log, session={}, seconds=9)
                running.wait_until_finished(on_progress, lambda: False)
        rises = [edge.time + UtcAnchor.take().offset_ns for edge in chip.edges if edge.high]
    assert closed, "the cameras were found to be gone"
    found = list(tags(log))
    pulses = [min(range(len(rises)), key=lambda n: abs(rises[n] - tag.time)) for tag in found]
    assert pulses == list(range(pulses[0], pulses[0] + len(found)))
    assert max(abs(rises[n] - tag.time) for n, tag in zip(pulses, found, strict=True)) < 5e6
    for pulse, tag in zip(pulses, found, strict=True):
        fates = {camera.status for camera in tag.cameras}
        if abs(pulse - killed[0] // 2) > 3:  # at its end a camera may have sent part of a frame
            assert fates == {FrameStatus.OK if pulse < killed[0] // 2 else FrameStatus.ABSENT}
    recounted = verify(log).recounted
    assert recounted.agrees, list(recounted.in_words())
    assert recounted.source is not None
    assert (recounted.source.unseen, recounted.source.unfired) == (0, 0)
