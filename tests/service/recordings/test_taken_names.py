"""A name that is free when it is chosen, and taken when the log is made: the recording takes the next number."""

from pathlib import Path

import pytest

from recorder.checking.verify import verify
from recorder.reading.info import info
from rig.settings.file import load_rig
from service.headless import HeadlessRig
from service.recordings.storage import free_path
from tests.capture.rigs import write_rig
from tests.support.loopback import Loopback


def test_the_recording_has_the_next_number_everywhere(tmp_path: Path, loopback: Loopback) -> None:
    path = tmp_path / "jump.mcap"
    said: list[str] = []
    with HeadlessRig(load_rig(write_rig(tmp_path, "sim", loopback)), "", said.append) as running:
        running.wait_until_warm()
        path.write_text("of another program")
        (tmp_path / "jump-2.mcap").symlink_to("nowhere")
        running.start_recording(path, session={}, pulses=10, seconds=5)
        report = running.wait_until_finished(lambda _: None, lambda: 0)
    assert report.path == tmp_path / "jump-3.mcap"
    assert (path.read_text(), report.counts.complete) == ("of another program", 10)
    assert info(report.path).recording == "jump-3"
    found = verify(report.path)
    assert (found.verdict, found.findings) == ("clean", ())
    assert not [event for event in found.events if "exists already" in event.message]


@pytest.mark.parametrize("taken", [[], ["a.mcap"], ["a.mcap", "a-2.mcap", "a-4.mcap"]])
def test_the_first_free_number_is_taken(taken: list[str], tmp_path: Path) -> None:
    for name in taken:
        (tmp_path / name).symlink_to("nowhere")
    assert free_path(tmp_path / "a.mcap").name == (f"a-{min(len(taken), 2) + 1}.mcap" if taken else "a.mcap")
